//! The recipe of a training: a preset for each use, and numbers that differ from it.

use ::train::{LossWeights, Recipe, TrainingConfig};
use gaussian::SplatHarmonics;
use serde::{Deserialize, Serialize};

use job::error::SettingError;

/// What a training is for.
#[derive(Debug, Clone, Copy, PartialEq, Eq, Serialize, Deserialize)]
#[serde(rename_all = "kebab-case")]
pub enum TrainPreset {
    /// Photographs of a scene without bounds, as the published code of 2DGS.
    Photographs,
    /// Nothing but buildings, with their priors and masks, as GS4Buildings.
    BuildingOnly,
    /// Whole scenes with the priors of their buildings, as GS4Buildings.
    BuildingEnhanced,
    /// Satellite images with the heights of a surface model.
    Satellite,
}

impl TrainPreset {
    fn recipe(self) -> Recipe {
        match self {
            Self::Photographs => Recipe::Photographs,
            Self::BuildingOnly => Recipe::BuildingOnly,
            Self::BuildingEnhanced => Recipe::BuildingEnhanced,
            Self::Satellite => Recipe::Satellite,
        }
    }
}

/// Weights of the terms of the loss; those of the preset where they are `None`.
#[derive(Debug, Clone, Copy, PartialEq, Default, Serialize, Deserialize)]
#[serde(deny_unknown_fields, default)]
#[non_exhaustive]
pub struct TrainWeights {
    /// Absolute difference of colours from 0 to 1.
    pub absolute: Option<f64>,
    /// Squared difference of colours from 0 to 1.
    pub squared: Option<f64>,
    /// One less the structural similarity (D-SSIM).
    pub similarity: Option<f64>,
    /// Squared difference between coverage and mask, where there are masks.
    pub mask: Option<f64>,
    /// Spread of the inverse depths of a ray, times the squared size of the scene; for satellite
    /// images that of the depths, over the squared size of the scene.
    pub distortion: Option<f64>,
    /// One less the cosine between the normals of splats and of drawn depths.
    pub consistency: Option<f64>,
    /// Difference from prior depths, over the size of the scene.
    pub prior_depth: Option<f64>,
    /// One less the cosine between the normals of splats and of the prior.
    pub prior_normal: Option<f64>,
    /// One less the correlation with heights of unknown scale.
    pub correlation: Option<f64>,
    /// Squared difference of the gains of images from 1 and of their offsets from 0.
    pub exposure: Option<f64>,
}

/// Steps of the optimiser; those of the preset where they are `None`.
#[derive(Debug, Clone, Copy, PartialEq, Default, Serialize, Deserialize)]
#[serde(deny_unknown_fields, default)]
#[non_exhaustive]
pub struct TrainSteps {
    /// Of positions at the first iteration, sizes of the scene.
    pub position_first: Option<f64>,
    /// Of positions at the last iteration, sizes of the scene.
    pub position_last: Option<f64>,
    /// Of quaternions.
    pub rotation: Option<f64>,
    /// Of the natural logarithms of scales.
    pub scale: Option<f64>,
    /// Of the logits of opacities.
    pub opacity: Option<f64>,
    /// Of colours from 0 to 1 at the first iteration.
    pub colour_first: Option<f64>,
    /// Of colours from 0 to 1 at the last iteration.
    pub colour_last: Option<f64>,
    /// Of the harmonics of colours at the first iteration.
    pub harmonics_first: Option<f64>,
    /// Of the harmonics of colours at the last iteration.
    pub harmonics_last: Option<f64>,
}

/// When things happen in a training; as in the preset where it is `None`.
#[derive(Debug, Clone, Copy, PartialEq, Default, Serialize, Deserialize)]
#[serde(deny_unknown_fields, default)]
#[non_exhaustive]
pub struct TrainSchedule {
    /// Share of the training after which the distortion counts in full.
    pub distortion_from: Option<f64>,
    /// Share of the training after which the consistency of normals counts in full.
    pub consistency_from: Option<f64>,
    /// Share of the training from which on splats are split.
    pub split_from: Option<f64>,
    /// Share of the training after which splats are split no more.
    pub split_until: Option<f64>,
    /// Iterations between two rounds of splitting and removing.
    pub split_every: Option<f64>,
    /// Gradient by the position in the image, in halves of the image, above which a splat is split.
    pub split_gradient: Option<f64>,
    /// Opacity below which a splat is removed.
    pub least_opacity: Option<f64>,
    /// Iterations between two times at which opacities are brought down; never when 0.
    pub reset_every: Option<f64>,
    /// Highest degree of the harmonics of colours, 0 to 3; the same colour from all sides when 0.
    pub degree: Option<f64>,
    /// Share of the training after which the degree grows by one, until it is the highest.
    pub degree_every: Option<f64>,
}

