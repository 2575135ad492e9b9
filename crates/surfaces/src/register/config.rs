//! What a registration is made from.

use std::path::PathBuf;

use crs::VerticalDatum;
use serde::{Deserialize, Serialize};

use job::corrections::CorrectionSource;
use job::error::{JobError, SettingError};

/// Farthest search, pixels. Providers state errors of up to tens of pixels.
const REACH_MAX_PX: f64 = 200.0;

/// The model that an image is registered to.
#[derive(Debug, Clone, PartialEq, Serialize, Deserialize)]
#[serde(rename_all = "snake_case")]
pub enum RegisterModel {
    /// A surface model, or the folder of a DSM run, with images of it.
    Surface {
        /// Surface model in a projected CRS in metres, or the folder of a DSM run.
        dsm: PathBuf,
        /// Images whose pointing is known; those of the run when empty.
        images: Vec<PathBuf>,
    },
    /// Splats with their origin beside them.
    Splats(PathBuf),
}

/// What is corrected.
#[derive(Debug, Clone, Copy, PartialEq, Eq, Default, Serialize, Deserialize)]
#[serde(rename_all = "snake_case")]
pub enum RegisterOrder {
    /// The least order that predicts points which it was not made from as well as any.
    #[default]
    Evidence,
    /// One shift of the whole image.
    Shift,
    /// A shift that grows with the line.
    Drift,
    /// An affine map in image space.
    Affine,
}

/// An image to be registered.
#[derive(Debug, Clone, PartialEq, Serialize, Deserialize)]
#[serde(deny_unknown_fields)]
#[non_exhaustive]
pub struct RegisterConfig {
    /// Image with an RPC.
    pub image: PathBuf,
    /// What it is registered to.
    pub model: RegisterModel,
    /// Report to write (JSON), which holds the correction.
    pub output: PathBuf,
    /// Source of the pointing corrections of the model's images.
    pub corrections: CorrectionSource,
    /// Vertical datum of the surface model; the one that the file states when `None`.
    pub vertical: Option<VerticalDatum>,
    /// Largest error of the pointing that is searched for, pixels of the image.
    pub reach_px: f64,
    /// What is corrected.
    pub order: RegisterOrder,
    /// Worker threads; one per core when `None`.
    pub threads: Option<usize>,
    /// Whether an existing report may be replaced.
    pub overwrite: bool,
}

impl RegisterConfig {
    /// A shift of at most 20 pixels, with a drift or an affine map where there is evidence of it.
    pub fn new(image: PathBuf, model: RegisterModel, output: PathBuf) -> Self {
        Self {
            image,
            model,
            output,
            corrections: CorrectionSource::default(),
            vertical: None,
            reach_px: 20.0,
            order: RegisterOrder::Evidence,
            threads: None,
            overwrite: false,
        }
    }

    /// Checks the numbers.
    ///
    /// # Errors
    /// [`JobError`] for a reach outside of its range.
    pub fn validate(&self) -> Result<(), JobError> {
        if (1.0..=REACH_MAX_PX).contains(&self.reach_px) {
            return Ok(());
        }
        let expected = format!("1 to {REACH_MAX_PX} pixels");
        Err(SettingError::new("the reach of the search", self.reach_px, expected).into())
    }
}
