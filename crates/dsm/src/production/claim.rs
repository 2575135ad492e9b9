//! Claims on chunks, so that several processes share a run folder.
//!
//! A claim is the status file `running` of a chunk. It is created exclusively, complete and locked:
//! whoever finds it there leaves the chunk alone while its process lives. A process is gone when
//! its lock is free and it ran on this machine, or when its heartbeat, the time of the file, is
//! more than a minute from now. The claim is then taken over. That holds for both sides of now: a
//! clock that is wrong, or a forged time, must not keep a chunk for ever.
//!
//! A process that was only suspended may wake up after its claim was taken. It notices before it
//! writes, and both would write the same bytes.

use std::fs::{self, File, TryLockError};
use std::io::{ErrorKind, Write};
use std::path::{Path, PathBuf};
use std::sync::mpsc::{RecvTimeoutError, Sender, channel};
use std::thread::JoinHandle;
use std::time::{Duration, SystemTime};

use crate::production::chunk_folder::{CLAIM_WORK, ChunkFolder, ChunkState, ChunkStatus, ChunkWorker};
use job::files::FileError;

/// Time between two heartbeats.
const HEARTBEAT: Duration = Duration::from_secs(10);
/// A process without a heartbeat for this time is gone. One whose clock is ahead of ours by as much
/// counts as gone, too: its claim would hold for longer than that.
const GONE: Duration = Duration::from_secs(60);

/// The right to compute a chunk. Dropping it gives the chunk back, unless another status was set.
#[derive(Debug)]
pub(super) struct Claim {
    path: PathBuf,
    file: File,
    beat: Option<(Sender<()>, JoinHandle<()>)>,
}

/// What became of the wish to compute a chunk.
#[derive(Debug)]
pub(super) enum Claimed {
    /// It is ours.
    Ours(Claim),
    /// Another process computes it, or has just finished it.
    Theirs,
}

impl Claim {
    /// Claims a chunk that is waiting, or whose process is gone. `may_replace` is asked whether a
    /// chunk with this state may be computed again.
    ///
    /// # Errors
    /// [`FileError`] when the folder cannot be written.
    pub(super) fn take(
        folder: &ChunkFolder,
        plan: &str,
        may_replace: impl Fn(&ChunkState) -> bool,
    ) -> Result<Claimed, FileError> {
        let (inside, path) = (folder.create()?, folder.status_file());
        let failed = |source| FileError::Unwritable { path: inside.to_owned(), source };
        let is_new = !path.exists();
        match folder.status(plan).map(|status| status.state) {
            Some(ChunkState::Running(worker)) if is_alive(&path, &worker) => return Ok(Claimed::Theirs),
            Some(ChunkState::Running(_)) => {}
            Some(state) if !may_replace(&state) => return Ok(Claimed::Theirs),
            _ => {}
        }
        // Moving an old status away is for one process only: for the others it is gone.
        let work = || tempfile::Builder::new().prefix(CLAIM_WORK).tempfile_in(inside).map_err(failed);
        let aside = work()?.into_temp_path();
        match if is_new { Err(ErrorKind::NotFound.into()) } else { fs::rename(&path, &aside) } {
            Err(error) if error.kind() != ErrorKind::NotFound => return Err(failed(error)),
            _ => drop(aside),
        }
        let made = work()?;
        // Where the file system knows no locks, the heartbeat alone says that we live.
        let _ = made.as_file().try_lock();
        let state = ChunkState::Running(ChunkWorker::here());
        let json = serde_json::to_string(&ChunkStatus { plan: plan.to_owned(), state })? + "\n";
        made.as_file().write_all(json.as_bytes()).map_err(failed)?;
        let file = match made.persist_noclobber(&path) {
            Ok(file) => file,
            // Without the file or its folder, another process has removed what was there.
            Err(error) if matches!(error.error.kind(), ErrorKind::AlreadyExists | ErrorKind::NotFound) => {
                return Ok(Claimed::Theirs);
            }
            Err(error) => return Err(failed(error.error)),
        };
        let beat = Some(heartbeat(file.try_clone().map_err(failed)?));
        let claim = Self { path, file, beat };
        folder.clear()?;
        Ok(Claimed::Ours(claim))
    }

    /// Whether the claim was not taken over.
    pub(super) fn is_ours(&self) -> bool {
        File::open(&self.path).is_ok_and(|other| is_same(&self.file, &other))
    }
}

impl Drop for Claim {
    fn drop(&mut self) {
        if let Some((stop, thread)) = self.beat.take() {
            drop(stop);
            let _ = thread.join();
        }
        if self.is_ours() {
            // Best effort: a claim that stays is taken over, for its lock ends here.
            let _ = fs::remove_file(&self.path);
        }
    }
}

/// Keeps the time of a claim young until the sender is dropped.
fn heartbeat(file: File) -> (Sender<()>, JoinHandle<()>) {
    let (stop, stopped) = channel();
    let thread = std::thread::spawn(move || {
        while stopped.recv_timeout(HEARTBEAT) == Err(RecvTimeoutError::Timeout) {
            // A beat that is lost is followed by others within the minute.
            let _ = file.set_modified(SystemTime::now());
        }
    });
    (stop, thread)
}

