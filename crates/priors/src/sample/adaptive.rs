//! Points as dense as a geometric error requires, and no denser.
//!
//! The creases around a place ([`super::creases`]) determine its spacing s. Triangles are halved
//! until the spacing is nearly constant over a piece. The spacing grows at most as fast as the
//! distance from a crease, so a part of a piece needs only the creases that may limit the spacing
//! somewhere on the piece. A piece of area A stands for w A / s² points, where w is the weight of
//! its class. The pieces of a triangle lie end to end on a line, in the order of the halving. The
//! piece at each whole number after a random start gets a point.

use std::sync::atomic::{AtomicUsize, Ordering};

use rayon::prelude::*;

use super::config::{Amount, Purpose, SampleConfig};
use super::creases::Creases;
use super::limits::{LIMIT, positive};
use super::point::{Sample, on_triangle};
use crate::{PriorModel, PriorsError};
use numeric::vector::{Vector, cross, norm, sub};

/// Longest edge of a final piece, in spacings.
const PIECE: f64 = 0.7;

/// Typical number of cuts per point on city models.
const CUTS_PER_POINT: usize = 30;
/// Largest number of cuts, which ends the work on a huge plane with a tiny error.
const MAX_CUTS: usize = CUTS_PER_POINT * LIMIT;
/// Largest number of pieces of a triangle, which are in memory at a time.
const PIECES_MAX: usize = 1 << 22;
/// Margin for rounding in the test whether a crease is still needed, metres.
const ROUNDING_M: f64 = 1e-9;

/// Limits that the points must keep.
#[derive(Debug, Clone, Copy)]
pub(super) struct Bound {
    error_m: f64,
    max_spacing_m: f64,
}

impl Bound {
    pub(super) fn new(error_m: f64, max_spacing_m: f64) -> Result<Self, PriorsError> {
        positive("the geometric error", error_m)?;
        positive("the largest spacing", max_spacing_m)?;
        if error_m > max_spacing_m {
            let expected = "at most the largest spacing";
            return Err(PriorsError::Config { name: "the geometric error", value: error_m, expected });
        }
        Ok(Self { error_m, max_spacing_m })
    }
}

/// Number of points that an error requires.
#[derive(Debug, Clone, Copy, PartialEq)]
pub struct ErrorCurve {
    /// Geometric error, metres.
    pub error_m: f64,
    /// Number of points with adaptive spacing.
    pub points: f64,
    /// Number of points with constant spacing: half of the error, as at an edge.
    pub even_points: f64,
}

/// Returns the numbers of points for other errors: the error of the configuration times each of
/// `factors`.
///
/// The result is empty when the amount of the configuration is not [`Amount::Adaptive`].
///
/// # Errors
/// The errors of [`sample`](super::sample).
pub fn error_curve(model: &PriorModel, config: &SampleConfig, factors: &[f64]) -> Result<Vec<ErrorCurve>, PriorsError> {
    let Amount::Adaptive { error_m, max_spacing_m } = config.amount else { return Ok(Vec::new()) };
    let area: f64 = (0..model.mesh().triangles.len()).map(|t| config.weight(model, t) * model.area_m2(t)).sum();
    let mut work = Work::new(model, config, Bound::new(error_m, max_spacing_m)?)?;
    let mut of_error = |error_m: f64| {
        work.bound = Bound::new(error_m, max_spacing_m)?;
        work.made = AtomicUsize::new(0);
        let shares: Vec<f64> = work.pieces(|pieces, _| pieces.iter().map(|piece| piece.share).sum())?;
        let even = max_spacing_m.min(0.5 * error_m);
        Ok(ErrorCurve { error_m, points: shares.iter().sum(), even_points: area / (even * even) })
    };
    factors.iter().map(|factor| of_error((error_m * factor).min(max_spacing_m))).collect()
}

/// Makes adaptive points, ordered by triangle.
pub(super) fn sample(model: &PriorModel, config: &SampleConfig, bound: Bound) -> Result<Vec<Sample>, PriorsError> {
    let points =
        Work::new(model, config, bound)?.pieces(|pieces, triangle| on_pieces(model, config, pieces, triangle))?;
    Ok(points.into_iter().flatten().collect())
}

/// A part of a triangle with nearly constant spacing.
#[derive(Debug, Clone, Copy)]
struct Piece {
    corners: [Vector; 3],
    spacing_m: f64,
    /// Number of points that the piece stands for.
    share: f64,
}

/// The division of triangles into pieces.
struct Work<'a> {
    model: &'a PriorModel,
    config: &'a SampleConfig,
    bound: Bound,
    creases: Creases,
    /// Number of cuts so far.
    made: AtomicUsize,
}

