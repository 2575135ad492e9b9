//! Reasons why ground views cannot be made.

use std::path::PathBuf;

use crs::CrsError;
use formats::FormatError;
use numeric::{Cancelled, Kind, failures};

use crate::camera_stand::StandError;
use crate::city_files::CitySurfaceError;
use job::error::{JobError, SettingError, from_steps, job_errors};
use job::files::FileError;

/// Ground views that cannot be made.
#[derive(Debug, thiserror::Error)]
pub(crate) enum GroundViewError {
    /// A camera cannot be used.
    #[error(transparent)]
    Stand(#[from] StandError),
    /// The folder holds the report of earlier views.
    #[error("the folder holds views already; choose another folder: {}", path.display())]
    FolderInUse {
        /// The folder.
        path: PathBuf,
    },
    /// The surface has no height.
    #[error("the surface has no height: {}", path.display())]
    NoHeights {
        /// The raster.
        path: PathBuf,
    },
    /// The surface has too few cells.
    #[error("the surface has less than 2 x 2 cells: {}", path.display())]
    TooSmall {
        /// The raster.
        path: PathBuf,
    },
    /// The city model cannot serve as surface.
    #[error(transparent)]
    City(#[from] CitySurfaceError),
    /// A city model names no coordinate reference system.
    #[error("the model names no coordinate system: {}", path.display())]
    NoCrs {
        /// The model.
        path: PathBuf,
    },
    /// A city model is not on a map in metres.
    #[error("the model is not on a map in metres: convert it first: {}", path.display())]
    NotInMetres {
        /// The model.
        path: PathBuf,
    },
    /// Coordinates or heights cannot be converted.
    #[error(transparent)]
    Crs(#[from] CrsError),
    /// The cameras of a COLMAP model cannot be used.
    #[error(transparent)]
    PlacedModel(JobError),
    /// Two images of a model would have the same file names.
    #[error("two images would be written as {stem}")]
    SameName {
        /// Name that both would get.
        stem: String,
    },
    /// The lens of the crops cannot be made.
    #[error(transparent)]
    Lens(#[from] camera::LensError),
    /// The heading of a camera is not finite.
    #[error("the heading is {heading_deg}, expected degrees")]
    Heading {
        /// The heading.
        heading_deg: f64,
    },
    /// The height of a camera is not finite.
    #[error("the camera's height is {height_m}, expected metres")]
    CameraHeight {
        /// The height above the origin.
        height_m: f64,
    },
    /// There is no surface under a camera.
    #[error("the surface has no height under the camera, and the camera has none of its own")]
    NoGround,
    /// A panorama has no picture.
    #[error("no picture {id}.png, .jpg or .tif: {}", folder.display())]
    NoPicture {
        /// Identifier of the panorama.
        id: String,
        /// Folder of the pictures.
        folder: PathBuf,
    },
    /// A picture cannot be read.
    #[error(transparent)]
    Raster(#[from] formats::raster::RasterError),
    /// The layers of a composition have different sizes.
    #[error(transparent)]
    Layers(#[from] groundview::SizeError),
    /// A setting, a file or the threads cannot be used, or the job was cancelled.
    #[error(transparent)]
    Job(#[from] JobError),
}

failures!(GroundViewError: Other {
    Self::FolderInUse { .. } => Kind::OutputExists,
    Self::Stand(error) => error.kind(),
    Self::City(error) => error.kind(),
    Self::Crs(error) => error.kind(),
    Self::PlacedModel(error) => error.kind(),
    Self::Raster(error) => error.kind(),
    Self::Job(error) => error.kind(),
});

job_errors!(GroundViewError {
    Self::NoGround => Some("the ground under the camera"),
    Self::City(CitySurfaceError::NoSurface { .. }) => Some("the city model"),
    Self::PlacedModel(_) => Some("the cameras"),
});

from_steps!(GroundViewError: Job(SettingError, FileError, Cancelled, FormatError));
