//! M3C2: distances along local normals, with a level of detection (Lague, Brodu, Leroux 2013,
//! sections 3.2 to 3.4).
//!
//! At a core point of the reference, the normal is estimated from the reference's points in a ball
//! of diameter D. It is turned outwards if the reference is a mesh, upwards otherwise. The distance
//! is the mean position of the test minus that of the reference along the normal, in a cylinder of
//! diameter d. The level of detection at 95 % is 1.96 · (√(σ₁²/n₁ + σ₂²/n₂) + registration), where
//! σ are sample standard deviations (divided by n − 1). It needs two points on each side.

use rayon::prelude::*;
use serde::Serialize;

use super::config::SurfaceComparisonConfig;
use super::index::PointIndex;
use super::normals::{normal, towards};
use super::sample::Samples;
use numeric::percentile;
use numeric::vector::{dot, sub};

/// Quantile of the normal distribution for a two-sided probability of 95 %.
const Z95: f64 = 1.96;

/// M3C2 distances over the core points, metres. They are positive where the test lies outside or
/// above.
#[derive(Debug, Clone, Copy, PartialEq, Serialize)]
pub struct M3c2 {
    /// Number of core points.
    pub core_points: usize,
    /// Number of core points with a normal and both surfaces in the cylinder. The fields below
    /// refer to these.
    pub n: usize,
    /// Mean.
    pub mean_m: f64,
    /// Median.
    pub median_m: f64,
    /// Mean absolute distance.
    pub mean_abs_m: f64,
    /// Root of the mean square.
    pub rmse_m: f64,
    /// Standard deviation.
    pub std_m: f64,
    /// Median number of points of the reference that a normal rests on. With few, the normals and
    /// so the distances depend on which points there are.
    #[serde(skip)]
    pub points_per_normal: usize,
    /// Number of distances with a level of detection.
    pub with_lod: usize,
    /// Median level of detection.
    pub median_lod_m: Option<f64>,
    /// Share of the distances with a level of detection that exceed it, which are significant
    /// changes.
    pub significant: Option<f64>,
}

/// Result of one core point.
#[derive(Debug, Clone, Copy)]
struct Core {
    distance_m: f64,
    lod_m: Option<f64>,
    /// Number of points that the normal rests on.
    near: usize,
}

/// Mean and sample variance (divided by n − 1) of positions along an axis.
struct Along {
    count: usize,
    mean: f64,
    variance: Option<f64>,
}

pub(super) fn m3c2(
    reference: &Samples,
    in_reference: &PointIndex,
    in_test: &PointIndex,
    config: &SurfaceComparisonConfig,
) -> M3c2 {
    let step = reference.points.len().div_ceil(config.max_core_points.max(1)).max(1);
    let core = |i: usize| {
        let point = reference.points[i];
        let mut axis = normal(in_reference, point, 0.5 * config.normal_scale_m)?;
        if let Some(normals) = &reference.normals {
            axis = towards(axis, normals[i]);
        }
        let (first, second) = (along(in_reference, point, axis, config)?, along(in_test, point, axis, config)?);
        let spread = |side: &Along| side.variance.map(|variance| variance / side.count as f64);
        let lod_m = spread(&first).zip(spread(&second)).map(|(a, b)| Z95 * ((a + b).sqrt() + config.registration_m));
        let near = in_reference.within(point, 0.5 * config.normal_scale_m).count();
        Some(Core { distance_m: second.mean - first.mean, lod_m, near })
    };
    let chosen: Vec<usize> = (0..reference.points.len()).step_by(step).collect();
    let found: Vec<Core> = chosen.par_iter().map(|&i| core(i)).collect::<Vec<_>>().into_iter().flatten().collect();
    summary(chosen.len(), &found)
}

/// Returns the positions of the points in the cylinder along its axis, or `None` if there are none.
fn along(index: &PointIndex, core: [f64; 3], axis: [f64; 3], config: &SurfaceComparisonConfig) -> Option<Along> {
    let (radius, reach) = (0.5 * config.cylinder_m, config.cylinder_reach_m);
    let half = axis.map(|n| reach * n.abs() + radius * (1.0 - n * n).max(0.0).sqrt());
    let low = [0, 1, 2].map(|i| core[i] - half[i]);
    let high = [0, 1, 2].map(|i| core[i] + half[i]);
    let inside = |(point, index): ([f64; 3], u32)| {
        let to = sub(point, core);
        let position = dot(to, axis);
        let beside = dot(to, to) - position * position;
        (position.abs() <= reach && beside <= radius * radius).then_some((index, position))
    };
    let mut positions: Vec<(u32, f64)> = index.in_box(low, high).filter_map(inside).collect();
    positions.sort_unstable_by_key(|(index, _)| *index);
    let count = positions.len();
    if count == 0 {
        return None;
    }
    let mean = positions.iter().map(|(_, p)| p).sum::<f64>() / count as f64;
    let squares = positions.iter().map(|(_, p)| (p - mean).powi(2)).sum::<f64>();
    Some(Along { count, mean, variance: (count > 1).then(|| squares / (count - 1) as f64) })
}

fn summary(core_points: usize, found: &[Core]) -> M3c2 {
    let n = found.len();
    let mean = |values: &dyn Fn(f64) -> f64| found.iter().map(|c| values(c.distance_m)).sum::<f64>() / n as f64;
    let mean_m = mean(&|d| d);
    let mut distances: Vec<f64> = found.iter().map(|c| c.distance_m).collect();
    let mut near: Vec<f64> = found.iter().map(|c| c.near as f64).collect();
    let mut lods: Vec<f64> = found.iter().filter_map(|c| c.lod_m).collect();
    let above = found.iter().filter(|c| c.lod_m.is_some_and(|lod| c.distance_m.abs() > lod)).count();
    M3c2 {
        core_points,
        n,
        mean_m,
        median_m: percentile(&mut distances, 50.0).unwrap_or(f64::NAN),
        mean_abs_m: mean(&f64::abs),
        rmse_m: mean(&|d| d * d).sqrt(),
        std_m: mean(&|d| (d - mean_m).powi(2)).sqrt(),
        points_per_normal: percentile(&mut near, 50.0).unwrap_or_default() as usize,
        with_lod: lods.len(),
        significant: (!lods.is_empty()).then(|| above as f64 / lods.len() as f64),
        median_lod_m: percentile(&mut lods, 50.0),
    }
}
