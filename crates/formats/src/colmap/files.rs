//! Finds a file of a model, text or binary, and parses it.

use std::path::{Path, PathBuf};

use crate::camera_file::{Fault, read_bytes};
use crate::format_error::FormatError;

/// Largest file that is read, bytes. `images` is the largest one, because it lists every
/// observation.
const SIZE_LIMIT: u64 = 4 << 30;

/// Reads `name.bin`, or else `name.txt`, and returns its path and its records.
pub(super) fn load<T>(
    folder: &Path,
    name: &'static str,
    from_binary: impl Fn(&[u8]) -> Result<Vec<T>, Fault>,
    from_text: impl Fn(&str) -> Result<Vec<T>, Fault>,
) -> Result<(PathBuf, Vec<T>), FormatError> {
    let [binary, text] = ["bin", "txt"].map(|extension| folder.join(format!("{name}.{extension}")));
    let path = [&binary, &text].into_iter().find(|path| path.is_file());
    let missing = || {
        let what = format!("the folder holds neither {name}.bin nor {name}.txt");
        FormatError::new(folder, what + ", choose the folder that holds the COLMAP model")
    };
    let path = path.ok_or_else(missing)?.clone();
    let bytes = read_bytes(&path, SIZE_LIMIT)?;
    let parsed = if path == binary { from_binary(&bytes) } else { from_text(&String::from_utf8_lossy(&bytes)) };
    match parsed {
        Ok(parsed) => Ok((path, parsed)),
        Err(fault) => Err(fault.at(&path)),
    }
}
