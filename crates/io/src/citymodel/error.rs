//! Why a city model was not read or written: each refusal has a number of the catalogue and a place.

use std::path::{Path, PathBuf};

use city::DefectCode;

use crate::atomic::SaveError;

/// A file that is no city model, or one that breaks the rules of its format.
#[derive(Debug, thiserror::Error)]
#[non_exhaustive]
pub enum CityError {
    /// The file cannot be opened or read.
    #[error("cannot read the file ({source}): check the name and the permissions: {}", .path.display())]
    Unreadable {
        /// The file.
        path: PathBuf,
        /// The system's answer.
        source: std::io::Error,
    },
    /// Larger than is read into memory.
    #[error("the file has {bytes} bytes, city models are read up to {limit}: cut it into tiles: {}", .path.display())]
    TooLarge {
        /// The file.
        path: PathBuf,
        /// Its size.
        bytes: u64,
        /// The limit.
        limit: u64,
    },
    /// The content is refused.
    #[error("{fault}: {}", .path.display())]
    Refused {
        /// The file.
        path: PathBuf,
        /// What is wrong and where.
        fault: CityFault,
    },
    /// The file was not written.
    #[error(transparent)]
    NotWritten(#[from] SaveError),
}

/// What is wrong with the content of a file, with the number in the catalogue and the place.
#[derive(Debug, Clone, PartialEq, Eq, thiserror::Error)]
#[error("error {}: {what} ({place})", .code.number())]
pub struct CityFault {
    /// Number in the catalogue of defects.
    pub code: DefectCode,
    /// What was found and expected.
    pub what: String,
    /// `line 7, column 12`, or the way to the element.
    pub place: String,
}

impl CityFault {
    pub(super) fn new(code: DefectCode, what: impl Into<String>, place: impl Into<String>) -> Self {
        Self { code, what: what.into(), place: place.into() }
    }

    /// A fault of the format's rules (901).
    pub(super) fn invalid(what: impl Into<String>, place: impl Into<String>) -> Self {
        Self::new(DefectCode::InvalidFile, what, place)
    }

    /// Something that is not read here (904).
    pub(super) fn unsupported(what: impl Into<String>, place: impl Into<String>) -> Self {
        Self::new(DefectCode::NotSupported, what, place)
    }

    pub(crate) fn at(self, path: &Path) -> CityError {
        CityError::Refused { path: path.to_owned(), fault: self }
    }
}
