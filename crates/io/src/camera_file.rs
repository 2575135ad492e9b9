//! What the readers of camera files (COLMAP and `transforms.json`) share: the limit of the size,
//! and the errors of a file.

use std::path::{Path, PathBuf};

use numeric::failures;

use crate::regular::read_regular;

/// Why a file of cameras was not read.
#[derive(Debug, thiserror::Error)]
#[non_exhaustive]
pub enum CameraFileError {
    /// The system cannot read the file.
    #[error("cannot read the file ({source}): {}", .path.display())]
    Unreadable {
        /// Path of the file.
        path: PathBuf,
        /// Error of the system.
        source: std::io::Error,
    },
    /// The file is too large or breaks the rules of its format.
    #[error("{what} ({place}): {}", .path.display())]
    Invalid {
        /// Path of the file.
        path: PathBuf,
        /// What was found, and what was expected.
        what: String,
        /// Place: a line number, a byte offset, a frame counted from 0, or a part of the file.
        place: String,
    },
}

failures!(CameraFileError: File);

/// A mistake in a file and its place, before the path of the file is known.
#[derive(Debug)]
pub(crate) struct Fault {
    pub(crate) what: String,
    pub(crate) place: String,
}

impl Fault {
    /// Adds the path of the file.
    pub(crate) fn at(self, path: &Path) -> CameraFileError {
        CameraFileError::Invalid { path: path.to_owned(), what: self.what, place: self.place }
    }
}

/// Reads a file of at most `limit` bytes.
///
/// # Errors
/// [`CameraFileError::Unreadable`]; [`CameraFileError::Invalid`] when the file is larger.
pub(crate) fn read_bytes(path: &Path, limit: u64) -> Result<Vec<u8>, CameraFileError> {
    let unreadable = |source| CameraFileError::Unreadable { path: path.to_owned(), source };
    let size = std::fs::metadata(path).map_err(unreadable)?.len();
    if size > limit {
        let what = format!("the file has {size} bytes, at most {limit} are read");
        return Err(Fault { what, place: "size".to_owned() }.at(path));
    }
    read_regular(path, limit).map_err(unreadable)
}
