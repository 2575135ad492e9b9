//! Whether the inputs of a run stay the same files while they are read.
//!
//! A run reads its images again for every chunk. A file that is replaced meanwhile would give a
//! surface of two versions.

use std::fs::{self, Metadata};
use std::path::{Path, PathBuf};
use std::time::SystemTime;

use crate::dsm::config::DsmConfig;
use crate::dsm::error::DsmError;

/// The inputs of a run as they were at its start.
#[derive(Debug)]
pub(crate) struct InputStamps(Vec<(PathBuf, Stamp)>);

/// What changes when a file is written or replaced.
#[derive(Debug, PartialEq, Eq)]
struct Stamp {
    bytes: u64,
    modified: Option<SystemTime>,
    inode: u64,
}

impl InputStamps {
    /// Notes the files of a configuration, with the files beside the images that may hold their
    /// RPCs. Addresses have no stamp.
    pub(crate) fn of(config: &DsmConfig) -> Self {
        let beside = config.images.iter().filter(|path| path.is_file()).flat_map(|path| io::rpc::side_files(path));
        let given = config.images.iter().chain(config.side_inputs()).cloned();
        Self(given.chain(beside).filter_map(|path| stamp(&path).map(|stamp| (path, stamp))).collect())
    }

    /// Compares the files with what they were. A file that is gone cannot be mixed with another,
    /// and is an error where it is read again.
    ///
    /// # Errors
    /// [`DsmError::InputChanged`].
    pub(crate) fn check(&self) -> Result<(), DsmError> {
        let changed = self.0.iter().find(|(path, before)| stamp(path).is_some_and(|now| now != *before));
        changed.map_or(Ok(()), |(path, _)| Err(DsmError::InputChanged { path: path.clone() }))
    }
}

fn stamp(path: &Path) -> Option<Stamp> {
    let found = fs::metadata(path).ok()?;
    Some(Stamp { bytes: found.len(), modified: found.modified().ok(), inode: inode(&found) })
}

#[cfg(unix)]
fn inode(found: &Metadata) -> u64 {
    std::os::unix::fs::MetadataExt::ino(found)
}

#[cfg(not(unix))]
fn inode(_: &Metadata) -> u64 {
    0
}
