//! Seasons: how the scene and the sharpness of the images differ from date to date.
//!
//! The first date is as it would be without seasons. On each other date, the albedo of ground,
//! trees and roofs is multiplied by a factor of the date, and by a factor of the place: patches of
//! ground, single trees, single roofs. Factors are exp(uniform(−spread, spread)). A share of the
//! variance of the fine texture is replaced by a texture of the date (litter, grass, leaves, dirt,
//! moisture). Walls keep their look. The modulation transfer of the optics is multiplied by such a
//! factor, too.

use serde::{Deserialize, Serialize};

use crate::random::{derived, lattice};
use crate::surface::noise::{detail, value_noise};
use numeric::SplitMix64;

/// Spread of the factor of a place, relative to the spread of the factor of the date.
const PLACE_SHARE: f64 = 0.6;
/// Width of the patches of ground cover that change together, metres.
const PATCH_M: f64 = 28.0;
/// Exponent of the ground's factor for carriageways and paving, which change less than lawns.
const PAVED: f64 = 0.4;
/// Range of the modulation transfer at the Nyquist frequency.
const MTF: [f64; 2] = [0.05, 0.6];

/// What changes between dates. All zero, which is the default, changes nothing.
#[derive(Debug, Clone, Copy, PartialEq, Default, Serialize, Deserialize)]
#[serde(deny_unknown_fields, default)]
pub struct SeasonsConfig {
    /// Largest change of the albedo of ground cover, as a natural logarithm.
    pub ground_spread: f64,
    /// Largest change of the albedo of trees, as a natural logarithm.
    pub tree_spread: f64,
    /// Largest change of the albedo of roofs, as a natural logarithm.
    pub roof_spread: f64,
    /// Share of the variance of the fine texture that each date has of its own, 0 to 1.
    pub texture_share: f64,
    /// Largest change of the modulation transfer at the Nyquist frequency, as a natural logarithm.
    pub sharpness_spread: f64,
}

impl SeasonsConfig {
    /// Seasons as in images of one place over a year: lawns and trees change by up to a half, roofs
    /// by a fifth, two fifths of the fine texture are new, and images are sharper or softer.
    pub const YEAR: Self =
        Self { ground_spread: 0.45, tree_spread: 0.5, roof_spread: 0.2, texture_share: 0.4, sharpness_spread: 0.5 };

    /// Returns whether nothing changes.
    pub(crate) fn is_none(&self) -> bool {
        *self == Self::default()
    }
}

/// The season of a date.
#[derive(Debug, Clone, Copy, PartialEq, Serialize, Deserialize)]
pub struct Season {
    /// Factor on the albedo of ground cover.
    pub ground: f64,
    /// Factor on the albedo of trees.
    pub trees: f64,
    /// Factor on the albedo of roofs.
    pub roofs: f64,
    /// Modulation transfer of the optics at the Nyquist frequency.
    pub mtf_at_nyquist: f64,
}

impl Season {
    /// Draws the season of a date, `None` for the first one and where nothing changes.
    pub(crate) fn of_date(config: &SeasonsConfig, seed: u64, index: usize, mtf_at_nyquist: f64) -> Option<Self> {
        if index == 0 || config.is_none() {
            return None;
        }
        let mut stream = SplitMix64::new(derived(seed, 6000 + index as u64));
        let mut factor = |spread: f64| stream.uniform_in(-spread, spread).exp();
        let (ground, trees, roofs) =
            (factor(config.ground_spread), factor(config.tree_spread), factor(config.roof_spread));
        let mtf_at_nyquist = (mtf_at_nyquist * factor(config.sharpness_spread)).clamp(MTF[0], MTF[1]);
        Some(Self { ground, trees, roofs, mtf_at_nyquist })
    }
}

/// The look of the surface on a date.
#[derive(Debug, Clone, Copy)]
pub(crate) struct SeasonLook {
    season: Season,
    config: SeasonsConfig,
    seed: u64,
}

impl SeasonLook {
    /// Makes the look of a date, `None` without a season.
    pub(crate) fn new(config: &SeasonsConfig, seed: u64, index: usize, season: Option<Season>) -> Option<Self> {
        season.map(|season| Self { season, config: *config, seed: derived(seed, 6500 + index as u64) })
    }

