//! Why a city model job ends without a result.

use std::path::PathBuf;

use city::ModelError;
use io::citymodel::CityError;

use crate::files::FileError;

/// A city model job that could not be done.
#[derive(Debug, thiserror::Error)]
#[non_exhaustive]
pub enum CityJobError {
    /// The model cannot be read, or the output cannot be written.
    #[error(transparent)]
    Read(CityError),
    /// The model contradicts itself.
    #[error(transparent)]
    Model(#[from] ModelError),
    /// The output exists, or the account cannot be written.
    #[error(transparent)]
    File(#[from] FileError),
    /// The ending of the output file belongs to no format.
    #[error(
        "no city model format belongs to the ending of {}: expected .obj, .ply, .glb, .geojson or .json, or a stated format",
        path.display()
    )]
    UnknownEnding {
        /// The output file.
        path: PathBuf,
    },
    /// The job was cancelled.
    #[error(transparent)]
    Cancelled(#[from] numeric::Cancelled),
}

impl From<CityError> for CityJobError {
    fn from(error: CityError) -> Self {
        match error {
            CityError::NotWritten(error) => Self::File(error.into()),
            other => Self::Read(other),
        }
    }
}
