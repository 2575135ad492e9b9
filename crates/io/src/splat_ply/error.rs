//! Why a file of splats was not read or written.

use std::path::{Path, PathBuf};

use gaussian::SplatDefect;
use numeric::failures;

use crate::atomic::SaveError;

/// Why a file of splats was not read or written.
#[derive(Debug, thiserror::Error)]
#[non_exhaustive]
pub enum SplatPlyError {
    /// The system cannot read the file.
    #[error("cannot read the file ({source}): {}", .path.display())]
    Unreadable {
        /// Path of the file.
        path: PathBuf,
        /// Error of the system.
        source: std::io::Error,
    },
    /// The file breaks its format, or is not a file of splats.
    #[error("{what}: {}", .path.display())]
    Invalid {
        /// Path of the file.
        path: PathBuf,
        /// What was found, and what was expected.
        what: String,
    },
    /// A splat that was to be written is not a valid Gaussian.
    #[error("splat {index} cannot be written ({source}): {}", .path.display())]
    Splat {
        /// Path of the file.
        path: PathBuf,
        /// Index of the splat.
        index: usize,
        /// Its defect.
        source: SplatDefect,
    },
    /// The file exists or cannot be written.
    #[error(transparent)]
    NotWritten(#[from] SaveError),
}

failures!(SplatPlyError: File { Self::NotWritten(error) => error.kind() });

pub(crate) fn invalid(path: &Path, what: impl Into<String>) -> SplatPlyError {
    SplatPlyError::Invalid { path: path.to_owned(), what: what.into() }
}
