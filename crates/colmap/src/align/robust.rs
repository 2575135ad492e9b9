//! A similarity among outliers.
//!
//! Triples of pairs propose similarities: all triples of few pairs, a fixed sequence of random
//! triples of many. With a threshold, the proposal with the least Σ min(r², threshold²) wins (MSAC,
//! Torr and Zisserman 2000). Without one, the proposal with the least median of r² wins (Rousseeuw
//! 1984), which tolerates up to half of outliers. The least-squares fit to the pairs within the
//! threshold is repeated until the set of inliers does not change. Where no threshold is given, it
//! is 2.19 times the median of the residuals, estimated again in every round: the 99th percentile
//! of the length of an isotropic normal vector. It is never less than a centimetre.

use camera::Similarity;
use nalgebra::{Matrix3, Vector3};

use super::error::AlignError;
use super::gravity::{CameraUp, fit_with_up};
use super::umeyama::{PointPair, fit_similarity};
use numeric::{SplitMix64, order_statistic, upper_median};

/// Number of pairs up to which every triple is tried.
const ALL_TRIPLES: usize = 20;
/// Largest number of refinements; sets of inliers settle within a few.
const ROUNDS: usize = 50;
/// Rounds in which the weight of the up direction follows the residuals; it settles in two.
const UPRIGHT_ROUNDS: usize = 3;
/// Ratio of the 99th percentile of |e| to its median for a normal vector of three equal components:
/// 3.368 / 1.538.
const PERCENTILE_99: f64 = 2.19;
/// Least automatic threshold, metres. Positions are written with a few decimals, so the residuals
/// of exact data are their rounding, and a multiple of its median leaves right positions out.
const FLOOR_M: f64 = 0.01;
/// Share of the extent of the world's positions below which residuals are rounding errors.
const ROUNDING: f64 = 1e-10;

/// Settings of the search for an alignment.
#[derive(Debug, Clone, Copy, PartialEq)]
pub struct AlignConfig {
    /// Largest residual of an inlier, metres; estimated from the residuals when `None`.
    pub threshold_m: Option<f64>,
    /// Number of random triples.
    pub samples: usize,
    /// Seed of the random triples.
    pub seed: u64,
}

impl Default for AlignConfig {
    /// 2000 triples: with half of the pairs wrong, the probability of no right triple is 10⁻¹¹⁵.
    fn default() -> Self {
        Self { threshold_m: None, samples: 2000, seed: 1 }
    }
}

/// A similarity with its residuals and inliers.
#[derive(Debug, Clone, PartialEq)]
pub struct ModelAlignment {
    /// Similarity from the model to the world.
    pub world_from_model: Similarity,
    /// |target − similarity(source)| of every pair, metres.
    pub residuals_m: Vec<f64>,
    /// Whether each pair is an inlier, that is, part of the fit.
    pub inliers: Vec<bool>,
    /// Largest residual of an inlier, metres.
    pub threshold_m: f64,
}

impl ModelAlignment {
    /// Number of inliers.
    pub fn inlier_count(&self) -> usize {
        self.inliers.iter().filter(|i| **i).count()
    }

    /// Root mean square of the inliers' residuals, metres.
    pub fn rmse_m(&self) -> f64 {
        let inside = self.residuals_m.iter().zip(&self.inliers).filter(|(_, inlier)| **inlier);
        (inside.map(|(r, _)| r * r).sum::<f64>() / self.inlier_count().max(1) as f64).sqrt()
    }
}

