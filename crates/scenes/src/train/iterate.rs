//! Runs the iterations of a training, with its progress and the curve of its loss.

use std::time::Instant;

use ::train::{Surfel, SurfelCamera, Trainer, TrainingState, TrainingStep};
use numeric::Progress;

use super::error::TrainError;
use super::report::LossPoint;

/// Iterations of a point of the loss.
const LOSS_EVERY: u32 = 50;
/// Iterations between two losses that the watcher is told.
const TOLD_EVERY: u32 = 10;
/// Share of the newest loss in the one that is shown.
const NEWEST: f64 = 0.05;

/// The iterations of a training.
pub(super) struct Iterations<'a> {
    progress: &'a dyn Progress,
    shown: Option<f64>,
    points: Vec<LossPoint>,
    recent: Vec<TrainingStep>,
    begun: Instant,
}

impl<'a> Iterations<'a> {
    /// Begins the stage; `done` iterations were done before.
    pub(super) fn new(total: u32, done: u32, progress: &'a dyn Progress) -> Self {
        progress.begin("training", total as usize);
        (0..done).for_each(|_| progress.step());
        Self { progress, shown: None, points: Vec::new(), recent: Vec::new(), begun: Instant::now() }
    }

    /// Runs iterations until a number of them is done or the training is. `keep` is called after
    /// each one, and once more when the job is cancelled (with `true`).
    pub(super) fn until<C: SurfelCamera>(
        &mut self,
        trainer: &mut Trainer<'_, C>,
        last: u32,
        mut keep: impl FnMut(&TrainingState, bool) -> Result<(), TrainError>,
    ) -> Result<(), TrainError> {
        while !trainer.is_done() && trainer.state().iteration < last {
            if self.progress.is_cancelled() {
                keep(trainer.state(), true)?;
                self.progress.check_cancelled()?;
            }
            let step = trainer.step();
            let total = step.terms.total;
            self.shown = Some(self.shown.map_or(total, |shown| shown + NEWEST * (total - shown)));
            self.recent.push(step);
            let iteration = trainer.state().iteration;
            if iteration.is_multiple_of(LOSS_EVERY) || trainer.is_done() {
                self.points.push(loss_point(iteration, trainer.state().surfels.len(), &self.recent));
                self.recent.clear();
            }
            if iteration.is_multiple_of(TOLD_EVERY) {
                self.progress.part("training", Some(&format!("loss {:.4}", self.shown.unwrap_or(total))));
            }
            keep(trainer.state(), false)?;
            self.progress.step();
        }
        self.progress.part("training", None);
        Ok(())
    }

    /// Returns the curve of the loss, and the seconds since the beginning.
    pub(super) fn finish(self) -> (Vec<LossPoint>, f64) {
        (self.points, self.begun.elapsed().as_secs_f64())
    }
}

fn loss_point(iteration: u32, splats: usize, steps: &[TrainingStep]) -> LossPoint {
    let mean = |of: fn(&TrainingStep) -> f64| steps.iter().map(of).sum::<f64>() / steps.len().max(1) as f64;
    LossPoint {
        iteration,
        splats,
        total: mean(|s| s.terms.total),
        colour: mean(|s| s.terms.colour),
        prior_depth: mean(|s| s.terms.prior_depth),
        prior_normal: mean(|s| s.terms.prior_normal),
        correlation: mean(|s| s.terms.correlation),
    }
}

/// Returns the size of a scene: twice the 90th percentile of the distances from its middle.
pub(super) fn extent_m(surfels: &[Surfel]) -> f64 {
    let median = |axis: usize| {
        let mut values: Vec<f32> = surfels.iter().map(|s| s.position[axis]).collect();
        values.sort_unstable_by(f32::total_cmp);
        values[values.len() / 2]
    };
    let middle = [0, 1, 2].map(median);
    let distance = |s: &Surfel| (0..3).map(|i| (s.position[i] - middle[i]).powi(2)).sum::<f32>().sqrt();
    let mut distances: Vec<f32> = surfels.iter().map(distance).collect();
    distances.sort_unstable_by(f32::total_cmp);
    2.0 * f64::from(distances[distances.len() * 9 / 10]).max(1e-3)
}
