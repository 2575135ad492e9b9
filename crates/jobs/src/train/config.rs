//! The configuration of a training.

use std::path::PathBuf;

use serde::{Deserialize, Serialize};

use crate::error::SettingError;

/// Prior maps that a training uses.
#[derive(Debug, Clone, Copy, PartialEq, Eq, Serialize, Deserialize)]
#[serde(rename_all = "kebab-case")]
pub enum TrainPriors {
    /// Depths and normals.
    Both,
    /// Depths alone.
    Depth,
    /// Normals alone.
    Normal,
    /// None: the images alone.
    None,
}

/// A training of splats on a dataset.
#[derive(Debug, Clone, PartialEq, Serialize, Deserialize)]
#[serde(deny_unknown_fields)]
#[non_exhaustive]
pub struct TrainConfig {
    /// Dataset of the priors job, or another folder with a COLMAP model in `sparse/0`.
    pub dataset: PathBuf,
    /// Another COLMAP model of the same cameras, whose points are added to those of the dataset,
    /// such as the reconstruction that the cameras come from.
    pub more_points: Option<PathBuf>,
    /// Folder of the images; `images` of the dataset when `None`.
    pub images: Option<PathBuf>,
    /// Folder for the results.
    pub output: PathBuf,
    /// Number of iterations; each draws one view.
    pub iterations: u32,
    /// Greatest number of splats. The training begins with at most half of them.
    pub budget: usize,
    /// Pixels of an image that become one, in each direction.
    pub shrink: usize,
    /// Every view of this number is kept for the judgement and not trained on; none when 0.
    pub hold_out: usize,
    /// Prior maps in use, as far as the dataset has them.
    pub priors: TrainPriors,
    /// Whether each image has a gain and an offset of its own.
    pub appearance: bool,
    /// Whether pixels that stay unexplained while other views agree are left out, such as vehicles.
    pub transients: bool,
    /// Seed of everything random.
    pub seed: u64,
    /// Iterations between two checkpoints.
    pub checkpoint_every: u32,
    /// Whether a training that was stopped goes on.
    pub resume: bool,
    /// Worker threads; one per core when `None`.
    pub threads: Option<usize>,
    /// Whether earlier results may be replaced.
    pub overwrite: bool,
}

impl TrainConfig {
    /// A training with the default settings.
    pub fn new(dataset: PathBuf, output: PathBuf) -> Self {
        Self {
            dataset,
            more_points: None,
            images: None,
            output,
            iterations: 3000,
            budget: 100_000,
            shrink: 1,
            hold_out: 8,
            priors: TrainPriors::Both,
            appearance: false,
            transients: false,
            seed: 1,
            checkpoint_every: 500,
            resume: false,
            threads: None,
            overwrite: false,
        }
    }

    /// Checks the settings that can be judged without opening a file.
    ///
    /// # Errors
    /// [`SettingError`] for a number outside of its range.
    pub fn validate(&self) -> Result<(), SettingError> {
        if self.budget < 2 || self.budget > 20_000_000 {
            return Err(SettingError::new("the budget of splats", self.budget, "2 to 20,000,000"));
        }
        if self.iterations == 0 {
            return Err(SettingError::new("the number of iterations", self.iterations, "1 or more"));
        }
        if !(1..=64).contains(&self.shrink) {
            return Err(SettingError::new("the factor that images shrink by", self.shrink, "1 to 64"));
        }
        if self.hold_out == 1 {
            return Err(SettingError::new("the number of the view to keep", self.hold_out, "0 for none, or 2 or more"));
        }
        Ok(())
    }
}