/// A number by its name, where it is given.
type Given<'a> = (&'static str, &'a mut Option<f64>);

/// Names of numbers that may be given.
pub trait TrainNumbers {
    /// Returns all numbers by their names.
    fn numbers(&mut self) -> Vec<(&'static str, &mut Option<f64>)>;

    /// Sets a number by its name.
    ///
    /// # Errors
    /// [`SettingError`] for a name that is none.
    fn set(&mut self, name: &str, value: f64) -> Result<(), SettingError> {
        let mut numbers = self.numbers();
        let names: Vec<&str> = numbers.iter().map(|(name, _)| *name).collect();
        let expected = format!("one of: {}", names.join(", "));
        let found = numbers.iter_mut().find(|(known, _)| *known == name);
        let (_, number) = found.ok_or_else(|| SettingError::new("the name of a number", name, expected))?;
        **number = Some(value);
        Ok(())
    }

    /// Checks that all numbers are finite and not negative.
    ///
    /// # Errors
    /// [`SettingError`] for a number outside of its range.
    fn validate(mut self) -> Result<(), SettingError>
    where
        Self: Sized,
    {
        for (name, number) in self.numbers() {
            let found = number.unwrap_or(0.0);
            if !(found.is_finite() && found >= 0.0) {
                return Err(SettingError::new(name, found, "a finite number of 0 or more"));
            }
        }
        Ok(())
    }
}

impl TrainNumbers for TrainWeights {
    fn numbers(&mut self) -> Vec<Given<'_>> {
        vec![
            ("absolute", &mut self.absolute),
            ("squared", &mut self.squared),
            ("similarity", &mut self.similarity),
            ("mask", &mut self.mask),
            ("distortion", &mut self.distortion),
            ("consistency", &mut self.consistency),
            ("prior-depth", &mut self.prior_depth),
            ("prior-normal", &mut self.prior_normal),
            ("correlation", &mut self.correlation),
            ("exposure", &mut self.exposure),
        ]
    }
}

impl TrainNumbers for TrainSteps {
    fn numbers(&mut self) -> Vec<Given<'_>> {
        vec![
            ("position-first", &mut self.position_first),
            ("position-last", &mut self.position_last),
            ("rotation", &mut self.rotation),
            ("scale", &mut self.scale),
            ("opacity", &mut self.opacity),
            ("colour-first", &mut self.colour_first),
            ("colour-last", &mut self.colour_last),
            ("harmonics-first", &mut self.harmonics_first),
            ("harmonics-last", &mut self.harmonics_last),
        ]
    }
}

impl TrainNumbers for TrainSchedule {
    fn numbers(&mut self) -> Vec<Given<'_>> {
        vec![
            ("distortion-from", &mut self.distortion_from),
            ("consistency-from", &mut self.consistency_from),
            ("split-from", &mut self.split_from),
            ("split-until", &mut self.split_until),
            ("split-every", &mut self.split_every),
            ("split-gradient", &mut self.split_gradient),
            ("least-opacity", &mut self.least_opacity),
            ("reset-every", &mut self.reset_every),
            ("degree", &mut self.degree),
            ("degree-every", &mut self.degree_every),
        ]
    }
}

impl TrainSchedule {
    /// Checks the highest degree of the harmonics, and the other numbers.
    ///
    /// # Errors
    /// [`SettingError`] for a number outside of its range.
    pub fn check(self) -> Result<(), SettingError> {
        let degree = self.degree.unwrap_or(0.0);
        if !(0..=SplatHarmonics::DEGREE_MAX).map(f64::from).any(|known| known == degree) {
            return Err(SettingError::new("the degree of the harmonics", degree, "0, 1, 2 or 3"));
        }
        self.validate()
    }
}

