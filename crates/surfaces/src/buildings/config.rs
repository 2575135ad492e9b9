//! The configuration of a building index.

use std::path::PathBuf;

use buildings::BuildingIndexConfig;
use crs::VerticalDatum;
use serde::{Deserialize, Serialize};

use super::error::BuildingMapError;
use job::corrections::CorrectionSource;
use job::error::{JobError, SettingError};

/// A building index of one image.
#[derive(Debug, Clone, PartialEq, Serialize, Deserialize)]
#[serde(deny_unknown_fields)]
#[non_exhaustive]
pub struct BuildingMapConfig {
    /// The image.
    pub image: PathBuf,
    /// GeoTIFF to write; the report is written beside it.
    pub output: PathBuf,
    /// Surface model on a map, or the folder of a DSM run, on which the index is laid.
    /// `None` leaves it in the pixels of the image.
    #[serde(default)]
    pub surface: Option<PathBuf>,
    /// Vertical datum of the surface model, where the file names none or a wrong one.
    #[serde(with = "job::as_text", default)]
    pub surface_vertical: Option<VerticalDatum>,
    /// Where the pointing correction of the image comes from, on a surface model.
    #[serde(default)]
    pub corrections: CorrectionSource,
    /// Ground sampling distance of the image, metres. `None` takes that of its RPC or its map.
    #[serde(default)]
    pub gsd_m: Option<f64>,
    /// Parameters of the index.
    #[serde(default)]
    pub index: BuildingIndexConfig,
    /// Worker threads. `None` uses all cores.
    #[serde(default)]
    pub threads: Option<usize>,
    /// Whether existing files may be replaced.
    #[serde(default)]
    pub overwrite: bool,
}

impl BuildingMapConfig {
    /// An index in the pixels of an image, with the default parameters.
    pub fn new(image: PathBuf, output: PathBuf) -> Self {
        Self {
            image,
            output,
            surface: None,
            surface_vertical: None,
            corrections: CorrectionSource::default(),
            gsd_m: None,
            index: BuildingIndexConfig::default(),
            threads: None,
            overwrite: false,
        }
    }

    /// Checks the settings that can be judged without opening a file.
    ///
    /// # Errors
    /// [`JobError`] for a number outside of its range.
    pub fn validate(&self) -> Result<(), JobError> {
        if let Some(gsd) = self.gsd_m.filter(|gsd| !(*gsd > 0.0 && gsd.is_finite())) {
            let expected = "a positive number of metres";
            return Err(SettingError::new("the ground sampling distance", gsd, expected).into());
        }
        Ok(self.index.validate().map_err(BuildingMapError::from)?)
    }

    /// Returns the file of the report.
    pub(super) fn report(&self) -> PathBuf {
        let stem = self.output.file_stem().unwrap_or_default().to_string_lossy();
        self.output.with_file_name(format!("{stem}_report.json"))
    }
}