/// Aligns a model to the world by pairs of positions, some of which may be wrong.
///
/// # Errors
/// [`AlignError::TooFew`] below three pairs, [`AlignError::NotFinite`], [`AlignError::Degenerate`]
/// for positions on a line, [`AlignError::NoConsensus`] where fewer than three pairs or fewer than
/// a third of them agree.
///
/// ```
/// use colmap::align::{AlignConfig, PointPair, align};
/// let place = |t: f64| [10.0 * t, (7.0 * t).sin(), (3.0 * t).cos()];
/// let sources = (0..12).map(|i| place(f64::from(i) / 12.0));
/// let mut pairs: Vec<PointPair> = sources.map(|p| PointPair { source: p, target: p.map(|c| 3.0 * c) }).collect();
/// pairs[4].target = [500.0, 0.0, 0.0];
/// let found = align(&pairs, &AlignConfig::default())?;
/// assert!((found.world_from_model.scale() - 3.0).abs() < 1e-9 && !found.inliers[4]);
/// # Ok::<(), colmap::align::AlignError>(())
/// ```
pub fn align(pairs: &[PointPair], config: &AlignConfig) -> Result<ModelAlignment, AlignError> {
    // This refuses too few pairs and positions that are not finite. A line may still be hidden by
    // outliers.
    let plain = match fit_similarity(pairs) {
        Err(error @ (AlignError::TooFew { .. } | AlignError::NotFinite { .. })) => return Err(error),
        plain => plain,
    };
    let floor = FLOOR_M.max(ROUNDING * extent(pairs));
    let mut best: Option<(f64, Similarity)> = None;
    let mut consider = |triple: [usize; 3]| {
        if let Ok(proposal) = fit_similarity(&triple.map(|i| pairs[i])) {
            let score = score(pairs, &proposal, config.threshold_m);
            if best.is_none_or(|(least, _)| score < least) {
                best = Some((score, proposal));
            }
        }
    };
    triples(pairs.len(), config, &mut consider);
    let (_, first) = best.ok_or_else(|| plain.err().unwrap_or(AlignError::Degenerate { ratio: 0.0 }))?;
    refine(pairs, first, config.threshold_m, floor, &fit_similarity)
}

/// Finds the similarity of pairs and of the up direction of a model, which is up in the world.
/// Positions on a line suffice.
///
/// # Errors
/// As [`align`], except for a line that is not upright.
pub fn align_upright(pairs: &[PointPair], up: &CameraUp, config: &AlignConfig) -> Result<ModelAlignment, AlignError> {
    let mut sigma_m = match align(pairs, config) {
        Ok(found) => axis_sigma(&found, FLOOR_M),
        Err(AlignError::Degenerate { .. }) => FLOOR_M,
        Err(error) => return Err(error),
    };
    let floor = FLOOR_M.max(ROUNDING * extent(pairs));
    let mut best: Option<(f64, Similarity)> = None;
    let mut consider = |triple: [usize; 3]| {
        if let Ok(proposal) = fit_with_up(&triple.map(|i| pairs[i]), up, sigma_m) {
            let score = score(pairs, &proposal, config.threshold_m);
            if best.is_none_or(|(least, _)| score < least) {
                best = Some((score, proposal));
            }
        }
    };
    triples(pairs.len(), config, &mut consider);
    let (_, first) = best.ok_or(AlignError::Degenerate { ratio: 0.0 })?;
    let mut found = refine(pairs, first, config.threshold_m, floor, &|chosen| fit_with_up(chosen, up, sigma_m))?;
    for _ in 0..UPRIGHT_ROUNDS {
        sigma_m = axis_sigma(&found, FLOOR_M);
        let fit = |chosen: &[PointPair]| fit_with_up(chosen, up, sigma_m);
        found = refine(pairs, found.world_from_model, config.threshold_m, floor, &fit)?;
    }
    Ok(found)
}

/// Returns the standard deviation of the inliers along one axis, metres.
fn axis_sigma(found: &ModelAlignment, least: f64) -> f64 {
    (found.rmse_m() / 3.0_f64.sqrt()).max(least)
}

