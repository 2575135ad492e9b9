//! Why the priors job ends without a result.

use std::path::PathBuf;

use ::priors::PriorsError;
use camera::{FitError, LensError, SimilarityError};
use city::ModelError;
use cityfiles::CityError;
use crs::CrsError;
use formats::FormatError;
use formats::raster::RasterError;
use formats::rpc::RpcReadError;
use numeric::{Cancelled, Kind, failures};
use report::PictureError;

use job::error::{JobError, from_steps, job_errors};
use job::files::FileError;

/// Priors that could not be made.
#[derive(Debug, thiserror::Error)]
pub(crate) enum PriorsJobError {
    /// Both an offset and a transform were given.
    #[error("an offset and a transform were given, expected one of them")]
    TwoFrames,
    /// Values for satellite images were given with perspective cameras.
    #[error(
        "a map, a vertical datum and pointing corrections are for satellite images, and the cameras are perspective"
    )]
    NotSatellite,
    /// Values for perspective cameras were given with satellite images.
    #[error(
        "an offset, a transform and pictures of the dataset are for perspective cameras: satellite images find the \
         model by its coordinates, and their maps lie on their own pixels"
    )]
    NotPerspective,
    /// Not exactly one source of perspective cameras.
    #[error("{count} cameras are named, expected satellite images, or one COLMAP folder or transforms.json")]
    CameraCount {
        /// Number of paths.
        count: usize,
    },
    /// A path holds no cameras.
    #[error(
        "found no cameras: expected cameras.bin or cameras.txt of a COLMAP model, sparse/0 with them, transforms.json, \
         or satellite images: {}",
        path.display()
    )]
    NoCameras {
        /// The path.
        path: PathBuf,
    },
    /// A file that is neither a camera model nor an image.
    #[error("cameras are read from a COLMAP folder or a transforms.json, found another file: {}", path.display())]
    NotCameras {
        /// The file.
        path: PathBuf,
    },
    /// The cameras have no image.
    #[error("the cameras have no image: {}", path.display())]
    NoImages {
        /// Where the cameras were read.
        path: PathBuf,
    },
    /// A picture is missing.
    #[error("there is no picture of the camera {name:?} in the folder: {}", folder.display())]
    NoPicture {
        /// Name of the image.
        name: String,
        /// The folder.
        folder: PathBuf,
    },
    /// A picture lies in the folder that is to be replaced.
    #[error("the picture lies in the folder that the dataset's pictures go to: {}", path.display())]
    PictureInOutput {
        /// The picture.
        path: PathBuf,
    },
    /// A picture has another size than its camera.
    #[error(
        "the picture has {} x {} pixels, its camera needs {} x {}: {}",
        found[0], found[1], expected[0], expected[1], path.display()
    )]
    PictureSize {
        /// The picture.
        path: PathBuf,
        /// Its columns and rows.
        found: [usize; 2],
        /// Columns and rows of the camera.
        expected: [usize; 2],
    },
    /// Among satellite images there is something else.
    #[error("among satellite images there is something else: {}", path.display())]
    MixedCameras {
        /// The other file.
        path: PathBuf,
    },
    /// A folder cannot be listed.
    #[error("cannot read the folder: {}", path.display())]
    Unlisted {
        /// The folder.
        path: PathBuf,
        /// Reason given by the operating system.
        source: std::io::Error,
    },
    /// Two images would share their maps.
    #[error(
        "two images have the same file stem, by which trainers pair them with their maps: {first:?} and {second:?}"
    )]
    SameStem {
        /// Name of the first image.
        first: String,
        /// Name of the second image.
        second: String,
    },
    /// Two satellite images would share their maps.
    #[error("two images have the same name, and so would their maps: {} and {}", first.display(), second.display())]
    SameName {
        /// The first image.
        first: PathBuf,
        /// The second image.
        second: PathBuf,
    },
    /// The name of an image has a dot before its ending.
    #[error(
        "the image name {name:?} has a dot before its ending: trainers cut it there and pair it with the maps of another \
         image; rename it"
    )]
    DotInName {
        /// Name of the image.
        name: String,
    },
    /// The name of an image cannot be the name of a file.
    #[error("the image name {name:?} gives no file name for its maps: rename it")]
    BadName {
        /// Name of the image.
        name: String,
    },
    /// An image is too large.
    #[error("the image {name:?} has {width} × {height} pixels, up to {limit} are rendered")]
    TooLarge {
        /// Name of the image.
        name: String,
        /// Columns.
        width: usize,
        /// Rows.
        height: usize,
        /// Largest number of pixels.
        limit: usize,
    },
    /// A lens does not suit the trainer.
    #[error("the camera of the image {name:?} cannot be used")]
    Lens {
        /// Name of the image.
        name: String,
        /// Why.
        source: LensFault,
    },
    /// The model has no usable object.
    #[error("no object of the model could be used ({objects} objects; an account of the model names the reasons): {}", path.display())]
    NoObject {
        /// The model.
        path: PathBuf,
        /// Number of its objects.
        objects: usize,
    },
    /// No camera has a building in its image.
    #[error(
        "no camera has a building in its image: in the frame of the model the cameras are at {cameras}, and the model \
         reaches from {model}; state how they lie to one another"
    )]
    NothingInSight {
        /// Box around the cameras.
        cameras: String,
        /// Box around the model.
        model: String,
    },
    /// No satellite image has a building in it.
    #[error("no image has a building in it: the model is at {model}, the first image at {image}")]
    NothingInImages {
        /// Place of the model.
        model: String,
        /// Place of the first image.
        image: String,
    },
    /// The offset is not finite.
    #[error("the offset of the cameras' frame")]
    Offset(#[source] SimilarityError),
    /// The model's coordinates cannot be shifted.
    #[error(transparent)]
    Similarity(#[from] SimilarityError),
    /// The model's map is not known.
    #[error("{source}: satellite images need it")]
    MapUnknown {
        /// What the model states.
        source: PriorsError,
    },
    /// One satellite image cannot be served.
    #[error("in the image: {}", path.display())]
    SatelliteImage {
        /// The image.
        path: PathBuf,
        /// Why.
        source: Box<PriorsJobError>,
    },
    /// The depths do not fit 16-bit maps.
    #[error("the depths are too large for 16-bit maps")]
    DepthScale,
    /// A file of the unfinished dataset changed.
    #[error("another program wrote to the output folder: {}", path.display())]
    Disturbed {
        /// The file.
        path: PathBuf,
    },
    /// The output is a file.
    #[error("the output is a file, expected a folder: {}", path.display())]
    OutputIsFile {
        /// The file.
        path: PathBuf,
    },
    /// The priors cannot be computed.
    #[error(transparent)]
    Priors(#[from] PriorsError),
    /// The city model cannot be read.
    #[error(transparent)]
    City(#[from] CityError),
    /// The city model contradicts itself.
    #[error(transparent)]
    Model(#[from] ModelError),
    /// The pointing correction cannot be folded into the RPC.
    #[error(transparent)]
    Fold(#[from] FitError),
    /// A coordinate reference system cannot be used.
    #[error(transparent)]
    Crs(#[from] CrsError),
    /// A picture of the report cannot be made.
    #[error(transparent)]
    Picture(#[from] PictureError),
    /// A setting, a file or the threads cannot be used, or the job was cancelled.
    #[error(transparent)]
    Job(#[from] JobError),
}

failures!(PriorsJobError: Other {
    Self::Unlisted { .. } => Kind::File,
    Self::SatelliteImage { source, .. } => source.kind(),
    Self::City(error) => error.kind(),
    Self::Priors(error) | Self::MapUnknown { source: error } => error.kind(),
    Self::Crs(error) => error.kind(),
    Self::Job(error) => error.kind(),
});

job_errors!(PriorsJobError {
    Self::NothingInSight { .. } => Some("the frame of the cameras"),
    Self::NoPicture { .. } => Some("the pictures"),
    Self::NotSatellite => Some("the values for satellite images"),
    Self::NotPerspective => Some("the values for perspective cameras"),
    Self::MapUnknown { .. } => Some("the map of the model"),
    Self::NoObject { .. } => Some("the objects of the model"),
    Self::Offset(_) => Some("the offset of the frame"),
    Self::Lens { source: LensFault::Distorted { .. }, .. } => Some("the lens"),
    Self::Lens { source: LensFault::OffMiddle { .. }, .. } => Some("the principal point"),
});

from_steps!(PriorsJobError: Job(FileError, Cancelled, RasterError, RpcReadError, FormatError));

/// What a trainer cannot do with a lens.
#[derive(Debug, thiserror::Error)]
pub(crate) enum LensFault {
    /// The image is distorted.
    #[error(
        "its lens is {model}, and trainers take undistorted images only: undistort them (colmap image_undistorter) and \
         give the cameras that come with them, or ask for maps only"
    )]
    Distorted {
        /// Name of the lens model.
        model: &'static str,
    },
    /// The principal point is off the middle, which 2DGS ignores.
    #[error(
        "its principal point is {x:+.2}, {y:+.2} px from the middle of the image, and 2DGS takes the middle: crop the \
         camera, or choose a trainer that uses the principal point"
    )]
    OffMiddle {
        /// Offset along the columns, pixels.
        x: f64,
        /// Offset along the rows, pixels.
        y: f64,
    },
    /// Cropping would leave too little.
    #[error(
        "its principal point is {x:+.0}, {y:+.0} px from the middle: cropping would leave less than half of the image"
    )]
    TooFarOff {
        /// Offset along the columns, pixels.
        x: f64,
        /// Offset along the rows, pixels.
        y: f64,
    },
    /// The cropped lens is invalid.
    #[error(transparent)]
    Lens(#[from] LensError),
}
