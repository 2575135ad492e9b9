//! The one atomic writer: a file under its final name is complete.
//!
//! A file is made under a temporary name in the folder of its destination and then renamed. On any
//! failure, and when the process is killed, the destination is as it was before. The new file has
//! the usual permissions (0666 less the umask), not the private ones of temporary files.
//!
//! [`write_stream`] suits formats that are written from front to back. It never replaces a file
//! that appears meanwhile, unless overwriting is allowed. [`write_path`] suits libraries that want
//! a path (GDAL, LAS): it gives them a temporary folder, so that side files vanish with the folder.
//! [`write_bytes`] takes content that is already in memory.

use std::io::{BufWriter, ErrorKind, Write};
use std::path::{Path, PathBuf};

use tempfile::Builder;

/// The first words of [`SaveError::Exists`], by which a caller can recognise it inside other
/// errors.
pub const OUTPUT_EXISTS: &str = "the output exists already";

/// A file that was not written.
#[derive(Debug, thiserror::Error)]
#[non_exhaustive]
pub enum SaveError {
    /// The output exists, and overwriting was not allowed.
    #[error("{OUTPUT_EXISTS}: choose another name or allow overwriting: {}", .path.display())]
    Exists {
        /// The output.
        path: PathBuf,
    },
    /// The output cannot be written.
    #[error("cannot write the file ({reason}): {}", .path.display())]
    Unwritable {
        /// The output.
        path: PathBuf,
        /// The message of the system or of the library that writes the format.
        reason: String,
    },
}

impl SaveError {
    pub(crate) fn unwritable(path: &Path, reason: impl ToString) -> Self {
        Self::Unwritable { path: path.to_owned(), reason: reason.to_string() }
    }

    /// Wraps an error of the system without the temporary name that `tempfile` adds to its text.
    fn system(path: &Path, error: &std::io::Error) -> Self {
        Self::unwritable(path, error.kind())
    }
}

/// Whether a stream is flushed to the disk before it gets its final name.
#[derive(Clone, Copy, PartialEq)]
enum Durability {
    /// The system may write the content later, which suits results that can be computed again.
    Cached,
    /// The content is on the disk before the rename.
    Synced,
}

/// Checks that a file may be written to `path`: it does not exist, or `overwrite` allows to replace
/// it.
///
/// # Errors
/// [`SaveError::Exists`], also for a dangling link.
pub fn refuse_existing(path: &Path, overwrite: bool) -> Result<(), SaveError> {
    if !overwrite && path.symlink_metadata().is_ok() {
        return Err(SaveError::Exists { path: path.to_owned() });
    }
    Ok(())
}

/// Writes `bytes` to `path`.
///
/// ```
/// # let folder = tempfile::tempdir()?;
/// let path = folder.path().join("report.json");
/// io::write_bytes(&path, b"{}\n", false)?;
/// assert!(matches!(io::write_bytes(&path, b"", false), Err(io::SaveError::Exists { .. })));
/// assert_eq!(std::fs::read(&path)?, b"{}\n");
/// # Ok::<(), Box<dyn std::error::Error>>(())
/// ```
///
/// # Errors
/// [`SaveError::Exists`] without `overwrite`; [`SaveError::Unwritable`].
pub fn write_bytes(path: impl AsRef<Path>, bytes: &[u8], overwrite: bool) -> Result<(), SaveError> {
    stream(path.as_ref(), overwrite, Durability::Cached, |out| out.write_all(bytes))
}

/// Writes `bytes` to `path`, and to the disk before the file gets its name.
pub(crate) fn write_bytes_synced(path: &Path, bytes: &[u8], overwrite: bool) -> Result<(), SaveError> {
    stream(path, overwrite, Durability::Synced, |out| out.write_all(bytes))
}

/// Writes what `make` puts into the stream to `path`. The stream is buffered.
///
/// # Errors
/// [`SaveError::Exists`] without `overwrite`; [`SaveError::Unwritable`], also for an error of
/// `make`.
pub fn write_stream(
    path: &Path,
    overwrite: bool,
    make: impl FnOnce(&mut dyn Write) -> std::io::Result<()>,
) -> Result<(), SaveError> {
    stream(path, overwrite, Durability::Cached, make)
}

/// Writes the file that `make` creates at the path it is given to `path`.
///
/// The given path has the file name of `path`, in a temporary folder beside it.
///
/// # Errors
/// [`SaveError::Exists`] without `overwrite`; [`SaveError::Unwritable`]; any error of `make`.
pub fn write_path<E: From<SaveError>>(
    path: &Path,
    overwrite: bool,
    make: impl FnOnce(&Path) -> Result<(), E>,
) -> Result<(), E> {
    let folder = destination_folder(path, overwrite)?;
    let name = path.file_name().ok_or_else(|| SaveError::unwritable(path, "the path has no file name"))?;
    let failed = |error: std::io::Error| SaveError::system(path, &error);
    let scratch = Builder::new().prefix(PREFIX).tempdir_in(folder).map_err(failed)?;
    let made = scratch.path().join(name);
    make(&made)?;
    Ok(std::fs::rename(&made, path).map_err(failed)?)
}

