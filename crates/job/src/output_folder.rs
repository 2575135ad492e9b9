//! The output folder of a run: one run at a time, with a work folder of its own.
//!
//! A run holds a lock on its folder (an advisory lock of the system on the folder itself, which
//! ends with the process), so that a second run is refused and not mixed into the first. Files are
//! made in a hidden work folder with a name that nobody can foresee, which is made new, and moved
//! to their names at the end. What killed runs left of their work folders is removed by the next
//! run. Where the file system knows no locks, runs still have work folders of their own.

use std::fs::{self, File, TryLockError};
use std::path::{Path, PathBuf};

use tempfile::TempDir;

use crate::files::{FileError, create_folder};
use crate::guarded::{self, Known};

/// Beginning of the names of work folders.
const WORK: &str = ".skysweep-partial";
/// Times that a lock is asked for again because the folder was removed meanwhile.
const ATTEMPTS: usize = 10;

/// An output folder that this run alone writes to. Dropping it ends the lock, and removes the
/// folder again when the run made it and it is empty.
#[derive(Debug)]
pub struct OutputFolder {
    path: PathBuf,
    /// Whether this run made the folder.
    created: bool,
    /// The open folder, which holds the lock.
    _lock: Option<File>,
}

impl OutputFolder {
    /// Makes the folder if need be, and takes it for this run. What would fail when the results are
    /// written fails here.
    ///
    /// # Errors
    /// [`FileError::InUse`] when another run writes into it, [`FileError::Folder`] when it cannot
    /// be made or is a file, [`FileError::Unwritable`], [`FileError::NotUtf8`].
    pub fn take(path: &Path) -> Result<Self, FileError> {
        if path.to_str().is_none() {
            return Err(FileError::NotUtf8 { path: path.to_owned() });
        }
        let folder = Self::lock(path)?;
        match tempfile::Builder::new().prefix(WORK).tempfile_in(path) {
            Ok(_) => Ok(folder),
            Err(source) => Err(FileError::Unwritable { path: path.to_owned(), source }),
        }
    }

    /// Takes a folder that exists for work that several processes share. It keeps out runs that
    /// want the folder for themselves.
    ///
    /// # Errors
    /// [`FileError::InUse`] when a run has the folder for itself, [`FileError::Folder`] when there
    /// is none.
    pub fn share(path: &Path) -> Result<Self, FileError> {
        let handle = File::open(path).map_err(|source| FileError::Folder { path: path.to_owned(), source })?;
        let lock = match handle.try_lock_shared() {
            Ok(()) => Some(handle),
            Err(TryLockError::WouldBlock) => return Err(FileError::InUse { path: path.to_owned() }),
            Err(TryLockError::Error(_)) => None,
        };
        Ok(Self { path: path.to_owned(), created: false, _lock: lock })
    }

    /// Checks that a run could take the folder, and leaves it as it was.
    ///
    /// # Errors
    /// As [`Self::take`].
    pub fn check(path: &Path) -> Result<(), FileError> {
        Self::take(path).map(drop)
    }

    fn lock(path: &Path) -> Result<Self, FileError> {
        for _ in 0..ATTEMPTS {
            let created = path.symlink_metadata().is_err();
            create_folder(path)?;
            let Ok(handle) = File::open(path) else {
                // A folder that can be written but not listed cannot be locked either.
                return Ok(Self { path: path.to_owned(), created, _lock: None });
            };
            let lock = match handle.try_lock() {
                Ok(()) => Some(handle),
                Err(TryLockError::WouldBlock) => return Err(FileError::InUse { path: path.to_owned() }),
                Err(TryLockError::Error(_)) => None,
            };
            if lock.as_ref().is_none_or(|lock| is_same(lock, path)) {
                let folder = Self { path: path.to_owned(), created, _lock: lock };
                folder.remove_left_over();
                return Ok(folder);
            }
        }
        Err(FileError::InUse { path: path.to_owned() })
    }

    /// The folder.
    pub fn path(&self) -> &Path {
        &self.path
    }

    /// Makes a new hidden folder inside. It is removed when it is dropped.
    ///
    /// # Errors
    /// [`FileError::Folder`].
    pub fn work_folder(&self) -> Result<TempDir, FileError> {
        tempfile::Builder::new()
            .prefix(&format!("{WORK}-"))
            .tempdir_in(&self.path)
            .map_err(|source| FileError::Folder { path: self.path.clone(), source })
    }

    /// Makes a folder inside, and refuses a link in its place, which could lead outside.
    ///
    /// # Errors
    /// [`FileError::Link`], [`FileError::Folder`].
    pub fn subfolder(&self, name: &str) -> Result<PathBuf, FileError> {
        guarded::make_folder(&self.path, name)
    }

