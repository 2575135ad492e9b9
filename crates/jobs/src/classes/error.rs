//! Reasons why a class raster cannot be made.

use std::path::PathBuf;

use classes::ClassifyError;
use numeric::Cancelled;
use terrain::TerrainError;

use crate::dtm::DtmError;
use crate::error::{JobError, from_steps};
use crate::eval::EvalJobError;
use crate::files::FileError;
use crate::threads::ThreadsError;

/// A class raster that cannot be made.
#[derive(Debug, thiserror::Error)]
#[non_exhaustive]
pub enum ClassesError {
    /// The surface model cannot be used.
    #[error(transparent)]
    Surface(#[from] DtmError),
    /// The vegetation index cannot be read at the cells of the surface.
    #[error("cannot use the vegetation index")]
    Index(#[source] Box<EvalJobError>),
    /// The building index cannot be read at the cells of the surface.
    #[error("cannot use the building index")]
    Cue(#[source] Box<EvalJobError>),
    /// The building index holds a value that is none.
    #[error("the building index holds {found}, expected 0 to 1: {}", path.display())]
    CueRange {
        /// The raster.
        path: PathBuf,
        /// A value that it holds.
        found: f32,
    },
    /// The search for the ground was given a value that it cannot use.
    #[error(transparent)]
    Terrain(TerrainError),
    /// The search for classes was given a value that it cannot use.
    #[error(transparent)]
    Classify(#[from] ClassifyError),
    /// A setting, a file or the threads cannot be used, or the job was cancelled.
    #[error(transparent)]
    Job(#[from] JobError),
}

from_steps!(ClassesError: Index(EvalJobError), Job(FileError, ThreadsError, Cancelled));

impl From<TerrainError> for ClassesError {
    fn from(error: TerrainError) -> Self {
        match error {
            TerrainError::Cancelled(cancelled) => cancelled.into(),
            other => Self::Terrain(other),
        }
    }
}
