//! Why a city model job ends without a result.

use std::path::PathBuf;

use city::ModelError;
use cityfiles::CityError;
use numeric::{Cancelled, failures};

use job::error::{JobError, from_steps, job_errors};
use job::files::FileError;

/// A city model job that could not be done.
#[derive(Debug, thiserror::Error)]
pub(crate) enum CityJobError {
    /// The model cannot be read, or the output cannot be written.
    #[error(transparent)]
    Read(CityError),
    /// The model contradicts itself.
    #[error(transparent)]
    Model(#[from] ModelError),
    /// The ending of the output file belongs to no format.
    #[error(
        "no city model format belongs to the ending of {}: expected .obj, .ply, .glb, .geojson or .json, or a stated format",
        path.display()
    )]
    UnknownEnding {
        /// The output file.
        path: PathBuf,
    },
    /// No object has surfaces at the level of detail that was asked for.
    #[error(
        "no surface is selected of {objects} objects ({reasons}); the levels of detail in the file are {levels}: {}",
        path.display()
    )]
    NothingSelected {
        /// The model.
        path: PathBuf,
        /// Number of objects in the file.
        objects: usize,
        /// Number of objects per status.
        reasons: String,
        /// Levels of detail in the file, most detailed last.
        levels: String,
    },
    /// A setting, a file or the threads cannot be used, or the job was cancelled.
    #[error(transparent)]
    Job(#[from] JobError),
}

failures!(CityJobError: Other {
    Self::Read(error) => error.kind(),
    Self::Job(error) => error.kind(),
});

job_errors!(CityJobError {
    Self::UnknownEnding { .. } => Some("the format"),
    Self::NothingSelected { .. } => Some("the level of detail"),
});

from_steps!(CityJobError: Job(FileError, Cancelled));

impl From<CityError> for CityJobError {
    fn from(error: CityError) -> Self {
        match error {
            CityError::NotWritten(error) => FileError::from(error).into(),
            other => Self::Read(other),
        }
    }
}
