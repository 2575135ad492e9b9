//! Why a splat job ends without a result.

use std::path::PathBuf;

use ::priors::PriorsError;
use ::splats::SplatError;
use camera::SimilarityError;
use city::ModelError;
use cityfiles::CityError;
use crs::CrsError;
use formats::FormatError;
use formats::raster::RasterError;
use formats::rpc::RpcReadError;
use formats::splat_ply::LocalOrigin;
use numeric::{Cancelled, failures};

use job::error::{JobError, SettingError, from_steps, job_errors};
use job::files::FileError;

/// Splats that could not be made or rendered.
#[derive(Debug, thiserror::Error)]
pub(crate) enum SplatsJobError {
    /// No cell of the surface model has a height.
    #[error("the surface model has no height: {}", path.display())]
    NoHeight {
        /// The surface model.
        path: PathBuf,
    },
    /// The confidence of the cells cannot be read.
    #[error("cannot read the confidence")]
    Confidence(#[source] RasterError),
    /// An image shows another place.
    #[error("the image does not see {target}: {}", path.display())]
    NotSeen {
        /// What it should see: the surface model or the splats.
        target: &'static str,
        /// The image.
        path: PathBuf,
    },
    /// A coordinate reference system cannot be used.
    #[error(transparent)]
    Crs(#[from] CrsError),
    /// No splats follow from the inputs.
    #[error(transparent)]
    Splats(#[from] SplatError),
    /// No origin lies beside the splats.
    #[error("no origin beside the splats: expected {}", path.display())]
    NoOrigin {
        /// The file that was looked for.
        path: PathBuf,
    },
    /// The heights of the splats are not ellipsoidal, so RPCs cannot see them.
    #[error("the splats' heights are above {vertical}, expected the ellipsoid: {}", path.display())]
    NotEllipsoidal {
        /// Vertical datum of the splats.
        vertical: String,
        /// The splats.
        path: PathBuf,
    },
    /// Neither images nor perspective cameras were given.
    #[error("nothing to look through: expected images or perspective cameras")]
    NoCamera,
    /// An image of the camera model refers to a camera that does not exist.
    #[error("image {name} of the model has no camera")]
    NoLens {
        /// Name of the image.
        name: String,
    },
    /// A camera that is to be made smaller has a lens with distortion.
    #[error("the lens of {name} has distortion ({model}), expected a pinhole to make the image smaller: shrink by 1")]
    ShrunkLens {
        /// Name of the view.
        name: String,
        /// Name of the lens model.
        model: &'static str,
    },
    /// The city model cannot be read.
    #[error(transparent)]
    City(#[from] CityError),
    /// The triangles of the city model cannot be made.
    #[error(transparent)]
    CityModel(#[from] ModelError),
    /// The triangles of the city model cannot be searched, or its place cannot be used.
    #[error(transparent)]
    Priors(#[from] PriorsError),
    /// The city model has no usable surface of a building.
    #[error("no surface of a building in the model's {objects} objects can be used: {}", path.display())]
    NoSurface {
        /// The model.
        path: PathBuf,
        /// Number of its objects.
        objects: usize,
    },
    /// The origin of splats or city model is not finite.
    #[error(transparent)]
    Similarity(#[from] SimilarityError),
    /// Nothing says how a city model lies to the splats.
    #[error("the splats do not say where on a map they lie, expected the similarity from the city model to them: {}", path.display())]
    NotPlaced {
        /// The splats.
        path: PathBuf,
    },
    /// Splats and city model lie on different maps.
    #[error(
        "the splats are in {} above the {}, the city model is in {city} above {vertical}; convert the city model first",
        splats.crs, splats.vertical
    )]
    OtherMap {
        /// The origin of the splats.
        splats: Box<LocalOrigin>,
        /// Definition of the map of the city model.
        city: String,
        /// Vertical datum of the city model.
        vertical: String,
    },
    /// Two views have the same name.
    #[error("two views would be written as {name}")]
    SameName {
        /// Name of their files.
        name: String,
    },
    /// A picture has another size than its camera.
    #[error("the picture of {name} has {found:?} pixels, its camera {expected:?}")]
    PictureSize {
        /// Name of the view.
        name: String,
        /// Columns and rows of the picture.
        found: [usize; 2],
        /// Columns and rows of the camera.
        expected: [usize; 2],
    },
    /// A setting, a file or the threads cannot be used, or the job was cancelled.
    #[error(transparent)]
    Job(#[from] JobError),
}

failures!(SplatsJobError: Other {
    Self::Confidence(error) => error.kind(),
    Self::Crs(error) => error.kind(),
    Self::City(error) => error.kind(),
    Self::Priors(error) => error.kind(),
    Self::Job(error) => error.kind(),
});

job_errors!(SplatsJobError {
    Self::NoCamera => Some("the cameras"),
    Self::NotPlaced { .. } => Some("the place of the splats"),
});

from_steps!(SplatsJobError: Job(FileError, SettingError, Cancelled, RasterError, RpcReadError, FormatError));
