//! The settings of a training.

use priors::{Ramp, Schedule};

/// Iterations of a published training, which schedules are written for.
const PUBLISHED_ITERATIONS: u32 = 30_000;

/// What a training is for: each use has the settings of the paper that it comes from.
#[derive(Debug, Clone, Copy, PartialEq, Eq, Default)]
pub enum Recipe {
    /// Photographs of a scene without bounds: 2DGS, with the weights of its published code.
    #[default]
    Photographs,
    /// Nothing but buildings, with their priors and masks (GS4Buildings).
    BuildingOnly,
    /// Whole scenes, with the priors of the buildings in them (GS4Buildings).
    BuildingEnhanced,
    /// Satellite images, with the heights of a surface model.
    Satellite,
}

/// Weights of the terms of the loss. Those of colours are per difference of 1 of colours from 0 to
/// 1, those of lengths are relative to the size of the scene, the others have no unit.
#[derive(Debug, Clone, Copy, PartialEq)]
#[non_exhaustive]
pub struct LossWeights {
    /// Absolute difference of colours.
    pub absolute: f64,
    /// Squared difference of colours.
    pub squared: f64,
    /// One less the structural similarity (D-SSIM).
    pub similarity: f64,
    /// Squared difference between coverage and mask, where a view has a mask.
    pub mask: f64,
    /// Spread of the inverse depths of a ray, times the squared size of the scene. For affine
    /// cameras that of the depths, over the squared size of the scene.
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
    /// Squared difference of the gain of a view from 1 and of its offset from 0, where they are
    /// learned: the mean over the channels. It keeps the colours of the scene those that the images
    /// have in the mean. A tenth lets a gain be off by a third before it pulls as hard as colours
    /// that are all too dark.
    pub exposure: f64,
}

impl Default for LossWeights {
    fn default() -> Self {
        Self::of(Recipe::default())
    }
}

impl LossWeights {
    /// Returns the weights of a recipe.
    ///
    /// Photographs have those of the code of 2DGS: 0.8 of the absolute difference and 0.2 of
    /// D-SSIM, 0.05 of the normals, and no distortion, which 2DGS has for bounded scenes only.
    /// There its 1,000 in normalised device coordinates with a near plane of 0.2, for scenes of a
    /// size of about 2, is 10 here; scenes that also have surroundings get the tenth that 2DGS
    /// gives them.
    pub fn of(recipe: Recipe) -> Self {
        let photographs = Self {
            absolute: 0.8,
            squared: 0.0,
            similarity: 0.2,
            mask: 0.5,
            distortion: 0.0,
            consistency: 0.05,
            prior_depth: 5.0,
            prior_normal: 0.1,
            correlation: 4.0,
            exposure: 0.1,
        };
        // GS4Buildings and SkySplat compare colours without D-SSIM.
        let without = Self { squared: 0.2, similarity: 0.0, distortion: 10.0, ..photographs };
        match recipe {
            Recipe::Photographs => photographs,
            Recipe::BuildingOnly => without,
            // Their colours are brought to those of the splats before the training.
            Recipe::Satellite => Self { exposure: 0.0, ..without },
            Recipe::BuildingEnhanced => Self { distortion: 1.0, ..without },
        }
    }
}

/// When the terms without priors begin, as factors of their weights.
#[derive(Debug, Clone, Copy, PartialEq)]
#[non_exhaustive]
pub struct Regularisation {
    /// Factor of the distortion, written for 30,000 iterations.
    pub distortion: Ramp,
    /// Factor of the consistency of normals, likewise.
    pub consistency: Ramp,
}

impl Default for Regularisation {
    /// Returns that of the code of 2DGS: the distortion after a tenth of the training, the normals
    /// after 7,000 of 30,000 iterations.
    fn default() -> Self {
        let begun = |at: u32| Ramp { from_iteration: at, to_iteration: at, from_factor: 0.0, to_factor: 1.0 };
        Self { distortion: begun(3000), consistency: begun(7000) }
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
    /// Step of colours at the first and at the last iteration. It ends with that of the published
    /// code of 2DGS (0.0025 of the constant harmonic), so that the exposure of the last images does
    /// not count more than that of the others; trainings of a few thousand iterations need larger
    /// ones to begin with.
    pub colour: [f64; 2],
    /// Step of the harmonics of colours at the first and at the last iteration. It ends with that
    /// of the published codes (0.0025 / 20), and begins as much higher as that of colours does.
    pub harmonics: [f64; 2],
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
            colour: [5e-3, 7e-4],
            harmonics: [9e-4, 1.25e-4],
            view: 2e-3,
            depth_scale: 1e-4,
        }
    }
}