fn triples(count: usize, config: &AlignConfig, consider: &mut impl FnMut([usize; 3])) {
    if count <= ALL_TRIPLES {
        for a in 0..count {
            for b in a + 1..count {
                (b + 1..count).for_each(|c| consider([a, b, c]));
            }
        }
        return;
    }
    let mut random = SplitMix64::new(config.seed);
    for _ in 0..config.samples {
        let triple = [0; 3].map(|_| random.below(count));
        if triple[0] != triple[1] && triple[1] != triple[2] && triple[0] != triple[2] {
            consider(triple);
        }
    }
}

fn extent(pairs: &[PointPair]) -> f64 {
    let range = |axis: usize| {
        let values = pairs.iter().map(|p| p.target[axis]);
        let (low, high) = values.fold((f64::INFINITY, f64::NEG_INFINITY), |(low, high), v| (low.min(v), high.max(v)));
        // Far from the origin, the rounding error follows the size of the coordinates.
        (high - low) + 1e-3 * low.abs().max(high.abs())
    };
    (0..3).map(range).fold(0.0, f64::max)
}

fn residuals(pairs: &[PointPair], similarity: &Similarity) -> Vec<f64> {
    let one = |p: &PointPair| {
        let at = similarity.apply(p.source);
        (0..3).map(|i| (at[i] - p.target[i]).powi(2)).sum::<f64>().sqrt()
    };
    pairs.iter().map(one).collect()
}

fn score(pairs: &[PointPair], similarity: &Similarity, threshold_m: Option<f64>) -> f64 {
    let residuals = residuals(pairs, similarity);
    match threshold_m {
        Some(threshold) => residuals.iter().map(|r| r.min(threshold).powi(2)).sum(),
        None => half(residuals),
    }
}

/// The residual that half of the pairs and the three that made the proposal stay below.
fn half(mut residuals: Vec<f64>) -> f64 {
    let at = (residuals.len() / 2 + 1).min(residuals.len().saturating_sub(1));
    order_statistic(&mut residuals, at).unwrap_or(f64::INFINITY)
}

fn refine(
    pairs: &[PointPair],
    first: Similarity,
    threshold_m: Option<f64>,
    floor: f64,
    fit: &dyn Fn(&[PointPair]) -> Result<Similarity, AlignError>,
) -> Result<ModelAlignment, AlignError> {
    let mut similarity = first;
    let mut inliers = Vec::new();
    for round in 0.. {
        let residuals = residuals(pairs, &similarity);
        // The inliers' median: among all pairs, outliers would widen it.
        let scale = if round == 0 { half(residuals.clone()) } else { median_of(&residuals, &inliers) };
        let threshold = threshold_m.unwrap_or((PERCENTILE_99 * scale).max(floor));
        let now: Vec<bool> = residuals.iter().map(|&r| r <= threshold).collect();
        let chosen: Vec<PointPair> = pairs.iter().zip(&now).filter(|(_, inlier)| **inlier).map(|(p, _)| *p).collect();
        if chosen.len() < 3.max(pairs.len().div_ceil(3)) {
            return Err(AlignError::NoConsensus { inliers: chosen.len(), pairs: pairs.len() });
        }
        if now == inliers || round == ROUNDS {
            return Ok(ModelAlignment {
                world_from_model: similarity,
                residuals_m: residuals,
                inliers: now,
                threshold_m: threshold,
            });
        }
        similarity = fit(&chosen)?;
        inliers = now;
    }
    Err(AlignError::NoConsensus { inliers: 0, pairs: pairs.len() })
}

fn median_of(residuals: &[f64], inliers: &[bool]) -> f64 {
    let mut inside: Vec<f64> = residuals.iter().zip(inliers).filter(|(_, inlier)| **inlier).map(|(r, _)| *r).collect();
    upper_median(&mut inside).unwrap_or(0.0)
}

