//! A file of the web, copied to the disk.

use std::io::Write;
use std::path::Path;

use crate::atomic::{SaveError, require_space, write_stream};
use crate::raster::WebFile;

/// Bytes that are asked for at a time.
const PART: usize = 1 << 20;

/// Copies the file at an address (`https://…`) to `path`, which exists only when it is complete.
/// Returns its size, bytes. The folder must exist.
///
/// # Errors
/// What the server or the disk answered, in words.
pub fn download(address: &str, path: &Path) -> Result<u64, String> {
    let at_server = |reason: String| format!("{reason}: {address}");
    let mut file = WebFile::open(address).map_err(at_server)?;
    if let Some(folder) = path.parent() {
        require_space(folder, file.size()).map_err(|error| error.to_string())?;
    }
    let mut broken = None;
    let written = write_stream(path, false, |out| copy(&mut file, out, &mut broken));
    match (broken, written) {
        (Some(reason), _) => Err(at_server(reason)),
        // Another process has fetched it meanwhile.
        (None, Ok(()) | Err(SaveError::Exists { .. })) => Ok(file.size()),
        (None, Err(error)) => Err(error.to_string()),
    }
}

/// Copies all parts; what the server failed with goes to `broken`.
fn copy(file: &mut WebFile, out: &mut dyn Write, broken: &mut Option<String>) -> std::io::Result<()> {
    let mut part = vec![0; PART];
    while file.position() < file.size() {
        let read = file.read(&mut part).map_err(|reason| {
            *broken = Some(reason);
            std::io::Error::other("the server")
        })?;
        out.write_all(&part[..read])?;
    }
    Ok(())
}
