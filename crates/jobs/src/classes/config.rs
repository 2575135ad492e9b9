//! The configuration of a class raster.

use std::path::PathBuf;

use classes::ClassifyConfig;
use serde::{Deserialize, Serialize};
use terrain::GroundConfig;

use super::error::ClassesError;

/// Classes of a surface model.
#[derive(Debug, Clone, PartialEq, Serialize, Deserialize)]
#[serde(deny_unknown_fields)]
#[non_exhaustive]
pub struct ClassesConfig {
    /// Surface model on a projected map, or the folder of a DSM run.
    pub surface: PathBuf,
    /// Folder for the rasters and the report.
    pub output: PathBuf,
    /// Vegetation index (NDVI, −1 to 1) on any grid, which overrules the roughness.
    #[serde(default)]
    pub vegetation_index: Option<PathBuf>,
    /// Building index (0 to 1) on any grid, which decides where the heights are weak.
    #[serde(default)]
    pub building_index: Option<PathBuf>,
    /// Parameters of the search for the ground.
    #[serde(default)]
    pub terrain: GroundConfig,
    /// Parameters of the classes.
    #[serde(default)]
    pub classes: ClassifyConfig,
    /// Worker threads. `None` uses all cores.
    #[serde(default)]
    pub threads: Option<usize>,
    /// Whether existing files may be replaced.
    #[serde(default)]
    pub overwrite: bool,
}

impl ClassesConfig {
    /// Classes with the default parameters.
    pub fn new(surface: PathBuf, output: PathBuf) -> Self {
        Self {
            surface,
            output,
            vegetation_index: None,
            building_index: None,
            terrain: GroundConfig::default(),
            classes: ClassifyConfig::default(),
            threads: None,
            overwrite: false,
        }
    }

    /// Checks the settings that can be judged without opening a file.
    ///
    /// # Errors
    /// [`ClassesError::Terrain`] and [`ClassesError::Classify`] for parameters outside of their
    /// range.
    pub fn validate(&self) -> Result<(), ClassesError> {
        self.terrain.validate()?;
        Ok(self.classes.validate()?)
    }
}