/// Returns the standard deviation of the tilt of an alignment, as far as its positions determine
/// it, degrees: that of the rotation about the worst horizontal axis. Infinite where nothing
/// determines it.
pub fn tilt_sigma_deg(pairs: &[PointPair], alignment: &ModelAlignment) -> f64 {
    let chosen = || pairs.iter().zip(&alignment.inliers).filter(|(_, inlier)| **inlier).map(|(pair, _)| pair);
    let count = chosen().count() as f64;
    let place = |p: &PointPair| Vector3::from(alignment.world_from_model.apply(p.source));
    let mean = chosen().map(place).sum::<Vector3<f64>>() / count;
    let information: Matrix3<f64> =
        chosen().map(|p| place(p) - mean).map(|p| Matrix3::identity() * p.norm_squared() - p * p.transpose()).sum();
    // Seven parameters are fitted to three coordinates of each position.
    let freedom = 3.0 * count - 7.0;
    if freedom < 1.0 {
        return f64::INFINITY;
    }
    let squares: f64 =
        alignment.residuals_m.iter().zip(&alignment.inliers).filter(|(_, i)| **i).map(|(r, _)| r * r).sum();
    let Some(covariance) = information.try_inverse() else { return f64::INFINITY };
    let covariance = covariance * (squares / freedom);
    let (a, b, c) = (covariance[(0, 0)], covariance[(0, 1)], covariance[(1, 1)]);
    let greatest = 0.5 * (a + c) + (0.25 * (a - c).powi(2) + b * b).sqrt();
    if greatest.is_finite() { greatest.sqrt().to_degrees() } else { f64::INFINITY }
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::align::camera_up;
    use camera::Pose;
    use proptest::prelude::*;

    fn planted() -> Similarity {
        let rotation = Pose::from_quaternion([0.5, -0.3, 0.7, 0.2], [0.0; 3]).unwrap().rotation;
        Similarity::new(7.25, rotation, [412.5, -87.25, 31.0]).unwrap()
    }

    /// Cameras along a bent street, with noise (metres) and every third-or-so position wrong by
    /// tens of metres.
    fn pairs(count: usize, noise_m: f64, outliers: f64, seed: u64) -> Vec<PointPair> {
        let mut random = SplitMix64::new(seed);
        let truth = planted();
        (0..count)
            .map(|i| {
                let t = i as f64 / count as f64;
                let source = [10.0 * t, (3.0 * t).sin(), 0.2 * (9.0 * t).cos()];
                let wrong = ((i + 1) as f64 * outliers).floor() > (i as f64 * outliers).floor();
                let size = if wrong { 40.0 } else { noise_m };
                let target = truth.apply(source).map(|c| c + size * random.normal());
                PointPair { source, target }
            })
            .collect()
    }

    fn off(found: &Similarity, pairs: &[PointPair]) -> f64 {
        let truth = planted();
        let squares = pairs.iter().map(|p| {
            let (a, b) = (found.apply(p.source), truth.apply(p.source));
            (0..3).map(|i| (a[i] - b[i]).powi(2)).sum::<f64>()
        });
        (squares.sum::<f64>() / pairs.len() as f64).sqrt()
    }

    proptest! {
        #![proptest_config(ProptestConfig::with_cases(24))]

        #[test]
        fn without_noise_it_is_exact_among_30_percent_of_outliers(count in 10..120usize, seed in 0..1000u64) {
            let pairs = pairs(count, 0.0, 0.3, seed);
            let found = align(&pairs, &AlignConfig::default()).unwrap();
            prop_assert!(off(&found.world_from_model, &pairs) < 1e-6);
            prop_assert!((found.world_from_model.scale() / 7.25 - 1.0).abs() < 1e-9);
            prop_assert_eq!(found.inlier_count(), count - (count as f64 * 0.3 + 1e-9).floor() as usize);
        }

        #[test]
        fn with_noise_it_is_as_good_as_the_noise(count in 30..120usize, seed in 0..1000u64) {
            let pairs = pairs(count, 0.5, 0.3, seed);
            for threshold_m in [None, Some(2.0)] {
                let found = align(&pairs, &AlignConfig { threshold_m, ..AlignConfig::default() }).unwrap();
                // Seven parameters over 0.7 n positions of three coordinates, with room for bad
                // luck.
                let expected = 0.5 * (7.0 / (0.7 * count as f64)).sqrt();
                prop_assert!(off(&found.world_from_model, &pairs) < 3.0 * expected, "{} {expected}", off(&found.world_from_model, &pairs));
            }
        }
    }

    /// Positions that are exact but for their rounding to millimetres are all right.
    #[test]
    fn rounding_makes_no_outliers() {
        let mut exact = pairs(12, 0.0, 0.0, 7);
        for pair in &mut exact {
            pair.target = pair.target.map(|c| (c * 1e3).round() / 1e3);
        }
        let found = align(&exact, &AlignConfig::default()).unwrap();
        assert_eq!((found.inlier_count(), found.threshold_m), (12, FLOOR_M));
    }

    #[test]
    fn a_line_of_cameras_is_refused() {
        let line: Vec<PointPair> =
            (0..30).map(|i| PointPair { source: [f64::from(i), 0.0, 0.0], target: [0.0, f64::from(i), 5.0] }).collect();
        assert!(matches!(align(&line, &AlignConfig::default()), Err(AlignError::Degenerate { .. })));
    }

    /// A straight street of 200 m with GPS noise of 3 m, seen by cameras that are held within a
    /// degree of level: on every seed the tilt is either known to be loose, or right. With the up
    /// direction it is right.
    #[test]
    fn a_straight_street_is_upright() {
        let truth = planted();
        let tilt_deg = |found: &Similarity| {
            let up = found.turn(truth.inverse().turn([0.0, 0.0, 1.0]));
            let length = up.iter().map(|c| c * c).sum::<f64>().sqrt();
            (up[2] / length).clamp(-1.0, 1.0).acos().to_degrees()
        };
        let mut silent_and_wrong = 0;
        let mut worst: f64 = 0.0;
        for seed in 0..100 {
            let mut random = SplitMix64::new(seed);
            let (mut pairs, mut rotations) = (Vec::new(), Vec::new());
            for i in 0..40 {
                let along = 5.0 * f64::from(i);
                let place = [0.8 * along, 0.6 * along, 0.02 * random.normal()];
                let target = place.map(|c| c + 3.0 * random.normal());
                pairs.push(PointPair { source: truth.inverse().apply(place), target });
                let (roll, pitch) = (random.normal().to_radians(), random.normal().to_radians());
                // Right, down and forward along the street, turned by the hand.
                let axes = [[0.6, -0.8, roll], [0.8 * pitch, 0.6 * pitch, -1.0], [0.8, 0.6, pitch]];
                let unit = |axis: [f64; 3]| {
                    let length = axis.iter().map(|c| c * c).sum::<f64>().sqrt();
                    axis.map(|c| c / length)
                };
                let turned = axes.map(|axis| unit(truth.inverse().turn(unit(axis))));
                rotations.push(turned);
            }
            let plain = align(&pairs, &AlignConfig::default()).unwrap();
            if tilt_sigma_deg(&pairs, &plain) < 0.7 && tilt_deg(&plain.world_from_model) > 2.0 {
                silent_and_wrong += 1;
            }
            let up = camera_up(&rotations).unwrap();
            let upright = align_upright(&pairs, &up, &AlignConfig::default()).unwrap();
            worst = worst.max(tilt_deg(&upright.world_from_model));
        }
        assert_eq!(silent_and_wrong, 0);
        assert!(worst < 2.0, "{worst}");
    }

    #[test]
    fn positions_of_other_images_agree_with_nothing() {
        let mut random = SplitMix64::new(3);
        let mut place = || [0; 3].map(|_| 100.0 * random.normal());
        let pairs: Vec<PointPair> = (0..40).map(|_| PointPair { source: place(), target: place() }).collect();
        let config = AlignConfig { threshold_m: Some(1.0), ..AlignConfig::default() };
        assert!(matches!(align(&pairs, &config), Err(AlignError::NoConsensus { .. })));
    }
}
