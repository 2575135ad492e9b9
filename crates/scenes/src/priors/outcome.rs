//! What the priors job reports.

use std::path::PathBuf;

use report::{PriorsReport, SatellitePriorsReport, SatelliteRow, counted};
use serde::{Serialize, Serializer};
use serde_json::Value;

use super::size::in_words;

/// What was made, and what of the model could not be used.
#[derive(Debug, Clone, Serialize)]
#[non_exhaustive]
pub struct PriorsJobReport {
    /// The report of the dataset or of the maps.
    pub product: PriorsProduct,
    /// Number of objects of the model that could not be used.
    pub unusable_objects: usize,
    /// Folder of the files.
    pub output: PathBuf,
    /// Size of all files, bytes.
    pub bytes: u64,
}

/// Priors of one kind of cameras.
#[derive(Debug, Clone)]
#[non_exhaustive]
pub enum PriorsProduct {
    /// A dataset for perspective cameras.
    Dataset(Box<PriorsReport>),
    /// Maps for satellite images.
    SatelliteMaps(Box<SatellitePriorsReport>),
}

impl PriorsJobReport {
    /// Whether all objects of the model were used and, in a dataset, some point is seen.
    pub fn is_whole(&self) -> bool {
        let is_empty = matches!(&self.product, PriorsProduct::Dataset(made) if made.kept == 0);
        !is_empty && self.unusable_objects == 0
    }
}

impl PriorsJobReport {
    /// Returns the report as text, which ends in a line break.
    pub fn text(&self) -> String {
        let size = in_words(usize::try_from(self.bytes).unwrap_or(usize::MAX));
        let written = format!(
            "written    {} ({size})\nreport     {}\n",
            self.output.display(),
            self.output.join("report.html").display()
        );
        match &self.product {
            PriorsProduct::Dataset(made) => {
                let (kept, all, least) = (made.kept, made.samples, made.min_views);
                let views = counted(made.views.len(), "view");
                let train: String = made.commands.iter().map(|line| format!("train      {line}\n")).collect();
                format!("points     {kept} of {all} are seen by {least} or more of {views}\n{written}{train}")
            }
            PriorsProduct::SatelliteMaps(made) => {
                let line = |row: &SatelliteRow| {
                    format!("image      {}: {} pixels see a building\n", row.image, row.hit_pixels)
                };
                made.images.iter().map(line).collect::<String>() + &written
            }
        }
    }
}

impl PriorsProduct {
    /// Returns the report as it is written to `report.json`.
    ///
    /// # Errors
    /// None in practice: the reports have text keys only.
    pub fn json(&self) -> Result<Value, serde_json::Error> {
        match self {
            Self::Dataset(report) => report.json(),
            Self::SatelliteMaps(report) => report.json(),
        }
    }
}

impl Serialize for PriorsProduct {
    fn serialize<S: Serializer>(&self, serializer: S) -> Result<S::Ok, S::Error> {
        self.json().map_err(serde::ser::Error::custom)?.serialize(serializer)
    }
}
