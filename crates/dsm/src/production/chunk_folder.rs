//! The folders of chunks: `chunks/0007/status` says how a chunk stands, `chunks/0007/result` holds
//! its result.
//!
//! The result is complete under its name, and the status is written after it. Both appear by
//! renaming, so a reader never sees a half-written one. A status belongs to the plan that it names.

use std::fs;
use std::path::{Path, PathBuf};

use serde::{Deserialize, Serialize};

use crate::ChunkResult;
use crate::production::product_file::ProductFile;
use job::files::{FileError, TEXT_LIMIT, create_folder, names_in};
use job::guarded::{self, TEMPORARY};

/// Folder of all chunks.
pub const CHUNKS: &str = "chunks";
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

    /// Makes the folder if there is none, and refuses one with anything in it that is not ours.
    ///
    /// # Errors
    /// As [`Self::check`].
    pub(super) fn create(&self) -> Result<&Path, FileError> {
        self.check()?;
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
        let json = formats::read_regular(&self.status_file(), TEXT_LIMIT).ok()?;
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
        Ok(formats::write_bytes(self.status_file(), json.as_bytes(), true)?)
    }

    /// Checks that nothing but what processes of ours make is in the folder, and that it is reached
    /// through no link.
    ///
    /// # Errors
    /// [`FileError::Link`], [`FileError::Folder`], [`FileError::Foreign`].
    pub(super) fn check(&self) -> Result<(), FileError> {
        if let Some(chunks) = self.0.parent() {
            guarded::check_folder(chunks)?;
        }
        guarded::require_own(&self.0, &is_ours)?;
        // Whatever fields a status of another version has, it names its plan and its state.
        let is_status = |json: serde_json::Value| json.get("plan").is_some() && json.get("state").is_some();
        match formats::read_regular(&self.status_file(), TEXT_LIMIT) {
            Ok(json) if !serde_json::from_slice(&json).is_ok_and(is_status) => {
                let found = format!("{STATUS}, which is not the status of a chunk");
                Err(FileError::Foreign { path: self.0.clone(), found })
            }
            _ => Ok(()),
        }
    }

    /// Removes an old result, and what a killed process left of one. Files of claims stay: another
    /// process may be asking for the chunk at this moment.
    ///
    /// # Errors
    /// [`FileError::Remove`].
    pub(super) fn clear(&self) -> Result<(), FileError> {
        guarded::remove_known(&self.0, &|name| is_ours(name) && name != STATUS && !name.starts_with(CLAIM_WORK))
    }

    /// Removes what a killed process left in the folder. The caller has the run folder for itself.
    ///
    /// # Errors
    /// [`FileError::Remove`].
    pub(super) fn remove_left_over(&self) -> Result<(), FileError> {
        let is_result = |name: &str| name.split('/').next() == Some(RESULT);
        guarded::remove_known(&self.0, &|name| is_ours(name) && name != STATUS && !is_result(name))
    }

    /// Removes the folder. The status goes first, so that what a killed process leaves of a result
    /// never counts as one.
    ///
    /// # Errors
    /// [`FileError::Foreign`], [`FileError::Remove`].
    fn remove_whole(&self) -> Result<(), FileError> {
        self.check()?;
        job::files::remove(&self.status_file())?;
        guarded::remove_folder(&self.0, &is_ours)
    }
}

/// Whether an entry of the folder of a chunk is ours, by its name there.
fn is_ours(name: &str) -> bool {
    let Some((folder, below)) = name.split_once('/') else { return name == STATUS || is_left_over(name) };
    match folder {
        RESULT => below.is_empty() || ChunkResult::is_part(below),
        _ => folder.starts_with(TEMPORARY),
    }
}

/// Whether a file of this name is what a killed process leaves in the folder of a chunk.
pub fn is_left_over(name: &str) -> bool {
    name.starts_with(CLAIM_WORK) || name.starts_with(TEMPORARY)
}

/// Whether a folder of this name is one of a chunk.
pub fn is_chunk(name: &str) -> bool {
    name.len() >= 4 && name.bytes().all(|byte| byte.is_ascii_digit())
}

/// Checks that the folder of the chunks holds chunks and nothing else.
///
/// # Errors
/// As [`ChunkFolder::check`].
pub(super) fn check_all(run: &Path) -> Result<(), FileError> {
    let chunks = run.join(CHUNKS);
    let known = |name: &str| match name.split_once('/') {
        Some((chunk, below)) => is_chunk(chunk) && (below.is_empty() || is_ours(below)),
        None => false,
    };
    guarded::require_own(&chunks, &known)?;
    names_in(&chunks).try_for_each(|name| ChunkFolder(chunks.join(name)).check())
}

/// Removes the folders of chunks that belong to other plans. The caller has the run folder for
/// itself. Where anything else lies among them, all of them stay.
///
/// # Errors
/// As [`check_all`]; [`FileError::Remove`].
pub(super) fn remove_others(run: &Path, plan: &str) -> Result<(), FileError> {
    check_all(run)?;
    let chunks = run.join(CHUNKS);
    for name in names_in(&chunks) {
        let folder = ChunkFolder(chunks.join(name));
        if folder.status(plan).is_none() {
            folder.remove_whole()?;
        }
    }
    Ok(())
}
