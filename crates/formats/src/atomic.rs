//! The one atomic writer: a file under its final name is complete.
//!
//! A file is made under a temporary name in the folder of its destination, flushed to the disk and
//! then renamed. On any failure, and when the process is killed, the destination is as it was
//! before. A full disk often shows only when the content is flushed, so nothing is renamed before.
//! The new file has the usual permissions (0666 less the umask), not the private ones of temporary
//! files.
//!
//! [`write_stream`] suits formats that are written from front to back. It never replaces a file
//! that appears meanwhile, unless overwriting is allowed. [`write_path`] suits libraries that want
//! a path (GDAL): it gives them a temporary folder, so that side files vanish with the folder.
//! [`write_bytes`] takes content that is already in memory.

use std::fs::File;
use std::io::{BufWriter, ErrorKind, Write};
use std::path::{Path, PathBuf};

use numeric::{Kind, failures};
use tempfile::{Builder, TempPath};

/// A file that was not written.
#[derive(Debug, thiserror::Error)]
#[non_exhaustive]
pub enum SaveError {
    /// The output exists, and overwriting was not allowed.
    #[error("the output exists already: choose another name or allow overwriting: {}", .path.display())]
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
    /// The disk has too little space for the output.
    #[error(
        "the disk has {} MB free and the output takes about {} MB; make space or choose another folder: {}",
        .free_bytes / 1_000_000, .needed_bytes.div_ceil(1_000_000), .path.display()
    )]
    NoSpace {
        /// Folder of the output.
        path: PathBuf,
        /// Estimated size of the output, bytes.
        needed_bytes: u64,
        /// Space that is left, bytes.
        free_bytes: u64,
    },
}

failures!(SaveError: File { Self::Exists { .. } => Kind::OutputExists });

impl SaveError {
    /// Returns the error of an output at `path` that cannot be written, with the reason as a text.
    pub fn unwritable(path: &Path, reason: impl ToString) -> Self {
        Self::Unwritable { path: path.to_owned(), reason: reason.to_string() }
    }

    /// Returns the path of the output, or of its folder where the disk is full.
    pub fn path(&self) -> &Path {
        match self {
            Self::Exists { path } | Self::Unwritable { path, .. } | Self::NoSpace { path, .. } => path,
        }
    }