/// Colours that depend on the direction of view, by spherical harmonics.
#[derive(Debug, Clone, Copy, PartialEq, Eq)]
#[non_exhaustive]
pub struct HarmonicsConfig {
    /// Highest degree, 0 to 3. Colours are the same from all sides when 0.
    pub degree: u8,
    /// Iterations after which the degree grows by one, until it is the highest, written for 30,000
    /// iterations and stretched to the number of the training. The value is that of 3DGS.
    pub raise_every: u32,
}

impl Default for HarmonicsConfig {
    fn default() -> Self {
        Self { degree: 0, raise_every: 1000 }
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
    /// Iterations between two times at which opacities are brought down, while surfels are split;
    /// never when 0. It is no share of the training, because opacities need that many steps to
    /// come back.
    pub reset_every: u32,
    /// Greatest opacity after that.
    pub reset_opacity: f64,
}

impl Default for DensifyConfig {
    fn default() -> Self {
        Self {
            budget: 200_000,
            during: [0.1, 0.6],
            every: 100,
            gradient: 2e-4,
            least_opacity: 0.05,
            reset_every: 3000,
            reset_opacity: 0.01,
        }
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
    /// Colours that depend on the direction of view.
    pub harmonics: HarmonicsConfig,
    /// How surfels are added and removed; never when `None`.
    pub densify: Option<DensifyConfig>,
    /// Factors of the priors, written for 30,000 iterations and stretched to the number of this
    /// training.
    pub schedule: Schedule,
    /// When the terms without priors begin, stretched likewise.
    pub regularisation: Regularisation,
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
            harmonics: HarmonicsConfig::default(),
            densify: Some(DensifyConfig::default()),
            schedule: Schedule::default(),
            regularisation: Regularisation::default(),
            appearance: false,
        }
    }
}

/// Returns a factor that changes over the second half of a training.
fn second_half(from_factor: f64, to_factor: f64) -> Ramp {
    Ramp { from_iteration: PUBLISHED_ITERATIONS / 2, to_iteration: PUBLISHED_ITERATIONS, from_factor, to_factor }
}

impl TrainingConfig {
    /// Returns the settings of a recipe.
    ///
    /// Buildings are learned in two phases, as GS4Buildings prints them: priors count in full in
    /// the first half, for completeness; in the second they fall to a tenth, while the distortion
    /// and the consistency of normals grow, for detail.
    pub fn of(recipe: Recipe) -> Self {
        let weights = LossWeights::of(recipe);
        // Only photographs of one exposure gain by steps that fall. The exposures of satellite
        // images have to be followed until the end, and short trainings of buildings too.
        let rates = LearningRates { colour: [LearningRates::default().colour[0]; 2], ..LearningRates::default() };
        match recipe {
            Recipe::Photographs => Self { weights, ..Self::default() },
            Recipe::Satellite => Self { weights, rates, ..Self::default() },
            Recipe::BuildingOnly | Recipe::BuildingEnhanced => {
                let (falls, grows) = (second_half(1.0, 0.1), second_half(0.0, 1.0));
                let schedule = Schedule { depth: falls, normal: falls };
                let regularisation = Regularisation { distortion: grows, consistency: grows };
                Self { weights, rates, schedule, regularisation, ..Self::default() }
            }
        }
    }

