//! What an alignment is made from.

use std::path::PathBuf;

use colmap::align::{AlignConfig, NoiseConfig};
use crs::VerticalDatum;
use formats::colmap::ColmapEncoding;
use job::error::JobError;
use serde::{Deserialize, Serialize};

use super::error::AlignJobError;

/// A COLMAP model to be moved to the world.
#[derive(Debug, Clone, PartialEq, Serialize, Deserialize)]
#[serde(deny_unknown_fields)]
#[non_exhaustive]
pub struct AlignJobConfig {
    /// Folder of a COLMAP model (text or binary).
    pub model: PathBuf,
    /// Table of known positions (CSV): of images by name, or of points of the model.
    pub positions: PathBuf,
    /// Folder to write: the moved model, `origin.json`, `similarity.json`, `align.json`.
    pub output: PathBuf,
    /// EPSG code of a projected CRS in metres; the UTM zone of the positions when `None`.
    pub crs_epsg: Option<u32>,
    /// Datum of the heights in `positions`.
    pub vertical: VerticalDatum,
    /// Largest residual of an inlier, metres; estimated from the residuals when `None`.
    pub threshold_m: Option<f64>,
    /// Whether the up direction of the cameras is up in the world where the positions do not
    /// determine the tilt.
    pub use_gravity: bool,
    /// Seed of the random triples.
    pub seed: u64,
    /// Encoding of the model that is written.
    pub encoding: ColmapEncoding,
    /// Noise under which the alignment is repeated; not repeated when `None`.
    pub noise: Option<NoiseConfig>,
    /// Folder for the models aligned under noise, one per level and seed; needs `noise`.
    pub noise_output: Option<PathBuf>,
    /// Whether existing files may be replaced.
    pub overwrite: bool,
}

impl AlignJobConfig {
    /// An alignment in the UTM zone of the positions, with ellipsoidal heights and without noise.
    pub fn new(model: PathBuf, positions: PathBuf, output: PathBuf) -> Self {
        Self {
            model,
            positions,
            output,
            crs_epsg: None,
            vertical: VerticalDatum::Ellipsoid,
            threshold_m: None,
            use_gravity: true,
            seed: AlignConfig::default().seed,
            encoding: ColmapEncoding::Binary,
            noise: None,
            noise_output: None,
            overwrite: false,
        }
    }

    /// Checks the numbers.
    ///
    /// # Errors
    /// [`JobError`] for a threshold or a level of noise outside of its range.
    pub fn validate(&self) -> Result<(), JobError> {
        if let Some(threshold_m) = self.threshold_m.filter(|threshold_m| threshold_m.is_nan() || *threshold_m <= 0.0) {
            return Err(AlignJobError::Threshold { threshold_m }.into());
        }
        let noise = self.noise.iter();
        let mut levels = noise.flat_map(|noise| noise.translation_m.iter().chain(&noise.rotation_deg));
        match levels.find(|level| !(**level >= 0.0 && level.is_finite())) {
            Some(level) => Err(AlignJobError::NoiseLevel { level: *level }.into()),
            None => Ok(()),
        }
    }
}
