//! A file under its final name is complete.
//!
//! The file is made in a temporary folder beside its destination (GDAL puts side files next to what it writes, and
//! they vanish with the folder), then renamed. On any failure the destination is as it was before.

use std::path::Path;

use super::RasterError;

/// Makes a file by `make`, which is given the path to write to, and moves it to `path`.
///
/// # Errors
/// [`RasterError::Exists`] without `overwrite`, [`RasterError::Unwritable`], and what `make` reports.
pub(crate) fn write_whole(
    path: &Path,
    overwrite: bool,
    make: impl FnOnce(&Path) -> Result<(), RasterError>,
) -> Result<(), RasterError> {
    if !overwrite && path.symlink_metadata().is_ok() {
        return Err(RasterError::Exists { path: path.to_owned() });
    }
    if path.is_dir() {
        return Err(RasterError::unwritable(path, "a folder has this name"));
    }
    let name = path.file_name().ok_or_else(|| RasterError::unwritable(path, "the name has no last part"))?;
    let folder = path.parent().filter(|p| !p.as_os_str().is_empty()).unwrap_or(Path::new("."));
    let scratch = tempfile::Builder::new()
        .prefix(".skysweep-")
        .tempdir_in(folder)
        .map_err(|error| RasterError::unwritable(path, plain(&error)))?;
    let made = scratch.path().join(name);
    make(&made)?;
    std::fs::rename(&made, path).map_err(|error| RasterError::unwritable(path, plain(&error)))
}

/// Writes a file whole.
///
/// # Errors
/// [`RasterError::Exists`] without `overwrite`, [`RasterError::Unwritable`].
pub fn write_bytes(path: impl AsRef<Path>, bytes: &[u8], overwrite: bool) -> Result<(), RasterError> {
    let path = path.as_ref();
    write_whole(path, overwrite, |made| {
        std::fs::write(made, bytes).map_err(|error| RasterError::unwritable(path, plain(&error)))
    })
}

/// The system's answer without the temporary name that `tempfile` adds.
fn plain(error: &std::io::Error) -> String {
    error.kind().to_string()
}
