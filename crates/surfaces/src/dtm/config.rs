//! The configuration of a DTM.

use std::path::PathBuf;

use crs::VerticalDatum;
use serde::{Deserialize, Serialize};
use terrain::GroundConfig;

/// A terrain model of a surface model.
#[derive(Debug, Clone, PartialEq, Serialize, Deserialize)]
#[serde(deny_unknown_fields)]
#[non_exhaustive]
pub struct DtmConfig {
    /// Surface model on a map with square cells, or the folder of a DSM run.
    pub surface: PathBuf,
    /// Folder for the rasters and the report.
    pub output: PathBuf,
    /// Vertical datum of the surface model, where the file names none or a wrong one. The heights
    /// are not converted.
    #[serde(with = "job::as_text", default)]
    pub surface_vertical: Option<VerticalDatum>,
    /// Parameters of the search for the ground.
    #[serde(default)]
    pub terrain: GroundConfig,
    /// Worker threads. `None` uses all cores.
    #[serde(default)]
    pub threads: Option<usize>,
    /// Whether existing files may be replaced.
    #[serde(default)]
    pub overwrite: bool,
}

impl DtmConfig {
    /// A terrain model with the default parameters.
    pub fn new(surface: PathBuf, output: PathBuf) -> Self {
        let terrain = GroundConfig::default();
        Self { surface, output, surface_vertical: None, terrain, threads: None, overwrite: false }
    }

    /// Checks the settings that can be judged without opening a file.
    ///
    /// # Errors
    /// [`terrain::TerrainError::Parameter`] for a parameter outside of its range.
    pub fn validate(&self) -> Result<(), terrain::TerrainError> {
        self.terrain.validate()
    }
}
