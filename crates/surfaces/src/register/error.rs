//! Reasons why an image cannot be registered.

use std::path::PathBuf;

use camera::CameraError;
use crs::CrsError;
use formats::FormatError;
use formats::raster::RasterError;
use formats::rpc::RpcReadError;
use numeric::{Cancelled, failures};

use crate::ortho::OrthoError;
use job::error::{JobError, SettingError, from_steps, job_errors};
use job::files::FileError;

/// An image that cannot be registered.
#[derive(Debug, thiserror::Error)]
pub(crate) enum RegisterError {
    /// The model has no heights.
    #[error("the model has no heights: {}", path.display())]
    NoHeights {
        /// The surface model or the splats.
        path: PathBuf,
    },
    /// No image shows what the surface looks like.
    #[error("the surface model comes with no images that show what it looks like: {}", path.display())]
    NoImages {
        /// The surface model.
        path: PathBuf,
    },
    /// No origin lies beside the splats.
    #[error("no origin beside the splats: expected {}", path.display())]
    NoOrigin {
        /// The file that was looked for.
        path: PathBuf,
    },
    /// The heights of the splats are not ellipsoidal, so RPCs cannot see them.
    #[error("the splats' heights are above {vertical}, expected the ellipsoid: {}", path.display())]
    Datum {
        /// Vertical datum of the splats.
        vertical: String,
        /// The splats.
        path: PathBuf,
    },
    /// The image's camera fails at the model.
    #[error("the camera of the image has no answer at the model: {}", path.display())]
    Camera {
        /// The image.
        path: PathBuf,
        /// Reason given by the camera model.
        source: CameraError,
    },
    /// An image cannot be laid on the surface.
    #[error(transparent)]
    Laid(Box<OrthoError>),
    /// A coordinate reference system cannot be used.
    #[error(transparent)]
    Crs(#[from] CrsError),
    /// Too few points of the model are found in the image.
    #[error(
        "{found} of {tried} points of the model are found in the image, expected at least {needed}: does it show the \
         same place, and is its pointing error within {reach_px} px?"
    )]
    TooFew {
        /// Points found.
        found: usize,
        /// Points searched for.
        tried: usize,
        /// Least number of points.
        needed: usize,
        /// Radius of the search, pixels.
        reach_px: f64,
    },
    /// The points found do not agree.
    #[error("{agree} of the {found} points found in the image agree with one correction, expected at least half")]
    NoAgreement {
        /// Points that agree.
        agree: usize,
        /// Points found.
        found: usize,
    },
    /// A setting, a file or the threads cannot be used, or the job was cancelled.
    #[error(transparent)]
    Job(#[from] JobError),
}

failures!(RegisterError: Other {
    Self::Laid(error) => error.kind(),
    Self::Crs(error) => error.kind(),
    Self::Job(error) => error.kind(),
});

job_errors!(RegisterError {
    Self::NoImages { .. } => Some("the images"),
    Self::TooFew { .. } => Some("the reach of the search"),
    Self::Laid(error) => error.setting(),
});

from_steps!(
    RegisterError: Job(SettingError, FileError, Cancelled, RasterError, RpcReadError, FormatError),
    Laid(OrthoError)
);
