//! Poisson disks by throwing darts: of independent candidates in their order, each is kept that is
//! not too close to those kept before. Points whose normals are opposed do not meet: the two sides
//! of a thin wall are sampled each for itself.
//!
//! Darts that never stop fill 0.547 of a plane with disks (random sequential adsorption), which
//! gives the distance for a number of points; it is then shrunk until the candidates that there are
//! give that number.

use std::collections::HashMap;

use super::{LIMIT, Sample, Share};
use crate::PriorsError;
use numeric::vector::{dot, norm, sub};
use rayon::prelude::*;

/// Points per r² of area where no further dart fits: 0.547 of the area in disks of radius r/2.
const SATURATED: f64 = 0.696;
/// Candidates per point.
const CANDIDATES: usize = 6;
/// Rounds of shrinking.
const ROUNDS: usize = 12;

/// Points that keep their distance, and the distance on classes of weight 1.
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

/// Indices of the darts that are no closer to an earlier one than `factor` times the smaller of
/// both spacings.
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

fn too_close(a: &Sample, b: &Sample, factor: f64) -> bool {
    let opposed = dot(a.normal.map(f64::from), b.normal.map(f64::from)) < -0.5;
    let limit = factor * f64::from(a.spacing_m.min(b.spacing_m));
    !opposed && norm(sub(a.position, b.position)) < limit
}

fn neighbours([x, y, z]: [i64; 3]) -> impl Iterator<Item = [i64; 3]> {
    (0..27).map(move |i| [x + i % 3 - 1, y + i / 3 % 3 - 1, z + i / 9 - 1])
}
