//! How much the priors weigh in a training, iteration by iteration.
//!
//! The values are those of the released code of GS4Buildings: the depth prior comes in between
//! iterations 5,000 and 7,000, the normal prior fades to a tenth between 7,000 and 9,000; depths of
//! a view are compared after the ratio of their medians, α = median(prior) / median(rendered), has
//! been applied to the rendered ones.

use serde::{Deserialize, Serialize};

/// A factor that goes from one value to another.
#[derive(Debug, Clone, Copy, PartialEq, Serialize, Deserialize)]
#[serde(deny_unknown_fields)]
pub struct Ramp {
    /// Iteration at which it begins to change.
    pub from_iteration: u32,
    /// Iteration from which it stays.
    pub to_iteration: u32,
    /// Factor up to the first.
    pub from_factor: f64,
    /// Factor from the second.
    pub to_factor: f64,
}

/// Factors of the loss terms, to be multiplied with the trainer's own weights.
#[derive(Debug, Clone, Copy, PartialEq, Serialize, Deserialize)]
#[serde(deny_unknown_fields)]
pub struct Schedule {
    /// Of the depth prior.
    pub depth: Ramp,
    /// Of the normal prior.
    pub normal: Ramp,
}

impl Ramp {
    /// The factor at an iteration, linear between the two.
    pub fn at(&self, iteration: u32) -> f64 {
        if iteration <= self.from_iteration {
            return self.from_factor;
        }
        if iteration >= self.to_iteration {
            return self.to_factor;
        }
        let part = f64::from(iteration - self.from_iteration) / f64::from(self.to_iteration - self.from_iteration);
        self.from_factor + part * (self.to_factor - self.from_factor)
    }
}

impl Default for Schedule {
    /// The published one.
    fn default() -> Self {
        Self {
            depth: Ramp { from_iteration: 5_000, to_iteration: 7_000, from_factor: 0.0, to_factor: 1.0 },
            normal: Ramp { from_iteration: 7_000, to_iteration: 9_000, from_factor: 1.0, to_factor: 0.1 },
        }
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn ramps_are_linear_and_hold_their_ends() {
        let schedule = Schedule::default();
        assert_eq!([0, 5_000, 6_000, 7_000, 30_000].map(|i| schedule.depth.at(i)), [0.0, 0.0, 0.5, 1.0, 1.0]);
        assert_eq!([0, 7_000, 9_000, u32::MAX].map(|i| schedule.normal.at(i)), [1.0, 1.0, 0.1, 0.1]);
        let step = Ramp { from_iteration: 5, to_iteration: 5, from_factor: 0.0, to_factor: 1.0 };
        assert_eq!([5, 6].map(|i| step.at(i)), [0.0, 1.0]);
    }
}