/// Temporary names begin with this, so that what a killed process leaves is recognised.
const PREFIX: &str = ".skysweep-";
/// Size of the buffer in front of a stream, bytes.
const BUFFER: usize = 1 << 16;

/// Writes a file through a buffered stream under a temporary name in its folder, and renames it when
/// `make` succeeds.
fn stream(
    path: &Path,
    overwrite: bool,
    durability: Durability,
    make: impl FnOnce(&mut dyn Write) -> std::io::Result<()>,
) -> Result<(), SaveError> {
    let folder = destination_folder(path, overwrite)?;
    let failed = |error: std::io::Error| SaveError::system(path, &error);
    let mut builder = Builder::new();
    set_usual_permissions(&mut builder);
    let mut file = builder.prefix(PREFIX).tempfile_in(folder).map_err(failed)?;
    let mut buffered = BufWriter::with_capacity(BUFFER, file.as_file_mut());
    make(&mut buffered).and_then(|()| buffered.flush()).map_err(failed)?;
    drop(buffered);
    if durability == Durability::Synced {
        file.as_file().sync_all().map_err(failed)?;
    }
    if overwrite {
        return file.persist(path).map(drop).map_err(|e| failed(e.error));
    }
    file.persist_noclobber(path).map(drop).map_err(|e| match e.error.kind() {
        ErrorKind::AlreadyExists => SaveError::Exists { path: path.to_owned() },
        _ => failed(e.error),
    })
}

/// Returns the folder of `path` after the checks that need no file.
fn destination_folder(path: &Path, overwrite: bool) -> Result<&Path, SaveError> {
    refuse_existing(path, overwrite)?;
    if path.is_dir() {
        return Err(SaveError::unwritable(path, "a folder has this name"));
    }
    Ok(path.parent().filter(|p| !p.as_os_str().is_empty()).unwrap_or(Path::new(".")))
}

#[cfg(unix)]
fn set_usual_permissions(builder: &mut Builder<'_, '_>) {
    use std::os::unix::fs::PermissionsExt;
    builder.permissions(std::fs::Permissions::from_mode(0o666));
}

#[cfg(not(unix))]
fn set_usual_permissions(_: &mut Builder<'_, '_>) {}

#[cfg(test)]
mod tests {
    use super::*;

    fn names(folder: &Path) -> Vec<std::ffi::OsString> {
        std::fs::read_dir(folder).unwrap().map(|entry| entry.unwrap().file_name()).collect()
    }

    #[test]
    fn failures_leave_the_destination_as_it_was() {
        let folder = tempfile::tempdir().unwrap();
        let path = folder.path().join("a.txt");
        write_bytes(&path, b"old", false).unwrap();
        assert!(matches!(write_bytes(&path, b"new", false), Err(SaveError::Exists { .. })));
        let broken = write_stream(&path, true, |out| {
            out.write_all(b"half")?;
            Err(ErrorKind::InvalidInput.into())
        });
        assert!(matches!(broken, Err(SaveError::Unwritable { .. })));
        let broken = write_path(&path, true, |made| {
            std::fs::write(made, b"half").unwrap();
            Err(SaveError::unwritable(made, "enough"))
        });
        assert!(matches!(broken, Err(SaveError::Unwritable { .. })));
        assert_eq!(std::fs::read(&path).unwrap(), b"old");
        write_path::<SaveError>(&path, true, |made| {
            std::fs::write(made, b"new").unwrap();
            std::fs::write(made.with_extension("side"), b"a side file").unwrap();
            Ok(())
        })
        .unwrap();
        assert_eq!(std::fs::read(&path).unwrap(), b"new");
        assert_eq!(names(folder.path()), ["a.txt"]);
    }

    #[test]
    fn folders_are_not_replaced() {
        let folder = tempfile::tempdir().unwrap();
        let taken = write_bytes(folder.path(), b"", true).unwrap_err();
        assert!(taken.to_string().contains("a folder has this name"), "{taken}");
        assert!(matches!(write_bytes(folder.path(), b"", false), Err(SaveError::Exists { .. })));
    }

    #[cfg(unix)]
    #[test]
    fn every_writer_gives_the_usual_permissions() {
        use std::os::unix::fs::PermissionsExt;
        let folder = tempfile::tempdir().unwrap();
        let [plain, bytes, synced, path] = ["plain", "bytes", "synced", "path"].map(|name| folder.path().join(name));
        std::fs::write(&plain, b"").unwrap();
        write_bytes(&bytes, b"", false).unwrap();
        write_bytes_synced(&synced, b"", false).unwrap();
        write_path::<SaveError>(&path, false, |made| {
            std::fs::write(made, b"").unwrap();
            Ok(())
        })
        .unwrap();
        let mode = |path: &PathBuf| std::fs::metadata(path).unwrap().permissions().mode();
        assert!([&bytes, &synced, &path].into_iter().all(|path| mode(path) == mode(&plain)));
    }
}
