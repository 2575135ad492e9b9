//! The output folder: made in a hidden folder inside it, moved to its names when everything is written.
//!
//! The old report goes first and the new one comes last, so a folder with a report is complete. Files of others in the folder
//! (images, say) are left alone.

use std::fs;
use std::path::{Path, PathBuf};

use anyhow::{Context, bail};

/// What a dataset consists of, the report last.
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

/// Where a dataset is to go.
#[derive(Debug)]
pub(super) struct Folder {
    path: PathBuf,
}

/// Where a dataset is being made; what is not published is removed again.
#[derive(Debug)]
pub(super) struct Place {
    folder: PathBuf,
    partial: PathBuf,
    created: bool,
    published: bool,
}

impl Folder {
    /// Refuses early what would fail at the end.
    pub(super) fn new(path: &Path, overwrite: bool) -> anyhow::Result<Self> {
        if path.exists() && !path.is_dir() {
            bail!("the output is a file, expected a folder: {}", path.display());
        }
        let taken = ENTRIES.iter().chain(&REPORT).map(|name| path.join(name)).find(|p| p.symlink_metadata().is_ok());
        if let (Some(taken), false) = (taken, overwrite) {
            bail!("the output exists already: choose another folder or pass --overwrite: {}", taken.display());
        }
        Ok(Self { path: path.to_owned() })
    }

    /// Makes the hidden folder.
    pub(super) fn begin(&self) -> anyhow::Result<Place> {
        let failed = || format!("cannot make the output folder: {}", self.path.display());
        let created = !self.path.exists();
        let partial = self.path.join(PARTIAL);
        if partial.symlink_metadata().is_ok() {
            remove(&partial).with_context(failed)?;
        }
        let place = Place { folder: self.path.clone(), partial, created, published: false };
        fs::create_dir_all(&place.partial).with_context(failed)?;
        Ok(place)
    }
}

impl Place {
    /// The folder to write to.
    pub(super) fn path(&self) -> &Path {
        &self.partial
    }

    /// Moves everything to its name.
    pub(super) fn publish(mut self) -> anyhow::Result<()> {
        let (folder, partial) = (self.folder.clone(), self.partial.clone());
        let failed = |path: &Path| format!("cannot write to the output folder: {}", path.display());
        // Without its report the folder counts as incomplete from here on.
        for name in REPORT.iter().rev().chain(&ENTRIES) {
            let old = folder.join(name);
            if old.symlink_metadata().is_ok() {
                remove(&old).with_context(|| failed(&old))?;
            }
        }
        self.published = true;
        for name in ENTRIES.iter().chain(&REPORT) {
            let (from, to) = (partial.join(name), folder.join(name));
            if from.symlink_metadata().is_ok() {
                fs::rename(&from, &to).with_context(|| failed(&to))?;
            }
        }
        Ok(())
    }
}

impl Drop for Place {
    fn drop(&mut self) {
        // Best effort: the error that led here is the one to report.
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
