//! What can go wrong with a raster file.

use std::path::{Path, PathBuf};

use crate::atomic::SaveError;

/// A raster file that cannot be read or written. Paths come last in the text; GDAL's own words are in `reason`.
#[derive(Debug, thiserror::Error)]
#[non_exhaustive]
pub enum RasterError {
    /// The file is not there or may not be read.
    #[error("cannot read the file ({source}): check the name and the permissions: {}", path.display())]
    Unreadable {
        /// The file.
        path: PathBuf,
        /// The system's answer.
        source: std::io::Error,
    },
    /// The name points to a network or to a service.
    #[error("the name points to a network or a service, and only local files are read: fetch it first: {}", path.display())]
    NotLocal {
        /// The name as given.
        path: PathBuf,
    },
    /// GDAL cannot open the file as a raster.
    #[error("not a raster that GDAL can open ({reason}): {}", path.display())]
    NotARaster {
        /// The file.
        path: PathBuf,
        /// GDAL's words.
        reason: String,
    },
    /// GDAL opened the file and failed to read its content.
    #[error("the raster is damaged or truncated ({reason}): {}", path.display())]
    Damaged {
        /// The file.
        path: PathBuf,
        /// GDAL's words.
        reason: String,
    },
    /// The raster is of a kind that is not read here.
    #[error("{found}, expected {expected}: {}", path.display())]
    Unsupported {
        /// The file.
        path: PathBuf,
        /// What was found.
        found: String,
        /// What can be read.
        expected: &'static str,
    },
    /// The file was not written: it exists, or the system or GDAL refused.
    #[error(transparent)]
    NotWritten(#[from] SaveError),
    /// The data handed over cannot make a raster.
    #[error("the bands do not make one raster ({reason}): {}", path.display())]
    InconsistentBands {
        /// The file that was to be written.
        path: PathBuf,
        /// What does not fit.
        reason: String,
    },
    /// The coordinate reference system cannot be written or read.
    #[error("coordinate reference system ({source}): {}", path.display())]
    Crs {
        /// The file.
        path: PathBuf,
        /// What geodesy says.
        source: crs::CrsError,
    },
}

impl RasterError {
    pub(crate) fn unwritable(path: &Path, reason: impl ToString) -> Self {
        Self::NotWritten(SaveError::unwritable(path, reason))
    }

    pub(crate) fn damaged(path: &Path, reason: impl ToString) -> Self {
        Self::Damaged { path: path.to_owned(), reason: reason.to_string() }
    }
}