/// Returns the settings of the trainer of a preset, with the numbers that are given.
pub(super) fn settings(
    preset: TrainPreset,
    weights: &TrainWeights,
    steps: &TrainSteps,
    schedule: &TrainSchedule,
) -> TrainingConfig {
    let mut made = TrainingConfig::of(preset.recipe());
    let put = |to: &mut f64, given: Option<f64>| *to = given.unwrap_or(*to);
    let w = &mut made.weights;
    put(&mut w.absolute, weights.absolute);
    put(&mut w.squared, weights.squared);
    put(&mut w.similarity, weights.similarity);
    put(&mut w.mask, weights.mask);
    put(&mut w.distortion, weights.distortion);
    put(&mut w.consistency, weights.consistency);
    put(&mut w.prior_depth, weights.prior_depth);
    put(&mut w.prior_normal, weights.prior_normal);
    put(&mut w.correlation, weights.correlation);
    put(&mut w.exposure, weights.exposure);
    let r = &mut made.rates;
    put(&mut r.position[0], steps.position_first);
    put(&mut r.position[1], steps.position_last);
    put(&mut r.rotation, steps.rotation);
    put(&mut r.scale, steps.scale);
    put(&mut r.opacity, steps.opacity);
    put(&mut r.colour[0], steps.colour_first);
    put(&mut r.colour[1], steps.colour_last);
    put(&mut r.harmonics[0], steps.harmonics_first);
    put(&mut r.harmonics[1], steps.harmonics_last);
    made.harmonics.degree = schedule.degree.map_or(made.harmonics.degree, |degree| degree as u8);
    if let Some(share) = schedule.degree_every {
        made.raise_degree_every(share);
    }
    made.regularise_from(schedule.distortion_from, schedule.consistency_from);
    if let Some(densify) = &mut made.densify {
        put(&mut densify.during[0], schedule.split_from);
        put(&mut densify.during[1], schedule.split_until);
        put(&mut densify.gradient, schedule.split_gradient);
        put(&mut densify.least_opacity, schedule.least_opacity);
        densify.every = schedule.split_every.map_or(densify.every, |every| every as u32);
        densify.reset_every = schedule.reset_every.map_or(densify.reset_every, |every| every as u32);
    }
    made
}

/// Returns the weights that a training used, for its report.
pub(super) fn used(weights: &LossWeights) -> TrainWeights {
    TrainWeights {
        absolute: Some(weights.absolute),
        squared: Some(weights.squared),
        similarity: Some(weights.similarity),
        mask: Some(weights.mask),
        distortion: Some(weights.distortion),
        consistency: Some(weights.consistency),
        prior_depth: Some(weights.prior_depth),
        prior_normal: Some(weights.prior_normal),
        correlation: Some(weights.correlation),
        exposure: Some(weights.exposure),
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn numbers_are_those_of_the_preset_unless_given() {
        let (steps, schedule) = (TrainSteps::default(), TrainSchedule::default());
        let plain = settings(TrainPreset::Photographs, &TrainWeights::default(), &steps, &schedule);
        assert_eq!((plain, plain.weights.distortion), (TrainingConfig::default(), 0.0));
        let mut weights = TrainWeights::default();
        weights.set("prior-depth", 7.0).unwrap();
        let mut schedule = TrainSchedule::default();
        schedule.set("reset-every", 50.0).unwrap();
        schedule.set("consistency-from", 0.5).unwrap();
        let made = settings(TrainPreset::BuildingOnly, &weights, &steps, &schedule);
        assert_eq!((made.weights.prior_depth, made.densify.unwrap().reset_every), (7.0, 50));
        let consistency = |at: u32| made.weights_at(at).consistency;
        assert_eq!([1500, 1501].map(consistency), [0.0, made.weights.consistency]);
        assert_eq!(used(&made.weights).prior_depth, Some(7.0));
        schedule.set("degree", 3.0).unwrap();
        schedule.set("degree-every", 0.1).unwrap();
        let made = settings(TrainPreset::Satellite, &weights, &TrainSteps::default(), &schedule);
        assert_eq!([299, 300, 899, 900, 3000].map(|at| made.degree_at(at)), [0, 1, 2, 3, 3]);
        for degree in [0.5, 4.0, f64::NAN] {
            schedule.set("degree", degree).unwrap();
            assert!(schedule.check().unwrap_err().to_string().contains("0, 1, 2 or 3"));
        }
        schedule.set("degree", 2.0).unwrap();
        let error = weights.set("depth", 1.0).unwrap_err().to_string();
        assert!(error.contains("the name of a number is depth") && error.contains("prior-normal"), "{error}");
        weights.set("mask", f64::NAN).unwrap();
        assert!(TrainNumbers::validate(weights).is_err() && TrainNumbers::validate(schedule).is_ok());
    }
}
