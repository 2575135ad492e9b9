//! Why a COLMAP model was not read or written.

use std::path::{Path, PathBuf};

use crate::atomic::SaveError;

/// Why a COLMAP model was not read or written.
#[derive(Debug, thiserror::Error)]
#[non_exhaustive]
pub enum ColmapError {
    /// One of the files of the model is missing.
    #[error(
        "the folder holds neither {name}.bin nor {name}.txt, choose the folder that holds the COLMAP model: {}",
        .folder.display()
    )]
    Missing {
        /// Folder that was searched.
        folder: PathBuf,
        /// Name of the missing file, without its extension.
        name: &'static str,
    },
    /// The system cannot read a file.
    #[error("cannot read the file ({source}): {}", .path.display())]
    Unreadable {
        /// Path of the file.
        path: PathBuf,
        /// Error of the system.
        source: std::io::Error,
    },
    /// A file breaks the rules of its format.
    #[error("{what} ({place}): {}", .path.display())]
    Invalid {
        /// Path of the file.
        path: PathBuf,
        /// What was found, and what was expected.
        what: String,
        /// Line number, or byte offset.
        place: String,
    },
    /// The model cannot be expressed in COLMAP's files.
    #[error("the model cannot be written ({what}): {}", .folder.display())]
    Inconsistent {
        /// Folder that was to be written.
        folder: PathBuf,
        /// What does not fit.
        what: String,
    },
    /// A file exists or cannot be written.
    #[error(transparent)]
    NotWritten(#[from] SaveError),
}

/// A mistake in a file and its place, before the path of the file is known.
#[derive(Debug)]
pub(super) struct Fault {
    pub(super) what: String,
    pub(super) place: String,
}

impl Fault {
    /// Adds the path of the file.
    pub(super) fn at(self, path: &Path) -> ColmapError {
        ColmapError::Invalid { path: path.to_owned(), what: self.what, place: self.place }
    }
}
