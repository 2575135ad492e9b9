//! Why a city model was not read or written. Each fault of a file has a number of the catalogue and
//! a place.

use std::path::{Path, PathBuf};

use city::DefectCode;
use numeric::failures;

use formats::FormatError;
use formats::atomic::SaveError;

/// Why a city model was not read or written.
#[derive(Debug, thiserror::Error)]
#[non_exhaustive]
pub enum CityError {
    /// The system cannot read the file.
    #[error("cannot read the file ({source}), check its name and permissions: {}", .path.display())]
    Unreadable {
        /// Path of the file.
        path: PathBuf,
        /// Error of the system.
        source: std::io::Error,
    },
    /// The file is larger than the limit.
    #[error("the file has {bytes} bytes, at most {limit} are read, cut it into tiles: {}", .path.display())]
    TooLarge {
        /// Path of the file.
        path: PathBuf,
        /// Size of the file, bytes.
        bytes: u64,
        /// Largest size that is read, bytes.
        limit: u64,
    },
    /// The content of the file is invalid or not supported.
    #[error("{fault}: {}", .path.display())]
    Refused {
        /// Path of the file.
        path: PathBuf,
        /// The fault and its place.
        fault: CityFault,
    },
    /// The file exists or cannot be written.
    #[error(transparent)]
    NotWritten(#[from] SaveError),
}

failures!(CityError: File { Self::NotWritten(error) => error.kind() });

impl From<CityError> for FormatError {
    fn from(error: CityError) -> Self {
        let path = match &error {
            CityError::Unreadable { path, .. } | CityError::TooLarge { path, .. } | CityError::Refused { path, .. } => {
                path.clone()
            }
            CityError::NotWritten(error) => error.path().to_owned(),
        };
        Self::of(&path, error)
    }
}

/// A fault of the content of a file, with its number in the catalogue and its place.
#[derive(Debug, Clone, PartialEq, Eq, thiserror::Error)]
#[error("error {}: {what} ({place})", .code.number())]
pub struct CityFault {
    /// Kind of the fault in the catalogue of defects.
    pub code: DefectCode,
    /// What was found, and what was expected.
    pub what: String,
    /// Place in the file, such as `line 7, column 12`, or the name of an element.
    pub place: String,
}

impl CityFault {
    pub(super) fn new(code: DefectCode, what: impl Into<String>, place: impl Into<String>) -> Self {
        Self { code, what: what.into(), place: place.into() }
    }

    /// Creates a fault for a file that breaks the rules of its format (901).
    pub(super) fn invalid(what: impl Into<String>, place: impl Into<String>) -> Self {
        Self::new(DefectCode::InvalidFile, what, place)
    }

    /// Creates a fault for a file or element that is not supported (904).
    pub(super) fn unsupported(what: impl Into<String>, place: impl Into<String>) -> Self {
        Self::new(DefectCode::NotSupported, what, place)
    }

    /// Creates a fault of the format in a line.
    pub(super) fn in_line(what: impl Into<String>, line: usize) -> Self {
        Self::invalid(what, format!("line {line}"))
    }

    /// Adds the path of the file.
    pub(crate) fn at(self, path: &Path) -> CityError {
        CityError::Refused { path: path.to_owned(), fault: self }
    }
}
