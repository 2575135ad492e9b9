//! The output folder: made in a hidden folder inside it, moved to its names when everything is
//! written.
//!
//! The old report is removed first and the new one is moved last, so a folder with a report is
//! complete. Other files in the folder (images, for example) are left alone.

use std::fs;
use std::path::{Path, PathBuf};

use super::error::PriorsJobError;
use crate::files::FileError;

/// Entries of a dataset; the report is moved after them.
const ENTRIES: [&str; 20] = [
    "sparse",
    "points3D.ply",
    "raw_depth",
    "raw_normal",
    "raw_mask",
    "masks",
    "class",
    "object",
    "depth_png",
    "geotiff",
    "height",
    "distance",
    "normal",
    "mask",
    "previews",
    "splats",
    "labels.json",
    "schedule.json",
    "origin.json",
    "crops.json",
];
const REPORT: [&str; 2] = ["report.html", "report.json"];
const PARTIAL: &str = ".skysweep-partial";

/// The folder that a dataset goes to.
#[derive(Debug)]
pub(super) struct OutputFolder {
    path: PathBuf,
}

/// The hidden folder in which a dataset is made. It is removed again unless it is published.
#[derive(Debug)]
pub(super) struct PartialFolder {
    folder: PathBuf,
    partial: PathBuf,
    created: bool,
    published: bool,
}

impl OutputFolder {
    /// Refuses early what would fail at the end.
    pub(super) fn new(path: &Path, overwrite: bool) -> Result<Self, PriorsJobError> {
        if path.exists() && !path.is_dir() {
            return Err(PriorsJobError::OutputIsFile { path: path.to_owned() });
        }
        let taken = ENTRIES.iter().chain(&REPORT).map(|name| path.join(name)).find(|p| p.symlink_metadata().is_ok());
        match taken {
            Some(path) if !overwrite => Err(FileError::Exists { path }.into()),
            _ => Ok(Self { path: path.to_owned() }),
        }
    }

    /// Makes the hidden folder.
    pub(super) fn begin(&self) -> Result<PartialFolder, PriorsJobError> {
        let failed = |source| PriorsJobError::OutputFolder { path: self.path.clone(), source };
        let created = !self.path.exists();
        let partial = self.path.join(PARTIAL);
        if partial.symlink_metadata().is_ok() {
            remove(&partial).map_err(failed)?;
        }
        let folder = PartialFolder { folder: self.path.clone(), partial, created, published: false };
        fs::create_dir_all(&folder.partial).map_err(failed)?;
        Ok(folder)
    }
}

impl PartialFolder {
    /// The folder to write to.
    pub(super) fn path(&self) -> &Path {
        &self.partial
    }

    /// Moves everything to its name.
    pub(super) fn publish(mut self) -> Result<(), PriorsJobError> {
        let (folder, partial) = (self.folder.clone(), self.partial.clone());
        let failed = |path: &Path, source| PriorsJobError::OutputFolder { path: path.to_owned(), source };
        // Without its report the folder counts as incomplete from here on.
        for name in REPORT.iter().rev().chain(&ENTRIES) {
            let old = folder.join(name);
            if old.symlink_metadata().is_ok() {
                remove(&old).map_err(|source| failed(&old, source))?;
            }
        }
        self.published = true;
        for name in ENTRIES.iter().chain(&REPORT) {
            let (from, to) = (partial.join(name), folder.join(name));
            if from.symlink_metadata().is_ok() {
                fs::rename(&from, &to).map_err(|source| failed(&to, source))?;
            }
        }
        Ok(())
    }
}

impl Drop for PartialFolder {
    fn drop(&mut self) {
        // Errors are ignored: the error that led here is the one to report.
        let _ = fs::remove_dir_all(&self.partial);
        if self.created && !self.published {
            let _ = fs::remove_dir(&self.folder);
        }
    }
}

fn remove(path: &Path) -> std::io::Result<()> {
    let is_folder = path.symlink_metadata()?.is_dir();
    if is_folder { fs::remove_dir_all(path) } else { fs::remove_file(path) }
}
