//! Poisson disks by dart throwing: an independent candidate is kept unless it is too close to a
//! point that was kept before. Points with opposite normals do not exclude each other, so that the
//! two sides of a thin wall are sampled independently.
//!
//! Unlimited dart throwing covers 0.547 of a plane with disks (random sequential adsorption). This
//! gives the distance for a number of points. The distance is then reduced until the limited number
//! of candidates gives the number of points.

use std::collections::HashMap;

use super::limits::LIMIT;
use super::point::Sample;
use super::share::Share;
use crate::PriorsError;
use numeric::vector::{dot, norm, sub};
use rayon::prelude::*;

/// Points per area r² when no further dart fits: disks of radius r/2 cover 0.547 of the area.
const SATURATED: f64 = 0.696;
/// Number of candidates per point.
const CANDIDATES: usize = 6;
/// Largest number of reductions of the distance.
const ROUNDS: usize = 12;

/// Returns points with a least distance, and that distance on classes of weight 1, metres.
pub(super) fn sample(share: &Share<'_>, count: usize) -> Result<(Vec<Sample>, f64), PriorsError> {
    let candidates = count.saturating_mul(CANDIDATES);
    if candidates > LIMIT {
        return Err(PriorsError::TooMany { asked: candidates as u64, limit: LIMIT });
    }
    let density = share.density(count);
    let darts: Vec<Sample> = (0..candidates as u64).into_par_iter().map(|i| share.independent(i, density)).collect();
    let mut factor = SATURATED.sqrt();
    let mut kept = Vec::new();
    for _ in 0..ROUNDS {
        kept = thrown(&darts, factor);
        if kept.len() >= count {
            break;
        }
        factor *= 0.995 * (kept.len() as f64 / count as f64).sqrt();
    }
    kept.truncate(count);
    let distance = factor / density.sqrt();
    Ok((kept.into_iter().map(|i| darts[i]).collect(), distance))
}

/// Returns the indices of the darts that are kept: the distance to each dart kept before is at
/// least `factor` times the smaller one of both spacings.
fn thrown(darts: &[Sample], factor: f64) -> Vec<usize> {
    let side = factor * darts.iter().map(|d| f64::from(d.spacing_m)).fold(0.0, f64::max);
    let cell = |p: [f64; 3]| p.map(|c| (c / side).floor() as i64);
    let mut cells: HashMap<[i64; 3], Vec<usize>> = HashMap::new();
    let mut kept = Vec::new();
    for (number, dart) in darts.iter().enumerate() {
        let home = cell(dart.position);
        let meets = |&other: &usize| too_close(dart, &darts[other], factor);
        let taken = neighbours(home).any(|c| cells.get(&c).is_some_and(|list| list.iter().any(meets)));
        if !taken {
            cells.entry(home).or_default().push(number);
            kept.push(number);
        }
    }
    kept
}

/// Returns whether two darts exclude each other.
fn too_close(a: &Sample, b: &Sample, factor: f64) -> bool {
    let opposed = dot(a.normal.map(f64::from), b.normal.map(f64::from)) < -0.5;
    let limit = factor * f64::from(a.spacing_m.min(b.spacing_m));
    !opposed && norm(sub(a.position, b.position)) < limit
}

/// Iterates over a cell and the 26 cells around it.
fn neighbours([x, y, z]: [i64; 3]) -> impl Iterator<Item = [i64; 3]> {
    (0..27).map(move |i| [x + i % 3 - 1, y + i / 3 % 3 - 1, z + i / 9 - 1])
}