    /// Checks before the work that files can get their names inside.
    ///
    /// # Errors
    /// [`FileError::Link`], [`FileError::Foreign`].
    pub fn check_places<'a>(&self, names: impl IntoIterator<Item = &'a str>) -> Result<(), FileError> {
        guarded::check_places(&self.path, names)
    }

    /// Refuses links and files in the place of folders inside, before the work.
    ///
    /// # Errors
    /// [`FileError::Link`], [`FileError::Folder`].
    pub fn check_folders<'a>(&self, names: impl IntoIterator<Item = &'a str>) -> Result<(), FileError> {
        guarded::check_folders(&self.path, names)
    }

    /// Removes the file of a name inside, if there is one. A link is removed, and not what it leads
    /// to.
    ///
    /// # Errors
    /// [`FileError::Link`], [`FileError::Foreign`], [`FileError::Remove`].
    pub fn remove(&self, name: &str) -> Result<(), FileError> {
        guarded::remove_file(&self.path, name)
    }

    /// Removes the folder of a name inside, if there is one, when all of it is known.
    ///
    /// # Errors
    /// [`FileError::Link`], [`FileError::Foreign`], [`FileError::Remove`]; nothing was removed
    /// then.
    pub fn remove_folder(&self, name: &str, known: Known<'_>) -> Result<(), FileError> {
        guarded::remove_folder(&guarded::place(&self.path, name)?, known)
    }

    /// Checks that the folder of a name inside could be removed.
    ///
    /// # Errors
    /// [`FileError::Link`], [`FileError::Foreign`].
    pub fn require_own(&self, name: &str, known: Known<'_>) -> Result<(), FileError> {
        guarded::require_own(&guarded::place(&self.path, name)?, known)
    }

    /// Moves a file or folder from a work folder to its name. A folder must have been removed
    /// before.
    ///
    /// # Errors
    /// [`FileError::Link`], [`FileError::Folder`], [`FileError::Move`].
    pub fn publish(&self, work: &Path, name: &str) -> Result<(), FileError> {
        if let Some((folder, _)) = name.rsplit_once('/') {
            self.subfolder(folder)?;
        }
        let path = self.path.join(name);
        fs::rename(work.join(name), &path).map_err(|source| FileError::Move { path, source })
    }

    /// Removes the work folders of runs that were killed. This run has the lock, so they belong to
    /// nobody.
    fn remove_left_over(&self) {
        if self._lock.is_none() {
            return;
        }
        let entries = fs::read_dir(&self.path).into_iter().flatten().flatten();
        for entry in entries.filter(|entry| entry.file_name().to_string_lossy().starts_with(WORK)) {
            // A planted link is not a folder, and stays. What cannot be removed does no harm.
            if entry.file_type().is_ok_and(|kind| kind.is_dir()) {
                let _ = fs::remove_dir_all(entry.path());
            }
        }
    }
}

impl Drop for OutputFolder {
    fn drop(&mut self) {
        if self.created {
            // Removes nothing that has content.
            let _ = fs::remove_dir(&self.path);
        }
    }
}

/// Whether an open folder is still the one of this name.
#[cfg(unix)]
fn is_same(open: &File, path: &Path) -> bool {
    use std::os::unix::fs::MetadataExt;
    let key = |found: fs::Metadata| (found.dev(), found.ino());
    open.metadata().ok().map(key) == fs::metadata(path).ok().map(key)
}

#[cfg(not(unix))]
fn is_same(_: &File, path: &Path) -> bool {
    path.is_dir()
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn a_folder_has_one_run_at_a_time() {
        let root = tempfile::tempdir().unwrap();
        let path = root.path().join("new/out");
        let first = OutputFolder::take(&path).unwrap();
        let second = OutputFolder::take(&path).unwrap_err();
        assert!(matches!(second, FileError::InUse { .. }), "{second}");
        drop(first);
        assert!(!path.exists(), "an empty folder is removed again");
        let third = OutputFolder::take(&path).unwrap();
        fs::write(path.join("kept"), b"").unwrap();
        drop(third);
        assert!(path.exists());
    }

    #[cfg(target_os = "linux")]
    #[test]
    fn folders_that_cannot_take_results_are_refused_before_the_work() {
        use std::os::unix::ffi::OsStrExt;
        let root = tempfile::tempdir().unwrap();
        let file = root.path().join("file");
        fs::write(&file, b"").unwrap();
        for path in [file.clone(), file.join("below")] {
            let error = OutputFolder::check(&path).unwrap_err();
            assert!(matches!(error, FileError::Folder { .. }), "{error}");
        }
        // Nobody makes files here, not even root.
        let error = OutputFolder::check(Path::new("/proc/self")).unwrap_err();
        assert!(matches!(error, FileError::Unwritable { .. }), "{error}");
        let strange = root.path().join(std::ffi::OsStr::from_bytes(b"\xff"));
        let error = OutputFolder::check(&strange).unwrap_err();
        assert!(matches!(error, FileError::NotUtf8 { .. }), "{error}");
        let new = root.path().join("new");
        OutputFolder::check(&new).unwrap();
        assert!(!new.exists() && !strange.exists());
    }

    #[cfg(unix)]
    #[test]
    fn links_lead_nowhere() {
        let root = tempfile::tempdir().unwrap();
        let (path, outside) = (root.path().join("out"), root.path().join("outside"));
        fs::create_dir_all(&path).unwrap();
        fs::create_dir_all(&outside).unwrap();
        fs::write(outside.join("precious"), b"old").unwrap();
        fs::create_dir_all(path.join(".skysweep-partial-left")).unwrap();
        for name in [".skysweep-partial", "dsm"] {
            std::os::unix::fs::symlink(&outside, path.join(name)).unwrap();
        }
        let folder = OutputFolder::take(&path).unwrap();
        assert!(!path.join(".skysweep-partial-left").exists());
        let work = folder.work_folder().unwrap();
        fs::create_dir_all(work.path().join("dsm")).unwrap();
        fs::write(work.path().join("dsm/precious"), b"new").unwrap();
        assert!(matches!(folder.publish(work.path(), "dsm/precious"), Err(FileError::Link { .. })));
        folder.remove("dsm").unwrap();
        folder.publish(work.path(), "dsm/precious").unwrap();
        assert_eq!(fs::read(path.join("dsm/precious")).unwrap(), b"new");
        assert_eq!(fs::read(outside.join("precious")).unwrap(), b"old");
    }
}
