//! The settings of a training.

use priors::{Ramp, Schedule};

/// Iterations of a published training, which schedules are written for.
const PUBLISHED_ITERATIONS: u32 = 30_000;

/// Weights of the terms of the loss.
///
/// The defaults are those of 2DGS and GS4Buildings where these publish one.
#[derive(Debug, Clone, Copy, PartialEq)]
#[non_exhaustive]
pub struct LossWeights {
    /// Share of absolute differences in the colour term; the rest is squared differences.
    pub absolute: f64,
    /// Squared difference between coverage and mask, where a view has a mask.
    pub mask: f64,
    /// Spread of the depths of a ray, relative to the squared size of the scene.
    pub distortion: f64,
    /// Difference between the normals of the splats and the normals of the drawn depths.
    pub consistency: f64,
    /// Difference from the prior depths, relative to the size of the scene.
    pub prior_depth: f64,
    /// Difference from the prior normals.
    pub prior_normal: f64,
    /// One less the correlation with depths of unknown scale. Chosen on a simulated town of 60 m
    /// (1, 4 and 16).
    pub correlation: f64,
}

impl Default for LossWeights {
    fn default() -> Self {
        Self {
            absolute: 0.8,
            mask: 0.5,
            distortion: 10.0,
            consistency: 0.05,
            prior_depth: 5.0,
            prior_normal: 0.1,
            correlation: 4.0,
        }
    }
}

/// Steps of the optimiser (Adam).
#[derive(Debug, Clone, Copy, PartialEq)]
#[non_exhaustive]
pub struct LearningRates {
    /// Step of positions at the first and at the last iteration, relative to the size of the scene.
    pub position: [f64; 2],
    /// Step of quaternions.
    pub rotation: f64,
    /// Step of the logarithms of scales.
    pub scale: f64,
    /// Step of the logits of opacities.
    pub opacity: f64,
    /// Step of colours.
    pub colour: f64,
    /// Step of each image's gain and offset.
    pub view: f64,
    /// Step of the depth scale. It has to be slow, or it follows the splats instead of the prior.
    pub depth_scale: f64,
}

impl Default for LearningRates {
    fn default() -> Self {
        Self {
            position: [3e-4, 3e-6],
            rotation: 2e-3,
            scale: 8e-3,
            opacity: 4e-2,
            colour: 5e-3,
            view: 2e-3,
            depth_scale: 1e-4,
        }
    }
}

/// How surfels are added and removed.
#[derive(Debug, Clone, Copy, PartialEq)]
#[non_exhaustive]
pub struct DensifyConfig {
    /// Greatest number of surfels.
    pub budget: usize,
    /// Share of the training during which surfels are split: from, to. They are removed until the
    /// end.
    pub during: [f64; 2],
    /// Iterations between two rounds.
    pub every: u32,
    /// Mean gradient by the position in the image, in halves of the image's width, above which a
    /// surfel is split. The value is that of 3DGS.
    pub gradient: f64,
    /// Opacity below which a surfel is removed. The value is that of 2DGS.
    pub least_opacity: f64,
}

impl Default for DensifyConfig {
    fn default() -> Self {
        Self { budget: 200_000, during: [0.1, 0.6], every: 100, gradient: 2e-4, least_opacity: 0.05 }
    }
}

/// The settings of a training.
#[derive(Debug, Clone, Copy, PartialEq)]
#[non_exhaustive]
pub struct TrainingConfig {
    /// Number of iterations; each draws one view.
    pub iterations: u32,
    /// Seed of the order of the views.
    pub seed: u64,
    /// Weights of the loss.
    pub weights: LossWeights,
    /// Steps of the optimiser.
    pub rates: LearningRates,
    /// How surfels are added and removed; never when `None`.
    pub densify: Option<DensifyConfig>,
    /// Factors of the priors, written for 30,000 iterations and stretched to the number of this
    /// training.
    pub schedule: Schedule,
    /// Whether each image has a gain and an offset of its own, as dates and exposures differ.
    pub appearance: bool,
}

impl Default for TrainingConfig {
    fn default() -> Self {
        Self {
            iterations: 3000,
            seed: 1,
            weights: LossWeights::default(),
            rates: LearningRates::default(),
            densify: Some(DensifyConfig::default()),
            schedule: Schedule::default(),
            appearance: false,
        }
    }
}

impl TrainingConfig {
    /// Returns the weights at an iteration.
    ///
    /// The two terms without priors begin as in 2DGS: the spread of depths after a tenth of the
    /// training, the normals after a quarter.
    pub fn weights_at(&self, iteration: u32) -> LossWeights {
        let place = f64::from(iteration) / f64::from(self.iterations.max(1));
        let published = (place * f64::from(PUBLISHED_ITERATIONS)) as u32;
        let begun = |at: u32| Ramp { from_iteration: at, to_iteration: 2 * at, from_factor: 0.0, to_factor: 1.0 };
        LossWeights {
            distortion: self.weights.distortion * begun(3000).at(published),
            consistency: self.weights.consistency * begun(7000).at(published),
            prior_depth: self.weights.prior_depth * self.schedule.depth.at(published),
            prior_normal: self.weights.prior_normal * self.schedule.normal.at(published),
            ..self.weights
        }
    }

    /// Returns the step of positions at an iteration, relative to the size of the scene.
    pub(crate) fn position_rate(&self, iteration: u32) -> f64 {
        let [first, last] = self.rates.position;
        let place = f64::from(iteration) / f64::from(self.iterations.max(1));
        first * (last / first).powf(place)
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn schedules_are_stretched() {
        let config = TrainingConfig { iterations: 3000, ..TrainingConfig::default() };
        let depth = |iteration| config.weights_at(iteration).prior_depth / config.weights.prior_depth;
        assert_eq!([depth(0), depth(600), depth(700), depth(3000)], [0.0, 0.5, 1.0, 1.0]);
        let normal = |iteration| config.weights_at(iteration).prior_normal / config.weights.prior_normal;
        assert!((normal(700) - 1.0).abs() < 1e-12 && (normal(900) - 0.1).abs() < 1e-12);
        assert_eq!(config.weights_at(200).distortion, 0.0);
        assert!((config.position_rate(3000) - config.rates.position[1]).abs() < 1e-12);
    }
}