    /// Wraps an error of the system without the temporary name that `tempfile` adds to its text.
    fn system(path: &Path, error: &std::io::Error) -> Self {
        Self::unwritable(path, error.kind())
    }
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

/// Checks that a file can be written to `path`, before the work whose result it will hold. A file
/// is made in the folder and removed again.
///
/// # Errors
/// [`SaveError::Exists`] without `overwrite`; [`SaveError::Unwritable`] for a folder that is
/// missing or cannot be written into, and for a path that is a folder.
pub fn check_destination(path: &Path, overwrite: bool) -> Result<(), SaveError> {
    let folder = destination_folder(path, overwrite)?;
    if path.file_name().is_none() {
        return Err(SaveError::unwritable(path, "the path has no file name"));
    }
    if !folder.is_dir() {
        return Err(SaveError::unwritable(path, "its folder does not exist"));
    }
    Builder::new().prefix(PREFIX).tempfile_in(folder).map(drop).map_err(|error| SaveError::system(path, &error))
}

/// Writes `bytes` to `path`.
///
/// ```
/// # let folder = tempfile::tempdir()?;
/// let path = folder.path().join("report.json");
/// formats::write_bytes(&path, b"{}\n", false)?;
/// assert!(matches!(formats::write_bytes(&path, b"", false), Err(formats::SaveError::Exists { .. })));
/// assert_eq!(std::fs::read(&path)?, b"{}\n");
/// # Ok::<(), Box<dyn std::error::Error>>(())
/// ```
///
/// # Errors
/// [`SaveError::Exists`] without `overwrite`; [`SaveError::Unwritable`].
pub fn write_bytes(path: impl AsRef<Path>, bytes: &[u8], overwrite: bool) -> Result<(), SaveError> {
    write_stream(path.as_ref(), overwrite, |out| out.write_all(bytes))
}

/// Checks that the disk of `folder`, which may not exist yet, has space for `needed_bytes`.
///
/// It does not reserve the space: the writers still check what they wrote.
///
/// # Errors
/// [`SaveError::NoSpace`]. A disk that does not say how much is free passes.
pub fn require_space(folder: &Path, needed_bytes: u64) -> Result<(), SaveError> {
    match free_bytes(folder) {
        Some(free_bytes) if free_bytes < needed_bytes => {
            Err(SaveError::NoSpace { path: folder.to_owned(), needed_bytes, free_bytes })
        }
        _ => Ok(()),
    }
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
    let folder = destination_folder(path, overwrite)?;
    let failed = |error: std::io::Error| SaveError::system(path, &error);
    let mut builder = Builder::new();
    set_usual_permissions(&mut builder);
    let mut file = builder.prefix(PREFIX).tempfile_in(folder).map_err(failed)?;
    let mut buffered = BufWriter::with_capacity(BUFFER, file.as_file_mut());
    make(&mut buffered).and_then(|()| buffered.flush()).map_err(failed)?;
    drop(buffered);
    file.as_file().sync_all().map_err(failed)?;
    name_finished(file.into_temp_path(), path, overwrite)
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
    File::open(&made).and_then(|file| file.sync_all()).map_err(failed)?;
    let finished = TempPath::try_from_path(&made).map_err(failed)?;
    Ok(name_finished(finished, path, overwrite)?)
}

/// Temporary names begin with this, so that what a killed process leaves is recognised.
const PREFIX: &str = ".skysweep-";
/// Size of the buffer in front of a stream, bytes.
const BUFFER: usize = 1 << 16;

/// Gives a finished file its name.
fn name_finished(finished: TempPath, path: &Path, overwrite: bool) -> Result<(), SaveError> {
    tracing::debug!("writes {}", path.display());
    let named = if overwrite { finished.persist(path) } else { finished.persist_noclobber(path) };
    named.map_err(|e| match e.error.kind() {
        ErrorKind::AlreadyExists => SaveError::Exists { path: path.to_owned() },
        _ => SaveError::system(path, &e.error),
    })
}

/// Returns the space that is free to this user on the disk of a folder, or of the nearest folder
/// above it that exists.
#[cfg(unix)]
fn free_bytes(folder: &Path) -> Option<u64> {
    let absolute = std::path::absolute(folder).ok()?;
    let existing = absolute.ancestors().find(|path| path.is_dir())?;
    let disk = rustix::fs::statvfs(existing).ok()?;
    Some(disk.f_bavail.saturating_mul(disk.f_frsize))
}

#[cfg(not(unix))]
fn free_bytes(_: &Path) -> Option<u64> {
    None
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

    #[test]
    fn a_file_that_appears_meanwhile_is_kept() {
        let folder = tempfile::tempdir().unwrap();
        let path = folder.path().join("a.txt");
        let late = write_path::<SaveError>(&path, false, |made| {
            std::fs::write(made, b"ours").unwrap();
            std::fs::write(&path, b"theirs").unwrap();
            Ok(())
        });
        assert!(matches!(late, Err(SaveError::Exists { .. })), "{late:?}");
        assert_eq!(std::fs::read(&path).unwrap(), b"theirs");
        assert_eq!(names(folder.path()), ["a.txt"]);
    }

    #[cfg(unix)]
    #[test]
    fn space_is_asked_of_the_nearest_folder() {
        let folder = tempfile::tempdir().unwrap();
        let later = folder.path().join("not/made/yet");
        assert!(require_space(&later, 1).is_ok());
        let error = require_space(&later, u64::MAX).unwrap_err();
        assert!(matches!(error, SaveError::NoSpace { .. }), "{error}");
        assert!(error.to_string().contains("MB free"), "{error}");
    }

    #[cfg(unix)]
    #[test]
    fn every_writer_gives_the_usual_permissions() {
        use std::os::unix::fs::PermissionsExt;
        let folder = tempfile::tempdir().unwrap();
        let [plain, bytes, path] = ["plain", "bytes", "path"].map(|name| folder.path().join(name));
        std::fs::write(&plain, b"").unwrap();
        write_bytes(&bytes, b"", false).unwrap();
        write_path::<SaveError>(&path, false, |made| {
            std::fs::write(made, b"").unwrap();
            Ok(())
        })
        .unwrap();
        let mode = |path: &PathBuf| std::fs::metadata(path).unwrap().permissions().mode();
        assert!([&bytes, &path].into_iter().all(|path| mode(path) == mode(&plain)));
    }
}
