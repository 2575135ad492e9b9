//! The folders of chunks: `chunks/0007/status` says how a chunk stands, `chunks/0007/result` holds
//! its result.
//!
//! The result is complete under its name, and the status is written after it. Both appear by
//! renaming, so a reader never sees a half-written one. A status belongs to the plan that it names.

use std::fs;
use std::io::ErrorKind;
use std::path::{Path, PathBuf};

use serde::{Deserialize, Serialize};

use crate::files::{FileError, TEXT_LIMIT, create_folder};
use crate::production::product_file::ProductFile;

/// Folder of all chunks.
pub(super) const CHUNKS: &str = "chunks";
/// Beginning of the names of files that become claims, or were some.
pub(super) const CLAIM_WORK: &str = ".claim-";
/// Name of the status of a chunk.
const STATUS: &str = "status";
/// Name of the folder of the result.
const RESULT: &str = "result";

/// How a chunk stands, as its status says.
#[derive(Debug, Clone, PartialEq, Serialize, Deserialize)]
pub(super) struct ChunkStatus {
    /// Identity of the plan.
    pub(super) plan: String,
    #[serde(flatten)]
    pub(super) state: ChunkState,
}

/// The state of a chunk that is not waiting any more.
#[derive(Debug, Clone, PartialEq, Serialize, Deserialize)]
#[serde(tag = "state", rename_all = "lowercase")]
pub(super) enum ChunkState {
    /// A process computes the chunk. The time of the file is its heartbeat.
    Running(ChunkWorker),
    /// The chunk has a result.
    Done {
        /// Wall time, seconds.
        seconds: f64,
        /// Files of the result.
        files: Vec<ProductFile>,
    },
    /// The chunk could not be computed.
    Failed {
        /// Cause.
        reason: String,
    },
}

/// The process that computes a chunk.
#[derive(Debug, Clone, PartialEq, Eq, Serialize, Deserialize)]
pub struct ChunkWorker {
    /// Name of its machine.
    pub host: String,
    /// Number of the process there.
    pub pid: u32,
}

impl ChunkWorker {
    /// Returns this process.
    pub(super) fn here() -> Self {
        let name = fs::read_to_string("/proc/sys/kernel/hostname").ok();
        let host = name.or_else(|| std::env::var("HOSTNAME").ok()).unwrap_or_default();
        Self { host: host.trim().to_owned(), pid: std::process::id() }
    }
}

/// The folder of one chunk.
#[derive(Debug, Clone)]
pub(super) struct ChunkFolder(PathBuf);

impl ChunkFolder {
    /// Returns the folder of the chunk with a number, from 0.
    pub(super) fn of(run: &Path, index: usize) -> Self {
        Self(run.join(CHUNKS).join(format!("{index:04}")))
    }

    /// Makes the folder if there is none.
    ///
    /// # Errors
    /// [`FileError::Folder`].
    pub(super) fn create(&self) -> Result<&Path, FileError> {
        create_folder(&self.0)?;
        Ok(&self.0)
    }

    /// The file of the status.
    pub(super) fn status_file(&self) -> PathBuf {
        self.0.join(STATUS)
    }

    /// The folder of the result.
    pub(super) fn result(&self) -> PathBuf {
        self.0.join(RESULT)
    }

    /// Returns the status that belongs to the plan; `None` when there is none, or another plan's.
    pub(super) fn status(&self, plan: &str) -> Option<ChunkStatus> {
        let json = io::read_regular(&self.status_file(), TEXT_LIMIT).ok()?;
        serde_json::from_slice::<ChunkStatus>(&json).ok().filter(|status| status.plan == plan)
    }

    /// Returns the files of the result, as they are kept with the status.
    ///
    /// # Errors
    /// [`FileError::Read`].
    pub(super) fn result_files(&self) -> Result<Vec<ProductFile>, FileError> {
        ProductFile::all_of(&self.0, &[PathBuf::from(RESULT)])
    }

    /// Returns what is wrong with a result that was complete; `None` when it is as it was written,
    /// and for other states.
    pub(super) fn damage(&self, state: &ChunkState) -> Option<String> {
        match state {
            ChunkState::Done { files, .. } => ProductFile::damage(&self.0, files),
            _ => None,
        }
    }

    /// Replaces the status.
    ///
    /// # Errors
    /// [`FileError::Write`].
    pub(super) fn set_status(&self, plan: &str, state: ChunkState) -> Result<(), FileError> {
        let json = serde_json::to_string(&ChunkStatus { plan: plan.to_owned(), state })? + "\n";
        Ok(io::write_bytes(self.status_file(), json.as_bytes(), true)?)
    }

    /// Removes an old result, and what a killed process left of one. Files of claims stay: another
    /// process may be asking for the chunk at this moment.
    ///
    /// # Errors
    /// [`FileError::Remove`].
    pub(super) fn clear(&self) -> Result<(), FileError> {
        self.remove(|name| name != STATUS && !name.starts_with(CLAIM_WORK))
    }

    /// Removes what a killed process left in the folder. The caller has the run folder for itself.
    ///
    /// # Errors
    /// [`FileError::Remove`].
    pub(super) fn remove_left_over(&self) -> Result<(), FileError> {
        self.remove(|name| name != STATUS && name != RESULT)
    }

    fn remove(&self, is_old: impl Fn(&str) -> bool) -> Result<(), FileError> {
        for entry in fs::read_dir(&self.0).into_iter().flatten().flatten() {
            if is_old(&entry.file_name().to_string_lossy()) {
                let path = entry.path();
                let is_folder = entry.file_type().is_ok_and(|kind| kind.is_dir());
                let removed = if is_folder { fs::remove_dir_all(&path) } else { fs::remove_file(&path) };
                match removed {
                    // Another process was faster.
                    Err(error) if error.kind() == ErrorKind::NotFound => {}
                    other => other.map_err(|source| FileError::Remove { path, source })?,
                }
            }
        }
        Ok(())
    }

    /// Removes the folder. The status goes first, so that what a killed process leaves of a result
    /// never counts as one.
    ///
    /// # Errors
    /// [`FileError::Remove`].
    fn remove_whole(&self) -> Result<(), FileError> {
        crate::files::remove(&self.status_file())?;
        fs::remove_dir_all(&self.0).map_err(|source| FileError::Remove { path: self.0.clone(), source })
    }
}

/// Removes the folders of chunks that belong to other plans. The caller has the run folder for
/// itself.
///
/// # Errors
/// [`FileError::Remove`].
pub(super) fn remove_others(run: &Path, plan: &str) -> Result<(), FileError> {
    for entry in fs::read_dir(run.join(CHUNKS)).into_iter().flatten().flatten() {
        let folder = ChunkFolder(entry.path());
        if folder.status(plan).is_none() {
            folder.remove_whole()?;
        }
    }
    Ok(())
}