    /// Lets the terms without priors begin after other shares of the training, where they are
    /// given.
    pub fn regularise_from(&mut self, distortion: Option<f64>, consistency: Option<f64>) {
        let begun = |share: f64| {
            let at = (share * f64::from(PUBLISHED_ITERATIONS)) as u32;
            Ramp { from_iteration: at, to_iteration: at, from_factor: 0.0, to_factor: 1.0 }
        };
        let Regularisation { distortion: d, consistency: c } = self.regularisation;
        self.regularisation =
            Regularisation { distortion: distortion.map_or(d, begun), consistency: consistency.map_or(c, begun) };
    }

    /// Returns the weights at an iteration.
    pub fn weights_at(&self, iteration: u32) -> LossWeights {
        let published = self.published(iteration);
        LossWeights {
            distortion: self.weights.distortion * self.regularisation.distortion.at(published),
            consistency: self.weights.consistency * self.regularisation.consistency.at(published),
            prior_depth: self.weights.prior_depth * self.schedule.depth.at(published),
            prior_normal: self.weights.prior_normal * self.schedule.normal.at(published),
            ..self.weights
        }
    }

    /// Lets the degree of the harmonics grow after other shares of the training.
    pub fn raise_degree_every(&mut self, share: f64) {
        self.harmonics.raise_every = (share * f64::from(PUBLISHED_ITERATIONS)) as u32;
    }

    /// Returns the degree of the harmonics at an iteration.
    pub fn degree_at(&self, iteration: u32) -> u8 {
        let published = self.published(iteration);
        // Intervals of no length have all passed.
        let raised = published.checked_div(self.harmonics.raise_every).unwrap_or(u32::MAX);
        u8::try_from(raised).unwrap_or(u8::MAX).min(self.harmonics.degree)
    }

    /// Returns the iteration of a published training at the same share of it.
    fn published(&self, iteration: u32) -> u32 {
        let place = f64::from(iteration) / f64::from(self.iterations.max(1));
        (place * f64::from(PUBLISHED_ITERATIONS)) as u32
    }

    /// Returns the step of positions at an iteration, relative to the size of the scene.
    pub(crate) fn position_rate(&self, iteration: u32) -> f64 {
        self.between(self.rates.position, iteration)
    }

    /// Returns the step of colours at an iteration.
    pub(crate) fn colour_rate(&self, iteration: u32) -> f64 {
        self.between(self.rates.colour, iteration)
    }

    /// Returns the step of harmonics at an iteration.
    pub(crate) fn harmonics_rate(&self, iteration: u32) -> f64 {
        self.between(self.rates.harmonics, iteration)
    }

    /// Returns a step that changes by a factor in each iteration. A step of 0 stays 0.
    fn between(&self, [first, last]: [f64; 2], iteration: u32) -> f64 {
        let place = f64::from(iteration) / f64::from(self.iterations.max(1));
        if first > 0.0 { first * (last / first).powf(place) } else { 0.0 }
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
        assert_eq!([700, 701].map(|at| config.weights_at(at).consistency), [0.0, 0.05]);
        let building = TrainingConfig::of(Recipe::BuildingOnly);
        let [depth, distortion] = [|w: LossWeights| w.prior_depth, |w: LossWeights| w.distortion];
        let share = |of: fn(LossWeights) -> f64, at| of(building.weights_at(at)) / of(building.weights);
        assert_eq!([0, 1500, 3000].map(|at| share(depth, at)), [1.0, 1.0, 0.1]);
        assert_eq!([0, 1500, 2250, 3000].map(|at| share(distortion, at)), [0.0, 0.0, 0.5, 1.0]);
        let degrees = |degree: u8| HarmonicsConfig { degree, ..HarmonicsConfig::default() };
        let mut config = TrainingConfig { harmonics: degrees(3), ..config };
        assert_eq!([0, 99, 100, 200, 300, 3000].map(|at| config.degree_at(at)), [0, 0, 1, 2, 3, 3]);
        config.raise_degree_every(0.0);
        assert_eq!(config.degree_at(0), 3);
        assert_eq!(TrainingConfig { harmonics: degrees(0), ..config }.degree_at(3000), 0);
        assert!((config.position_rate(3000) - config.rates.position[1]).abs() < 1e-12);
        assert!((config.colour_rate(0) - 5e-3).abs() < 1e-12 && (config.colour_rate(3000) - 7e-4).abs() < 1e-12);
    }
}
