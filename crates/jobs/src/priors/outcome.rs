//! What the priors job reports.

use report::{PriorsReport, SatellitePriorsReport};
use serde::{Serialize, Serializer};
use serde_json::Value;

/// What was made, and what of the model could not be used.
#[derive(Debug, Clone, Serialize)]
#[non_exhaustive]
pub struct PriorsJobReport {
    /// The report of the dataset or of the maps.
    pub product: PriorsProduct,
    /// Number of objects of the model that could not be used.
    pub unusable_objects: usize,
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
