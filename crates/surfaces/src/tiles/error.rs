//! Reasons why tiles cannot be made.

use std::path::PathBuf;

use formats::FormatError;
use formats::raster::RasterError;
use formats::rpc::RpcReadError;
use numeric::{Cancelled, Kind, failures};

use crate::camera_stand::StandError;
use crate::heightmap::HeightMapJobError;
use crate::ortho::OrthoError;
use job::error::{JobError, from_steps, job_errors};
use job::files::FileError;

/// Tiles that cannot be made.
#[derive(Debug, thiserror::Error)]
pub(crate) enum TilesError {
    /// A height map cannot be made.
    #[error(transparent)]
    Map(#[from] HeightMapJobError),
    /// An ortho cannot be made.
    #[error(transparent)]
    Ortho(#[from] OrthoError),
    /// No image is given, and the surface model does not lie in the folder of a run.
    #[error("no images: the surface model does not lie in a run that names its images: {}", source_path.display())]
    NoImages {
        /// The source of the heights.
        source_path: PathBuf,
    },
    /// No image reaches a tile.
    #[error("none of the {images} images reaches the tile")]
    OutsideImages {
        /// How many images there are.
        images: usize,
    },
    /// Another folder has the name of a tile.
    #[error(
        "a folder is in the way that is not the tile asked for (other settings, images or source); choose another folder: {}",
        path.display()
    )]
    OtherTile {
        /// The folder.
        path: PathBuf,
    },
    /// A setting, a file or the threads cannot be used, or the job was cancelled.
    #[error(transparent)]
    Job(#[from] JobError),
}

failures!(TilesError: Other {
    Self::OtherTile { .. } => Kind::OutputExists,
    Self::Map(error) => error.kind(),
    Self::Ortho(error) => error.kind(),
    Self::Job(error) => error.kind(),
});

job_errors!(TilesError {
    Self::Map(error) => error.setting(),
    Self::Ortho(error) => error.setting(),
    Self::NoImages { .. } => Some("the images"),
});

from_steps!(TilesError: Job(FileError, Cancelled, RasterError, RpcReadError, FormatError), Map(StandError));
