//! The course of a training: its iterations, the pixels that are left out from a part of it on, and
//! its checkpoints.

use std::path::Path;

use ::train::{Surfel, SurfelCamera, Trainer, TrainingConfig, TrainingState, TrainingView};
use numeric::Progress;

use super::checkpoint::Checkpoint;
use super::error::TrainError;
use super::iterate::{Iterations, extent_m};
use super::report::LossPoint;
use super::results::CHECKPOINT;
use super::transients::find_transients;

/// Share of the training after which pixels that stay unexplained are left out.
const TRANSIENTS_AT: f64 = 0.4;

/// How a training runs.
pub(super) struct Course<'a> {
    /// Folder of the results.
    pub(super) output: &'a Path,
    /// Iterations between two checkpoints.
    pub(super) checkpoint_every: u32,
    /// Whether the training goes on from the checkpoint where there is one.
    pub(super) resume: bool,
    /// Whether pixels that stay unexplained while other views agree are left out.
    pub(super) transients: bool,
    /// Number of the first views that have pictures.
    pub(super) pictures: usize,
    /// The settings of the trainer.
    pub(super) settings: TrainingConfig,
}

/// What a training has learned.
pub(super) struct Trained {
    pub(super) state: TrainingState,
    /// Share of the pixels of each picture that were left out.
    pub(super) transient_share: Vec<f64>,
    pub(super) losses: Vec<LossPoint>,
    /// Seconds of the iterations of this run.
    pub(super) seconds: f64,
}

impl Course<'_> {
    /// Trains from `initial` or the checkpoint to the end. A training that is cancelled leaves a
    /// checkpoint.
    pub(super) fn run<C: SurfelCamera>(
        &self,
        initial: &[Surfel],
        mut views: Vec<TrainingView<C>>,
        progress: &dyn Progress,
    ) -> Result<Trained, TrainError> {
        let extent_m = extent_m(initial);
        let checkpoint = self.output.join(CHECKPOINT);
        let Checkpoint { mut state, left_out } = match self.resume && checkpoint.is_file() {
            true => Checkpoint::read(&checkpoint, &views, self.pictures)?,
            false => Checkpoint { state: TrainingState::new(initial.to_vec(), views.len()), left_out: Vec::new() },
        };
        let mut run = Iterations::new(self.settings.iterations, state.iteration, progress);
        let masks = if self.transients && left_out.is_empty() {
            let last = (TRANSIENTS_AT * f64::from(self.settings.iterations)) as u32;
            let mut trainer = Trainer::new(&views, extent_m, state, self.settings);
            run.until(&mut trainer, last, |state, stopped| self.keep(state, &[], stopped))?;
            state = trainer.into_state();
            find_transients(&state, &views[..self.pictures])
        } else {
            left_out
        };
        for (view, mask) in views.iter_mut().zip(&masks) {
            for plane in &mut view.colour {
                plane.iter_mut().zip(mask).filter(|(_, left_out)| **left_out).for_each(|(value, _)| *value = f32::NAN);
            }
        }
        let mut trainer = Trainer::new(&views, extent_m, state, self.settings);
        run.until(&mut trainer, u32::MAX, |state, stopped| self.keep(state, &masks, stopped))?;
        let state = trainer.into_state();
        // Writing the results may be stopped, too. They are made again from here.
        self.keep(&state, &masks, true)?;
        let (losses, seconds) = run.finish();
        let share = |number: usize| {
            masks
                .get(number)
                .map_or(0.0, |mask| mask.iter().filter(|left_out| **left_out).count() as f64 / mask.len().max(1) as f64)
        };
        Ok(Trained { state, transient_share: (0..self.pictures).map(share).collect(), losses, seconds })
    }

    /// Writes a checkpoint where one is due, or where the training stops.
    fn keep(&self, state: &TrainingState, left_out: &[Vec<bool>], stopped: bool) -> Result<(), TrainError> {
        let every = self.checkpoint_every.max(1);
        let is_due = state.iteration.is_multiple_of(every) && state.iteration < self.settings.iterations;
        if is_due || stopped { Ok(Checkpoint::write(&self.output.join(CHECKPOINT), state, left_out)?) } else { Ok(()) }
    }
}
