//! What the readers of camera files (COLMAP and `transforms.json`) share: the limit of the size,
//! and the mistakes of a file.

use std::path::Path;

use crate::format_error::FormatError;
use crate::regular::read_regular;

/// A mistake in a file and its place, before the path of the file is known.
#[derive(Debug)]
pub(crate) struct Fault {
    pub(crate) what: String,
    pub(crate) place: String,
}

impl Fault {
    /// Adds the path of the file.
    pub(crate) fn at(self, path: &Path) -> FormatError {
        FormatError::new(path, format_args!("{} ({})", self.what, self.place))
    }
}

/// Reads a file of at most `limit` bytes.
///
/// # Errors
/// [`FormatError`] when the system refuses, and when the file is larger.
pub(crate) fn read_bytes(path: &Path, limit: u64) -> Result<Vec<u8>, FormatError> {
    let unreadable = |source| FormatError::unreadable(path, "the file", source);
    let size = std::fs::metadata(path).map_err(unreadable)?.len();
    if size > limit {
        let what = format!("the file has {size} bytes, at most {limit} are read");
        return Err(Fault { what, place: "size".to_owned() }.at(path));
    }
    read_regular(path, limit).map_err(unreadable)
}
