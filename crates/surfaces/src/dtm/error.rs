//! Reasons why a terrain model cannot be made.

use std::path::PathBuf;

use crs::CrsError;
use formats::raster::RasterError;
use numeric::{Cancelled, failures};
use terrain::TerrainError;

use job::error::{JobError, from_steps, job_errors};
use job::files::FileError;

/// A terrain model that cannot be made.
#[derive(Debug, thiserror::Error)]
pub(crate) enum DtmError {
    /// The surface model cannot be read.
    #[error(transparent)]
    Surface(#[from] RasterError),
    /// The surface model's coordinate reference system has no EPSG code.
    #[error("the surface model's coordinate system has no EPSG code: {}", path.display())]
    NoEpsg {
        /// The surface model.
        path: PathBuf,
    },
    /// The cells of the surface model are not square.
    #[error("the cells measure {width_m} m by {height_m} m, expected square cells: warp it first: {}", path.display())]
    NotSquare {
        /// The surface model.
        path: PathBuf,
        /// Width of a cell, metres.
        width_m: f64,
        /// Height of a cell, metres.
        height_m: f64,
    },
    /// The surface model is empty.
    #[error("the surface model has no heights: {}", path.display())]
    NoHeights {
        /// The surface model.
        path: PathBuf,
    },
    /// The coordinate reference system cannot be used.
    #[error(transparent)]
    Crs(#[from] CrsError),
    /// The search for the ground was given a value that it cannot use.
    #[error(transparent)]
    Terrain(TerrainError),
    /// A setting, a file or the threads cannot be used, or the job was cancelled.
    #[error(transparent)]
    Job(#[from] JobError),
}

failures!(DtmError: Other {
    Self::Surface(error) => error.kind(),
    Self::Crs(error) => error.kind(),
    Self::Job(error) => error.kind(),
});

job_errors!(DtmError);

from_steps!(DtmError: Job(FileError, Cancelled));

impl From<TerrainError> for DtmError {
    fn from(error: TerrainError) -> Self {
        match error {
            TerrainError::Cancelled(cancelled) => cancelled.into(),
            other => Self::Terrain(other),
        }
    }
}
