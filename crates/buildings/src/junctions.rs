//! Junctions whose branches have their own lengths (Xue et al. 2018).
//!
//! At every local maximum of the smaller eigenvalue of the structure tensor, straight branches are
//! sought in all directions. A branch of a length is as good as it is improbable that its gradients
//! agree by chance; its length is the one for which the expected number of such branches in an
//! image of noise is least:
//!
//! ```text
//! false alarms(direction, length) = tests · P(sum of agreements ≥ found)
//! ```
//!
//! with one test per pixel, direction and length. Two branches at an angle between 60° and 120°
//! make a junction in the form of an L.

use std::f32::consts::TAU;

use raster::Grid;
use rayon::prelude::*;

use crate::chance::{ChanceTable, STEPS, agreement};
use crate::gradient::Gradients;

/// Directions of branches.
const DIRECTIONS: usize = 180;
/// Directions on either side in which only the best branch is kept: 16°.
const APART: usize = 8;
/// Share of the agreement of a perfect edge that the shortest side must have to be followed. By
/// chance it is 0.26.
const LEAST_AGREEMENT: f64 = 0.35;
/// Largest cosine of the angle between the branches of a junction.
const COSINE_MAX: f32 = 0.5;

/// Two straight branches that meet.
#[derive(Debug, Clone, Copy)]
pub(crate) struct Junction {
    /// Where they meet (column, row), pixels.
    pub(crate) at: [f32; 2],
    /// Unit directions of the branches.
    pub(crate) directions: [[f32; 2]; 2],
    /// Their lengths, pixels.
    pub(crate) lengths: [f32; 2],
}

/// Limits of branches.
#[derive(Debug, Clone, Copy)]
pub(crate) struct BranchLimits {
    /// Shortest branch, pixels.
    pub(crate) least_px: usize,
    /// Longest branch, pixels.
    pub(crate) most_px: usize,
    /// Longest gap at the end of a branch, pixels.
    pub(crate) gap_px: usize,
    /// Logarithm (base 10) of the most false alarms.
    pub(crate) log_false_alarms: f32,
}

/// A branch of a junction.
#[derive(Debug, Clone, Copy)]
struct Branch {
    direction: [f32; 2],
    length: f32,
}

/// Finds all junctions of an image, in the order of their pixels.
pub(crate) fn junctions(gradients: &Gradients, limits: &BranchLimits) -> Vec<Junction> {
    let (width, height) = (gradients.unit.width(), gradients.unit.height());
    let search = Search {
        gradients,
        limits,
        chances: ChanceTable::new(limits.most_px),
        log_tests: ((width * height) as f32 * (DIRECTIONS * limits.most_px) as f32).log10(),
        directions: std::array::from_fn(|k| {
            let (sine, cosine) = (k as f32 * (TAU / DIRECTIONS as f32)).sin_cos();
            [cosine, sine]
        }),
    };
    let rows: Vec<Vec<Junction>> = (1..height.saturating_sub(1)).into_par_iter().map(|y| search.row(y)).collect();
    rows.into_iter().flatten().collect()
}

/// What the search for branches needs everywhere.
struct Search<'a> {
    gradients: &'a Gradients,
    limits: &'a BranchLimits,
    chances: ChanceTable,
    /// Logarithm (base 10) of the number of branches that are tested.
    log_tests: f32,
    directions: [[f32; 2]; DIRECTIONS],
}

impl Search<'_> {
    fn row(&self, y: usize) -> Vec<Junction> {
        let mut found = Vec::new();
        for x in 1..self.gradients.unit.width().saturating_sub(1) {
            if !is_peak(&self.gradients.corner, x, y) {
                continue;
            }
            let at = [x as f32, y as f32];
            let branches = self.branches(at);
            for (i, a) in branches.iter().enumerate() {
                for b in &branches[i + 1..] {
                    let cosine = a.direction[0] * b.direction[0] + a.direction[1] * b.direction[1];
                    if cosine.abs() <= COSINE_MAX {
                        let (directions, lengths) = ([a.direction, b.direction], [a.length, b.length]);
                        found.push(Junction { at, directions, lengths });
                    }
                }
            }
        }
        found
    }

    /// Returns the branches at a pixel: the best of their surroundings among all directions.
    fn branches(&self, at: [f32; 2]) -> Vec<Branch> {
        let best: Vec<(f32, f32)> = self.directions.iter().map(|direction| self.grown(at, *direction)).collect();
        let is_best = |k: usize| {
            (1..=APART).all(|d| {
                let (after, before) = (best[(k + d) % DIRECTIONS].0, best[(k + DIRECTIONS - d) % DIRECTIONS].0);
                best[k].0 < before && best[k].0 <= after
            })
        };
        (0..DIRECTIONS)
            .filter(|k| best[*k].0 <= self.limits.log_false_alarms && is_best(*k))
            .map(|k| Branch { direction: self.directions[k], length: best[k].1 })
            .collect()
    }

    /// Returns the logarithm of the false alarms of the best length in a direction, and the length.
    fn grown(&self, [x, y]: [f32; 2], direction: [f32; 2]) -> (f32, f32) {
        let (width, height) = (self.gradients.unit.width() as f32, self.gradients.unit.height() as f32);
        let BranchLimits { least_px, most_px, gap_px, .. } = *self.limits;
        let mut best = (f32::INFINITY, 0);
        let mut sum = 0;
        for length in 1..=most_px {
            let r = length as f32;
            let (column, row) = ((x + r * direction[0]).round(), (y + r * direction[1]).round());
            if column < 0.0 || row < 0.0 || column >= width || row >= height {
                break;
            }
            sum += usize::from(agreement_at(self.gradients, [column, row], direction));
            if length < least_px {
                continue;
            }
            if length == least_px && (sum as f64) < LEAST_AGREEMENT * (least_px * STEPS) as f64 {
                break;
            }
            let log_chance = self.chances.log_probability(length, sum);
            if log_chance < best.0 {
                best = (log_chance, length);
            } else if length > best.1 + gap_px {
                break;
            }
        }
        (best.0 + self.log_tests, best.1 as f32)
    }
}

/// Returns the agreement of the gradient at a pixel inside the image with an edge in a direction.
pub(crate) fn agreement_at(gradients: &Gradients, [column, row]: [f32; 2], [dx, dy]: [f32; 2]) -> u16 {
    let [gx, gy] = gradients.unit[(column as usize, row as usize)];
    agreement(gy * dx - gx * dy, gx * dx + gy * dy)
}

/// Returns whether a pixel inside the border is above its eight neighbours; the first of equal ones
/// is.
fn is_peak(values: &Grid<f32>, x: usize, y: usize) -> bool {
    let value = values[(x, y)];
    let around = (0..9).filter(|k| *k != 4).map(|k| (k, values[(x + k % 3 - 1, y + k / 3 - 1)]));
    value > 0.0 && around.into_iter().all(|(k, other)| other < value || (other == value && k > 4))
}
