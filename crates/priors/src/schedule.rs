//! Weights of the priors during a training, by iteration.
//!
//! The values are from the released code of GS4Buildings. The weight of the depth prior grows
//! between iterations 5,000 and 7,000. The weight of the normal prior falls to a tenth between
//! iterations 7,000 and 9,000. The rendered depths of a view are multiplied by α = median(prior) /
//! median(rendered) before they are compared.

use serde::{Deserialize, Serialize};

/// A factor that changes linearly from one value to another.
#[derive(Debug, Clone, Copy, PartialEq, Serialize, Deserialize)]
#[serde(deny_unknown_fields)]
pub struct Ramp {
    /// Iteration at which the change begins.
    pub from_iteration: u32,
    /// Iteration at which the change ends.
    pub to_iteration: u32,
    /// Factor before the change.
    pub from_factor: f64,
    /// Factor after the change.
    pub to_factor: f64,
}

/// Factors of the loss terms, to be multiplied with the weights of the trainer.
#[derive(Debug, Clone, Copy, PartialEq, Serialize, Deserialize)]
#[serde(deny_unknown_fields)]
pub struct Schedule {
    /// Factor of the depth prior.
    pub depth: Ramp,
    /// Factor of the normal prior.
    pub normal: Ramp,
}

impl Ramp {
    /// Returns the factor at an iteration.
    ///
    /// # Examples
    /// ```
    /// let schedule = priors::Schedule::default();
    /// assert_eq!(schedule.depth.at(6_000), 0.5);
    /// ```
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
    /// Returns the published schedule.
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
