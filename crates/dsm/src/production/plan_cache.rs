//! What this process read last from a file of its kind, so that a worker reads the plan of a large
//! scene once and not for each of its chunks.
//!
//! A plan is written under another name and renamed. Its file is known by its place on the disk,
//! its size and its times, of which no program sets the time of change.

use std::path::{Path, PathBuf};
use std::sync::{Arc, Mutex, PoisonError};

/// What tells a file from the one that was there before: device, place, size, and the times of
/// modification and of change, seconds and nanoseconds.
pub(super) type Stamp = [i128; 7];

/// Returns the stamp of a file; `None` where the system has none that can be trusted.
#[cfg(unix)]
pub(super) fn stamp(path: &Path) -> Option<Stamp> {
    use std::os::unix::fs::MetadataExt;
    let found = path.metadata().ok()?;
    let place = [found.dev(), found.ino(), found.len()].map(i128::from);
    let times = [found.mtime(), found.mtime_nsec(), found.ctime(), found.ctime_nsec()].map(i128::from);
    let ([device, node, bytes], [modified, modified_ns, changed, changed_ns]) = (place, times);
    Some([device, node, bytes, modified, modified_ns, changed, changed_ns])
}

/// Without a time of change every file is read again.
#[cfg(not(unix))]
pub(super) fn stamp(_: &Path) -> Option<Stamp> {
    None
}

/// The content of the file that was read last, with the folder from which it was read.
pub(super) struct LastRead<T>(Mutex<Option<(PathBuf, Stamp, Arc<T>)>>);

impl<T> LastRead<T> {
    /// Nothing was read.
    pub(super) const fn new() -> Self {
        Self(Mutex::new(None))
    }

    /// Returns the content, if the file of this folder with this stamp was read last.
    pub(super) fn kept(&self, folder: &Path, stamp: Option<Stamp>) -> Option<Arc<T>> {
        let last = self.0.lock().unwrap_or_else(PoisonError::into_inner);
        let (known, of, content) = last.as_ref()?;
        (known == folder && Some(*of) == stamp).then(|| content.clone())
    }

    /// Keeps a content in the place of the one before. The stamp was taken before it was read.
    pub(super) fn keep(&self, folder: &Path, stamp: Option<Stamp>, content: &Arc<T>) {
        let Some(stamp) = stamp else { return };
        *self.0.lock().unwrap_or_else(PoisonError::into_inner) = Some((folder.to_owned(), stamp, content.clone()));
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn a_file_that_was_replaced_is_not_the_one_that_was_read() {
        let folder = tempfile::tempdir().unwrap();
        let (path, last) = (folder.path().join("plan"), LastRead::new());
        std::fs::write(&path, "old").unwrap();
        let of_old = stamp(&path);
        assert!(last.kept(folder.path(), of_old).is_none());
        last.keep(folder.path(), of_old, &Arc::new("old"));
        let kept = |folder: &Path| last.kept(folder, stamp(&path)).map(|content| *content);
        assert_eq!(kept(folder.path()), of_old.map(|_| "old"));
        assert_eq!(kept(Path::new("elsewhere")), None);
        let other = folder.path().join("other");
        std::fs::write(&other, "new").unwrap();
        std::fs::rename(&other, &path).unwrap();
        assert_eq!(kept(folder.path()), None);
    }
}
