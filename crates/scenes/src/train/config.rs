//! The configuration of a training.

use std::path::PathBuf;

use serde::{Deserialize, Serialize};

use super::recipe::{TrainNumbers, TrainPreset, TrainSchedule, TrainSteps, TrainWeights};
use job::error::SettingError;

/// Iterations between two checkpoints, if nothing else is asked for.
pub const CHECKPOINT_EVERY: u32 = 500;

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

/// Where the factors of the priors by iteration come from.
#[derive(Debug, Clone, Copy, PartialEq, Eq, Serialize, Deserialize)]
#[serde(rename_all = "kebab-case")]
pub enum PriorSchedule {
    /// The preset: two phases for buildings.
    Preset,
    /// `schedule.json` of the dataset, where there is one, or else the preset.
    Dataset,
}

/// A training of splats on a dataset.
#[derive(Debug, Clone, PartialEq, Serialize, Deserialize)]
#[serde(deny_unknown_fields)]
#[non_exhaustive]
pub struct TrainConfig {
    /// Dataset of the priors job, or another folder with a COLMAP model in it or in a folder below,
    /// such as `sparse/0`.
    pub dataset: PathBuf,
    /// Another COLMAP model of the same cameras, whose points are added to those of the dataset,
    /// such as the reconstruction that the cameras come from.
    pub more_points: Option<PathBuf>,
    /// Folder of the images; when `None`, `images` of the dataset or the folder in or beside it
    /// that has the images of the model.
    pub images: Option<PathBuf>,
    /// Folder of a mask for each image, `NAME.jpg.png` or `NAME.png`: pixels that are 0 there count
    /// neither in the training nor in the judgement.
    pub masks: Option<PathBuf>,
    /// Folder for the results.
    pub output: PathBuf,
    /// Number of iterations; each draws one view.
    pub iterations: u32,
    /// Greatest number of splats. The training begins with at most half of them.
    pub budget: usize,
    /// Pixels of an image that become one, in each direction.
    pub shrink: usize,
    /// Every view of this number in the order of their names, from the first on, is kept for the
    /// judgement and not trained on (LLFF); none when 0.
    pub hold_out: usize,
    /// Names of the views that are kept instead, where there are any.
    pub hold_out_names: Vec<String>,
    /// What the training is for; what the dataset says when `None`: buildings where the priors job
    /// wrote it, or else photographs.
    pub preset: Option<TrainPreset>,
    /// Weights of the loss that differ from those of the preset.
    pub weights: TrainWeights,
    /// Steps of the optimiser that differ from those of the preset.
    pub steps: TrainSteps,
    /// Where the factors of the priors by iteration come from.
    pub prior_schedule: PriorSchedule,
    /// Times of the training that differ from those of the preset.
    pub schedule: TrainSchedule,
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
            masks: None,
            output,
            iterations: 3000,
            budget: 100_000,
            shrink: 1,
            hold_out: 8,
            hold_out_names: Vec::new(),
            preset: None,
            weights: TrainWeights::default(),
            steps: TrainSteps::default(),
            prior_schedule: PriorSchedule::Dataset,
            schedule: TrainSchedule::default(),
            priors: TrainPriors::Both,
            appearance: false,
            transients: false,
            seed: 1,
            checkpoint_every: CHECKPOINT_EVERY,
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
        self.weights.validate()?;
        self.steps.validate()?;
        self.schedule.check()
    }
}
