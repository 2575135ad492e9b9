//! The configuration of a class raster.

use std::path::PathBuf;

use classes::ClassifyConfig;
use formats::raster::BandChoice;
use serde::{Deserialize, Serialize};
use terrain::GroundConfig;

use super::error::ClassesError;
use job::corrections::CorrectionSource;
use job::error::{JobError, SettingError};

/// Classes of a surface model.
#[derive(Debug, Clone, PartialEq, Serialize, Deserialize)]
#[serde(deny_unknown_fields)]
#[non_exhaustive]
pub struct ClassesConfig {
    /// Surface model on a map with square cells, or the folder of a DSM run.
    pub surface: PathBuf,
    /// Folder for the rasters and the report.
    pub output: PathBuf,
    /// Vegetation index (NDVI, −1 to 1) on any grid, which overrules the roughness.
    #[serde(default)]
    pub vegetation_index: Option<PathBuf>,
    /// Multispectral images with RPCs, of which the vegetation index is made.
    #[serde(default)]
    pub multispectral: Vec<PathBuf>,
    /// Red band of the multispectral images. `None` takes the one that the file names.
    #[serde(default)]
    pub red_band: Option<BandChoice>,
    /// Near-infrared band of the multispectral images. `None` takes the one that the file names.
    #[serde(default)]
    pub nir_band: Option<BandChoice>,
    /// Where the pointing corrections of the multispectral images come from.
    #[serde(default)]
    pub corrections: CorrectionSource,
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
            multispectral: Vec::new(),
            red_band: None,
            nir_band: None,
            corrections: CorrectionSource::default(),
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
    /// [`JobError`] for parameters outside of their range, and for both a vegetation index and
    /// images to make one of.
    pub fn validate(&self) -> Result<(), JobError> {
        if self.vegetation_index.is_some() && !self.multispectral.is_empty() {
            let expected = "either a vegetation index or multispectral images";
            return Err(SettingError::new("the source of the vegetation index", "given twice", expected).into());
        }
        self.terrain.validate().map_err(ClassesError::from)?;
        Ok(self.classes.validate().map_err(ClassesError::from)?)
    }
}