impl<'a> Work<'a> {
    fn new(model: &'a PriorModel, config: &'a SampleConfig, bound: Bound) -> Result<Self, PriorsError> {
        let creases = Creases::new(model, bound.max_spacing_m)?;
        Ok(Self { model, config, bound, creases, made: AtomicUsize::new(0) })
    }

    /// Divides each triangle into pieces, and returns the results of `of_triangle`.
    fn pieces<T: Send>(&self, of_triangle: impl Fn(&[Piece], usize) -> T + Sync) -> Result<Vec<T>, PriorsError> {
        let triangles = 0..self.model.mesh().triangles.len();
        // Points so far. Points that are made take memory, so the work ends with the limit.
        let points = AtomicUsize::new(0);
        triangles
            .into_par_iter()
            .map(|triangle| {
                let mut pieces = Vec::new();
                self.cut(triangle, &mut pieces)?;
                let share: f64 = pieces.iter().map(|piece| piece.share).sum();
                let asked = points.fetch_add(share.min(LIMIT as f64 + 1.0) as usize, Ordering::Relaxed);
                if asked > LIMIT {
                    return Err(PriorsError::TooMany { asked: asked as u64, limit: LIMIT });
                }
                Ok(of_triangle(&pieces, triangle))
            })
            .collect()
    }

    /// Divides a triangle into pieces.
    fn cut(&self, triangle: usize, pieces: &mut Vec<Piece>) -> Result<(), PriorsError> {
        let weight = self.config.weight(self.model, triangle);
        if weight == 0.0 {
            return Ok(());
        }
        let corners = self.model.mesh().corners(triangle);
        // The lists of creases of the open pieces follow one another. The list of a piece ends
        // where the list of its parts begins.
        let mut near = self.creases.near(&corners, self.model.normal(triangle), self.bound.error_m);
        let mut open = vec![(corners, 0..near.len())];
        while let Some((corners, own)) = open.pop() {
            near.truncate(own.end);
            let centre = [0, 1, 2].map(|i| (corners[0][i] + corners[1][i] + corners[2][i]) / 3.0);
            let allowed = near[own.clone()].iter().map(|crease| crease.allows(centre));
            let spacing_m = allowed.fold(self.creases.reach_m(), f64::min);
            let edge = |i: usize| norm(sub(corners[(i + 1) % 3], corners[i]));
            let longest = (0..3).max_by(|&i, &j| edge(i).total_cmp(&edge(j))).unwrap_or(0);
            if edge(longest) <= PIECE * spacing_m {
                let area = 0.5 * norm(cross(sub(corners[1], corners[0]), sub(corners[2], corners[0])));
                pieces.push(Piece { corners, spacing_m, share: weight * area / (spacing_m * spacing_m) });
                continue;
            }
            let made = self.made.fetch_add(1, Ordering::Relaxed);
            if made > MAX_CUTS || pieces.len() + open.len() >= PIECES_MAX || near.len() >= PIECES_MAX {
                let asked = (made / CUTS_PER_POINT).max(LIMIT + 1) as u64;
                return Err(PriorsError::TooMany { asked, limit: LIMIT });
            }
            let [a, b, c] = [0, 1, 2].map(|i| corners[(longest + i) % 3]);
            let middle = [0, 1, 2].map(|i| 0.5 * (a[i] + b[i]));
            let radius = corners.iter().map(|&corner| norm(sub(corner, centre))).fold(0.0, f64::max);
            // Within the piece the bound of a crease may be lower by the radius, and the bounds of
            // all other creases may be higher by the radius.
            let highest = spacing_m + 2.0 * radius + ROUNDING_M;
            for i in own.clone() {
                let crease = near[i];
                if crease.allows(centre) <= highest {
                    near.push(crease);
                }
            }
            let kept = own.end..near.len();
            open.extend([([middle, b, c], kept.clone()), ([a, middle, c], kept)]);
        }
        Ok(())
    }
}

/// Makes the points of the pieces of a triangle.
fn on_pieces(model: &PriorModel, config: &SampleConfig, pieces: &[Piece], triangle: usize) -> Vec<Sample> {
    let mut points = Vec::new();
    let mut reached = config.stream(Purpose::Share).uniform(triangle as u64);
    for piece in pieces {
        let before = reached.floor();
        reached += piece.share;
        for _ in 0..(reached.floor() - before) as usize {
            let place = config.even_place(triangle, points.len());
            points.push(model.sample_at(triangle, on_triangle(piece.corners, place), piece.spacing_m));
        }
    }
    points
}
