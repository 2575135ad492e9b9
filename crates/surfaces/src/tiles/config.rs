//! The configuration of tiles.

use std::path::PathBuf;

use ortho::MosaicRule;
use serde::{Deserialize, Serialize};

use crate::heightmap::HeightMapConfig;
use job::corrections::CorrectionSource;
use job::error::JobError;

/// Tiles around cameras.
#[derive(Debug, Clone, PartialEq, Serialize, Deserialize)]
#[serde(deny_unknown_fields)]
#[non_exhaustive]
pub struct TilesConfig {
    /// The height maps: source, cameras, size, resolution. Its output is the folder of the tiles.
    pub maps: HeightMapConfig,
    /// Images with RPCs. Empty takes those of the run that made the surface model.
    pub images: Vec<PathBuf>,
    /// Where the pointing corrections of the images come from.
    pub corrections: CorrectionSource,
    /// How the values of several images become one.
    pub mosaic: MosaicRule,
}

impl TilesConfig {
    /// Tiles with the height maps of a configuration and the images of the run that made its
    /// surface model.
    pub fn new(maps: HeightMapConfig) -> Self {
        Self { maps, images: Vec::new(), corrections: CorrectionSource::default(), mosaic: MosaicRule::default() }
    }

    /// Checks the settings that can be judged without opening a file.
    ///
    /// # Errors
    /// [`JobError`] for a camera whose numbers are not finite.
    pub fn validate(&self) -> Result<(), JobError> {
        self.maps.validate()
    }
}
