//! The plan that this process read last, so that a worker reads the plan of a large scene once and
//! not for each of its chunks.
//!
//! A plan is written under another name and renamed. Its file is known by its place on the disk,
//! its size and its times, of which no program sets the time of change.

use std::path::{Path, PathBuf};
use std::sync::{Arc, Mutex, PoisonError};

use crate::production::plan_file::PlanFile;

/// What tells a file from the one that was there before: device, place, size, and the times of
/// modification and of change, seconds and nanoseconds.
pub(super) type Stamp = [i128; 7];

/// A plan with the folder from which it was read and the stamp of its file.
struct Kept {
    folder: PathBuf,
    stamp: Stamp,
    plan: Arc<PlanFile>,
}

static LAST: Mutex<Option<Kept>> = Mutex::new(None);

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

/// Without a time of change every plan is read again.
#[cfg(not(unix))]
pub(super) fn stamp(_: &Path) -> Option<Stamp> {
    None
}

/// Returns the plan of a folder, if the file with this stamp was read last.
pub(super) fn kept(folder: &Path, stamp: Option<Stamp>) -> Option<Arc<PlanFile>> {
    let last = LAST.lock().unwrap_or_else(PoisonError::into_inner);
    let fits = |kept: &&Kept| kept.folder == folder && Some(kept.stamp) == stamp;
    last.as_ref().filter(fits).map(|kept| kept.plan.clone())
}

/// Keeps a plan in the place of the one before. The stamp was taken before the file was read.
pub(super) fn keep(folder: &Path, stamp: Option<Stamp>, plan: &Arc<PlanFile>) {
    let Some(stamp) = stamp else { return };
    let kept = Kept { folder: folder.to_owned(), stamp, plan: plan.clone() };
    *LAST.lock().unwrap_or_else(PoisonError::into_inner) = Some(kept);
}