    /// Returns the factor on the albedo of ground cover at a position.
    pub(crate) fn ground(&self, x: f64, y: f64) -> f64 {
        let patch = PLACE_SHARE * self.config.ground_spread * value_noise(self.seed, PATCH_M, x, y);
        self.season.ground * patch.exp()
    }

    /// Returns the factor on the albedo of carriageways and paving.
    pub(crate) fn paved(&self) -> f64 {
        self.season.ground.powf(PAVED)
    }

    /// Returns the factor on the albedo of the tree with a paint.
    pub(crate) fn tree(&self, paint: u64) -> f64 {
        self.season.trees * self.of_place(paint, self.config.tree_spread)
    }

    /// Returns the factor on the albedo of the roof with a paint.
    pub(crate) fn roof(&self, paint: u64) -> f64 {
        self.season.roofs * self.of_place(paint, self.config.roof_spread)
    }

    fn of_place(&self, paint: u64, spread: f64) -> f64 {
        (PLACE_SHARE * spread * (2.0 * lattice(paint ^ self.seed, 11, 0) - 1.0)).exp()
    }

    /// Returns the fine texture of the date: the permanent one and one of its own, mixed so that
    /// the variance stays the same.
    pub(crate) fn grain(&self, permanent: f64, seed: u64, x: f64, y: f64) -> f64 {
        let own = detail(seed ^ self.seed, x, y);
        (1.0 - self.config.texture_share).sqrt() * permanent + self.config.texture_share.sqrt() * own
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn the_first_date_and_a_scene_without_seasons_have_none() {
        assert_eq!(Season::of_date(&SeasonsConfig::YEAR, 1, 0, 0.2), None);
        assert_eq!(Season::of_date(&SeasonsConfig::default(), 1, 3, 0.2), None);
    }

    #[test]
    fn factors_keep_their_spread_and_differ_between_dates() {
        let year = SeasonsConfig::YEAR;
        let seasons: Vec<Season> = (1..200).map(|k| Season::of_date(&year, 7, k, 0.2).unwrap()).collect();
        let within = |of: fn(&Season) -> f64, spread: f64| {
            let logs: Vec<f64> = seasons.iter().map(|season| of(season).ln()).collect();
            assert!(logs.iter().all(|log| log.abs() <= spread));
            assert!(logs.iter().any(|log| *log > 0.8 * spread) && logs.iter().any(|log| *log < -0.8 * spread));
        };
        within(|s| s.ground, year.ground_spread);
        within(|s| s.trees, year.tree_spread);
        within(|s| s.roofs, year.roof_spread);
        within(|s| s.mtf_at_nyquist / 0.2, year.sharpness_spread);
    }

    #[test]
    fn the_texture_of_a_date_has_the_variance_of_the_permanent_one() {
        let season = Season::of_date(&SeasonsConfig::YEAR, 7, 1, 0.2);
        let look = SeasonLook::new(&SeasonsConfig::YEAR, 7, 1, season).unwrap();
        let at = |k: i32| (f64::from(k % 200) * 0.7, f64::from(k / 200) * 0.7);
        let permanent: Vec<f64> = (0..40_000).map(|k| detail(3, at(k).0, at(k).1)).collect();
        let own: Vec<f64> = (0..40_000).map(|k| look.grain(permanent[k as usize], 3, at(k).0, at(k).1)).collect();
        let mean = |v: &[f64]| v.iter().sum::<f64>() / v.len() as f64;
        let (a, b) = (mean(&permanent), mean(&own));
        let product =
            |u: &[f64], v: &[f64], a: f64, b: f64| -> f64 { u.iter().zip(v).map(|(u, v)| (u - a) * (v - b)).sum() };
        let (aa, bb) = (product(&permanent, &permanent, a, a), product(&own, &own, b, b));
        assert!((bb / aa - 1.0).abs() < 0.15, "{aa} {bb}");
        let correlation = product(&permanent, &own, a, b) / (aa * bb).sqrt();
        assert!((correlation - 0.6_f64.sqrt()).abs() < 0.08, "{correlation}");
    }
}
