//! Sensitivity of an alignment to noise in GPS positions and headings.
//!
//! Translation noise of σ metres moves every world position by an independent normal deviate of σ
//! along each axis, and the model is aligned again. Rotation noise of σ degrees turns the aligned
//! model about the vertical through the middle of its cameras by one normal deviate, as a wrong
//! heading does. The protocol is that of Cross-View Splatter (Turkulainen et al. 2026): 1, 3, 5 m
//! and 5, 10, 15°, five seeds, mean and standard deviation.

use camera::Similarity;
use serde::{Deserialize, Serialize};

use super::error::AlignError;
use super::robust::{AlignConfig, ModelAlignment, align};
use super::umeyama::PointPair;
use numeric::SplitMix64;

/// Kinds and amounts of noise.
#[derive(Debug, Clone, PartialEq, Serialize, Deserialize)]
#[serde(deny_unknown_fields)]
pub struct NoiseConfig {
    /// Standard deviations of the positions, metres.
    pub translation_m: Vec<f64>,
    /// Standard deviations of the heading, degrees.
    pub rotation_deg: Vec<f64>,
    /// Repetitions of each level.
    pub seeds: u64,
}

impl Default for NoiseConfig {
    /// The levels of the paper.
    fn default() -> Self {
        Self { translation_m: vec![1.0, 3.0, 5.0], rotation_deg: vec![5.0, 10.0, 15.0], seeds: 5 }
    }
}

/// One kind of noise.
#[derive(Debug, Clone, Copy, PartialEq, Serialize)]
#[serde(rename_all = "snake_case")]
pub enum Disturbance {
    /// Standard deviation of every position, metres along each axis.
    TranslationM(f64),
    /// Standard deviation of the heading, degrees.
    RotationDeg(f64),
}

/// Mean and standard deviation over seeds.
#[derive(Debug, Clone, Copy, PartialEq, Serialize)]
pub struct MeanStd {
    /// Mean.
    pub mean: f64,
    /// Standard deviation (n − 1).
    pub std: f64,
}

/// Differences between alignments under one noise and the alignment without noise.
#[derive(Debug, Clone, PartialEq, Serialize)]
pub struct NoiseLevel {
    /// The noise.
    pub disturbance: Disturbance,
    /// Root mean square distance of the cameras, metres.
    pub position_m: MeanStd,
    /// Angle of the rotation between both, degrees.
    pub rotation_deg: MeanStd,
    /// Absolute change of scale, percent.
    pub scale_percent: MeanStd,
    /// Number of seeds without an alignment.
    pub failed: usize,
}

/// Returns the similarity found under a noise.
///
/// # Errors
/// As [`align`], for noise in the positions.
pub fn disturbed(
    pairs: &[PointPair],
    alignment: &ModelAlignment,
    disturbance: Disturbance,
    seed: u64,
    config: &AlignConfig,
) -> Result<Similarity, AlignError> {
    // A sequence of its own, so that it is independent of the random triples of the search.
    let mut random = SplitMix64::new(seed.wrapping_mul(0x2545_f491_4f6c_dd1d) ^ 0x5eed);
    match disturbance {
        Disturbance::TranslationM(sigma) => {
            let mut move_pair =
                |p: &PointPair| PointPair { target: p.target.map(|c| c + sigma * random.normal()), ..*p };
            let moved: Vec<PointPair> = pairs.iter().map(&mut move_pair).collect();
            // With a threshold for clean positions, noisy positions would be outliers.
            let threshold_m = config.threshold_m.map(|t| t.hypot(3.4 * sigma));
            Ok(align(&moved, &AlignConfig { threshold_m, ..*config })?.world_from_model)
        }
        Disturbance::RotationDeg(sigma) => {
            let (s, c) = (sigma * random.normal()).to_radians().sin_cos();
            let rotation = [[c, -s, 0.0], [s, c, 0.0], [0.0, 0.0, 1.0]];
            let centre = middle(pairs, &alignment.world_from_model);
            let turned = rotation.map(|row| (0..3).map(|i| row[i] * centre[i]).sum::<f64>());
            let translation = [0, 1, 2].map(|i| centre[i] - turned[i]);
            let turn = Similarity::new(1.0, rotation, translation).unwrap_or(Similarity::IDENTITY);
            Ok(turn.after(&alignment.world_from_model))
        }
    }
}

fn middle(pairs: &[PointPair], similarity: &Similarity) -> [f64; 3] {
    let count = pairs.len().max(1) as f64;
    pairs.iter().map(|p| similarity.apply(p.source)).fold([0.0; 3], |sum, p| [0, 1, 2].map(|i| sum[i] + p[i] / count))
}

/// Repeats an alignment under noise and compares the results with the alignment without noise.
pub fn sensitivity(
    pairs: &[PointPair],
    alignment: &ModelAlignment,
    noise: &NoiseConfig,
    config: &AlignConfig,
) -> Vec<NoiseLevel> {
    let translations = noise.translation_m.iter().map(|&m| Disturbance::TranslationM(m));
    let rotations = noise.rotation_deg.iter().map(|&deg| Disturbance::RotationDeg(deg));
    let level = |disturbance: Disturbance| {
        let runs = (1..=noise.seeds).map(|seed| disturbed(pairs, alignment, disturbance, seed, config));
        let found: Vec<Similarity> = runs.filter_map(Result::ok).collect();
        let measure = |f: &dyn Fn(&Similarity) -> f64| mean_std(&found.iter().map(f).collect::<Vec<_>>());
        let clean = &alignment.world_from_model;
        NoiseLevel {
            disturbance,
            position_m: measure(&|s| distance(pairs, clean, s)),
            rotation_deg: measure(&|s| angle_deg(clean, s)),
            scale_percent: measure(&|s| 100.0 * (s.scale() / clean.scale() - 1.0).abs()),
            failed: noise.seeds as usize - found.len(),
        }
    };
    translations.chain(rotations).map(level).collect()
}

fn distance(pairs: &[PointPair], a: &Similarity, b: &Similarity) -> f64 {
    let square = |p: &PointPair| {
        let (a, b) = (a.apply(p.source), b.apply(p.source));
        (0..3).map(|i| (a[i] - b[i]).powi(2)).sum::<f64>()
    };
    (pairs.iter().map(square).sum::<f64>() / pairs.len().max(1) as f64).sqrt()
}

/// Returns the angle of the rotation from one similarity to the other, degrees.
fn angle_deg(a: &Similarity, b: &Similarity) -> f64 {
    let (a, b) = (a.rotation(), b.rotation());
    // The chord keeps its digits for small angles: |A − B|² = 8 sin² (θ / 2).
    let chord: f64 = a.as_flattened().iter().zip(b.as_flattened()).map(|(a, b)| (a - b).powi(2)).sum();
    2.0 * (chord / 8.0).sqrt().min(1.0).asin().to_degrees()
}

fn mean_std(values: &[f64]) -> MeanStd {
    let count = values.len() as f64;
    if values.is_empty() {
        return MeanStd { mean: f64::NAN, std: f64::NAN };
    }
    let mean = values.iter().sum::<f64>() / count;
    let squares = values.iter().map(|v| (v - mean).powi(2)).sum::<f64>();
    MeanStd { mean, std: if values.len() > 1 { (squares / (count - 1.0)).sqrt() } else { 0.0 } }
}