/// Whether the process of a claim lives.
fn is_alive(claim: &Path, worker: &ChunkWorker) -> bool {
    let Ok(file) = File::open(claim) else { return false };
    let time = file.metadata().and_then(|found| found.modified());
    let beats = time.is_ok_and(|time| distance(time, SystemTime::now()) < GONE);
    // Those who ask share their lock, so that they do not take each other for the owner.
    match file.try_lock_shared() {
        Err(TryLockError::WouldBlock) => true,
        Ok(()) if !worker.host.is_empty() && worker.host == ChunkWorker::here().host => false,
        // Locks may not reach from one machine to another.
        _ => beats,
    }
}

/// Returns the time between two times, whichever is the earlier.
fn distance(a: SystemTime, b: SystemTime) -> Duration {
    a.duration_since(b).unwrap_or_else(|earlier| earlier.duration())
}

#[cfg(unix)]
fn is_same(a: &File, b: &File) -> bool {
    use std::os::unix::fs::MetadataExt;
    let key = |file: &File| file.metadata().ok().map(|found| (found.dev(), found.ino()));
    key(a) == key(b)
}

/// Without numbers of files the claim is taken as ours: results are the same whoever writes them.
#[cfg(not(unix))]
fn is_same(_: &File, _: &File) -> bool {
    true
}

#[cfg(test)]
mod tests {
    use super::*;

    const NEVER: fn(&ChunkState) -> bool = |_| false;

    fn ours(claimed: Claimed) -> Claim {
        match claimed {
            Claimed::Ours(claim) => claim,
            Claimed::Theirs => panic!("the chunk is taken"),
        }
    }

    #[test]
    fn a_chunk_has_one_worker_at_a_time() {
        let root = tempfile::tempdir().unwrap();
        let folder = ChunkFolder::of(root.path(), 3);
        let claim = ours(Claim::take(&folder, "p", NEVER).unwrap());
        assert!(claim.is_ours());
        assert!(matches!(Claim::take(&folder, "p", NEVER).unwrap(), Claimed::Theirs));
        drop(claim);
        assert!(folder.status("p").is_none(), "a claim without a result is given back");
        let claim = ours(Claim::take(&folder, "p", NEVER).unwrap());
        folder.set_status("p", ChunkState::Done { seconds: 1.0, files: Vec::new() }).unwrap();
        drop(claim);
        assert!(matches!(folder.status("p").unwrap().state, ChunkState::Done { .. }));
        assert!(matches!(Claim::take(&folder, "p", NEVER).unwrap(), Claimed::Theirs));
        assert!(folder.status("another plan").is_none());
        let names: Vec<_> = fs::read_dir(folder.create().unwrap()).unwrap().map(|e| e.unwrap().file_name()).collect();
        assert_eq!(names, ["status"]);
    }

    /// The lock of a killed process is free. The claim of another machine holds as long as its
    /// heart beats.
    #[test]
    fn claims_of_gone_processes_are_taken_over() {
        let root = tempfile::tempdir().unwrap();
        let folder = ChunkFolder::of(root.path(), 0);
        folder.create().unwrap();
        let now = SystemTime::now();
        let second = Duration::from_secs(1);
        let left = |host: &str, time: SystemTime| {
            let worker = ChunkWorker { host: host.to_owned(), pid: 1 };
            folder.set_status("p", ChunkState::Running(worker)).unwrap();
            let file = File::options().write(true).open(folder.status_file()).unwrap();
            file.set_modified(time).unwrap();
            fs::create_dir_all(folder.result()).unwrap();
        };
        left(&ChunkWorker::here().host, now);
        drop(ours(Claim::take(&folder, "p", NEVER).unwrap()));
        assert!(!folder.result().exists());
        // The file of a process that asks for the chunk at the same time is its own.
        let asking = folder.create().unwrap().join(".claim-asking");
        fs::write(&asking, "").unwrap();
        drop(ours(Claim::take(&folder, "p", NEVER).unwrap()));
        assert!(asking.exists());
        // A machine without a name may be any machine.
        left("", now - 5 * second);
        assert!(matches!(Claim::take(&folder, "p", NEVER).unwrap(), Claimed::Theirs));
        left("another machine", now - 5 * second);
        assert!(matches!(Claim::take(&folder, "p", NEVER).unwrap(), Claimed::Theirs));
        left("another machine", now - 90 * second);
        drop(ours(Claim::take(&folder, "p", NEVER).unwrap()));
        // A clock that is a little ahead is no reason, and one that is far ahead holds no chunk.
        left("another machine", now + 30 * second);
        assert!(matches!(Claim::take(&folder, "p", NEVER).unwrap(), Claimed::Theirs));
        for ahead in [90, 3600, 400 * 86_400] {
            left("another machine", now + ahead * second);
            drop(ours(Claim::take(&folder, "p", NEVER).unwrap()));
        }
    }
}
