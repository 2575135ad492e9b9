//! Reasons why a building index cannot be made.

use std::path::PathBuf;

use buildings::BuildingIndexError;
use camera::CameraError;
use crs::CrsError;
use formats::raster::RasterError;
use formats::rpc::RpcReadError;
use numeric::{Cancelled, failures};

use crate::ortho::OrthoError;
use job::error::{JobError, SettingError, from_steps, job_errors};
use job::files::FileError;

/// A building index that cannot be made.
#[derive(Debug, thiserror::Error)]
pub(crate) enum BuildingMapError {
    /// The image is too large to be looked at at once.
    #[error("the image has {width} x {height} pixels, at most 2^28: cut it into parts: {}", path.display())]
    TooLarge {
        /// The image.
        path: PathBuf,
        /// Columns.
        width: usize,
        /// Rows.
        height: usize,
    },
    /// Nothing says how large the pixels are.
    #[error("the image has neither an RPC nor a projected map that tells the size of its pixels: {}", path.display())]
    NoScale {
        /// The image.
        path: PathBuf,
    },
    /// The RPC does not tell the size of the pixels.
    #[error("the RPC does not tell the size of the pixels: {}", path.display())]
    Scale {
        /// The image.
        path: PathBuf,
        /// What is wrong with the RPC.
        source: CameraError,
    },
    /// The coordinate reference system of the image cannot be used.
    #[error(transparent)]
    Crs(#[from] CrsError),
    /// The index was given a value that it cannot use.
    #[error(transparent)]
    Index(#[from] BuildingIndexError),
    /// The index cannot be laid on the surface model.
    #[error(transparent)]
    Surface(Box<OrthoError>),
    /// A setting, a file or the threads cannot be used, or the job was cancelled.
    #[error(transparent)]
    Job(#[from] JobError),
}

failures!(BuildingMapError: Other {
    Self::Crs(error) => error.kind(),
    Self::Surface(error) => error.kind(),
    Self::Job(error) => error.kind(),
});

job_errors!(BuildingMapError {
    Self::NoScale { .. } => Some("the scale of the image"),
    Self::Surface(error) => error.setting(),
});

from_steps!(
    BuildingMapError: Job(SettingError, FileError, Cancelled, RasterError, RpcReadError),
);

impl From<OrthoError> for BuildingMapError {
    fn from(error: OrthoError) -> Self {
        match error {
            OrthoError::Job(job) => Self::Job(job),
            other => Self::Surface(other.into()),
        }
    }
}
