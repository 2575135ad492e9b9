//! The reasons that can end every job, and how the error of a job takes in the errors of its steps.

use std::path::{Path, PathBuf};

use crs::{CrsError, MapProjection};
use io::raster::RasterError;
use io::rpc::RpcReadError;
use numeric::{Cancelled, failures};

use crate::corrections::CorrectionsError;
use crate::files::FileError;
use crate::threads::ThreadsError;

/// Implements `From` of the errors of steps for the error of a job. The variant that holds them
/// takes them through their own `From`: into [`JobError`], or into a box because they are several
/// times larger than the other variants.
#[macro_export]
macro_rules! from_steps {
    ($error:ident: $($variant:ident($($step:ty),+)),+ $(,)?) => {$($(
        impl From<$step> for $error {
            fn from(error: $step) -> Self {
                Self::$variant(error.into())
            }
        }
    )+)+};
}

pub use crate::from_steps;

/// A reason that can end any job.
#[derive(Debug, thiserror::Error)]
#[non_exhaustive]
pub enum JobError {
    /// A setting is outside of its range.
    #[error(transparent)]
    Setting(#[from] SettingError),
    /// A file cannot be read, or an output exists or cannot be written.
    #[error(transparent)]
    File(#[from] FileError),
    /// The worker threads cannot be started.
    #[error(transparent)]
    Threads(#[from] ThreadsError),
    /// The job was cancelled.
    #[error(transparent)]
    Cancelled(#[from] Cancelled),
}

failures!(JobError: Other {
    Self::Setting(error) => error.kind(),
    Self::File(error) => error.kind(),
    Self::Threads(error) => error.kind(),
    Self::Cancelled(error) => error.kind(),
});

/// A setting outside of its range.
#[derive(Debug, thiserror::Error)]
#[error("{name} is {found}, expected {expected}")]
#[non_exhaustive]
pub struct SettingError {
    /// Name of the setting in words.
    pub name: &'static str,
    /// Value that was given.
    pub found: String,
    /// Values that are accepted.
    pub expected: String,
}

failures!(SettingError: Input);

impl SettingError {
    /// Makes the error of a setting with the value `found`.
    pub fn new(name: &'static str, found: impl ToString, expected: impl Into<String>) -> Self {
        Self { name, found: found.to_string(), expected: expected.into() }
    }
}

/// A satellite image that cannot be read with its camera.
#[derive(Debug, thiserror::Error)]
#[non_exhaustive]
pub enum ImageInputError {
    /// The image cannot be read.
    #[error(transparent)]
    Raster(#[from] RasterError),
    /// The image has no usable RPC.
    #[error(transparent)]
    Rpc(Box<RpcReadError>),
    /// The pointing corrections cannot be read.
    #[error(transparent)]
    Corrections(#[from] CorrectionsError),
}

failures!(ImageInputError: File {
    Self::Raster(error) => error.kind(),
    Self::Rpc(error) => error.kind(),
    Self::Corrections(error) => error.kind(),
});

from_steps!(ImageInputError: Rpc(RpcReadError));

/// The coordinate reference system of a file cannot be used.
#[derive(Debug, thiserror::Error)]
#[error("cannot use the coordinate reference system of the file: {}", path.display())]
#[non_exhaustive]
pub struct FileCrsError {
    /// The file.
    pub path: PathBuf,
    /// What is wrong with the coordinate reference system.
    pub source: CrsError,
}

failures!(FileCrsError: Crs { Self { source, .. } => source.kind() });

impl FileCrsError {
    /// Reads a definition that the file at `path` states.
    pub fn projection(path: &Path, definition: &str) -> Result<MapProjection, Self> {
        MapProjection::from_definition(definition).map_err(|source| Self { path: path.to_owned(), source })
    }
}
