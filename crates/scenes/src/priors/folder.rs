//! The output folder: made in a hidden folder inside it, moved to its names when everything is
//! written.
//!
//! The old report is removed first and the new one is moved last, so a folder with a report is
//! complete. Other files in the folder are left alone, also `images` of a run that wrote none.
//! Files inside its folders that no earlier run made are refused before the work.

use std::path::Path;

use tempfile::TempDir;

use super::config::{PriorsConfig, PriorsImages};
use super::error::PriorsJobError;
use super::images;
use super::made::{Made, NOTE};
use job::files::FileError;
use job::output_folder::OutputFolder;

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

/// The folder that a dataset goes to, with the hidden folder in which it is made. That one is
/// removed again unless it is published.
#[derive(Debug)]
pub(super) struct PriorsFolder {
    // Dropped first, so that an empty output folder can be removed after it.
    work: TempDir,
    folder: OutputFolder,
    entries: Vec<&'static str>,
    made: Made,
}

impl PriorsFolder {
    /// Takes the folder for this run, and refuses early what would fail at the end.
    pub(super) fn take(config: &PriorsConfig) -> Result<Self, PriorsJobError> {
        let path = &config.output;
        if path.exists() && !path.is_dir() {
            return Err(PriorsJobError::OutputIsFile { path: path.to_owned() });
        }
        let folder = OutputFolder::take(path)?;
        let images = (config.images != PriorsImages::None).then_some(images::FOLDER);
        let entries: Vec<_> = ENTRIES.into_iter().chain(images).collect();
        let taken = entries.iter().chain(&REPORT).map(|name| path.join(name)).find(|p| p.symlink_metadata().is_ok());
        match taken {
            Some(path) if !config.overwrite => Err(FileError::Exists { path }.into()),
            _ => {
                let made = Made::of(path);
                for name in &entries {
                    made.check(&folder, name)?;
                }
                Ok(Self { work: folder.work_folder()?, folder, entries, made })
            }
        }
    }

    /// The folder to write to.
    pub(super) fn path(&self) -> &Path {
        self.work.path()
    }

    /// Moves everything to its name.
    pub(super) fn publish(self) -> Result<(), PriorsJobError> {
        // Without its report the folder counts as incomplete from here on.
        for name in &self.entries {
            self.made.check(&self.folder, name)?;
        }
        self.made.note(&self.folder, self.path())?;
        for name in REPORT.iter().rev() {
            self.folder.remove(name)?;
        }
        for name in &self.entries {
            self.made.remove(&self.folder, name)?;
        }
        for name in self.entries.iter().chain(&REPORT) {
            if self.path().join(name).symlink_metadata().is_ok() {
                self.folder.publish(self.path(), name)?;
            }
        }
        Ok(self.folder.remove(NOTE)?)
    }
}
