//! Points as dense as a geometric error needs, and no denser.
//!
//! The spacing s at a place comes from the creases around it ([`super::creases`]). Triangles are
//! halved until the spacing hardly changes over a piece. The spacing grows no faster than one goes
//! away from a crease, so that the parts of a piece look only at the creases that may bound it
//! somewhere on the piece. A piece of area A stands for w A / s² points, w being the weight of its
//! class. The pieces of a triangle, laid end to end in the order of the halving, take a point at
//! every whole number past a random start.

use std::sync::atomic::{AtomicUsize, Ordering};

use rayon::prelude::*;

use super::creases::Creases;
use super::{Amount, LIMIT, Purpose, Sample, SampleConfig, on_triangle, positive};
use crate::{PriorModel, PriorsError};
use numeric::vector::{Vector, cross, norm, sub};

/// A piece is small enough when it is no longer than this many spacings.
const PIECE: f64 = 0.7;

/// Cuts for each point that is made of them, on city models.
const CUTS_PER_POINT: usize = 30;
/// Without this a huge plane and a tiny error would never end.
const MAX_CUTS: usize = CUTS_PER_POINT * LIMIT;
/// Creases that are no nearer than this to being of no use are kept, metres.
const ROUNDING_M: f64 = 1e-9;

/// What the points must keep.
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

/// How many points an error needs.
#[derive(Debug, Clone, Copy, PartialEq)]
pub struct ErrorCurve {
    /// The error, metres.
    pub error_m: f64,
    /// Points of varying spacing that keep it.
    pub points: f64,
    /// Points of one spacing that keep it everywhere: half of the error, as at an edge.
    pub even_points: f64,
}

/// How many points other errors need: the one of the configuration times each of `factors`. Empty
/// where it has none.
///
/// # Errors
/// As [`super::sample`].
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

pub(super) fn sample(model: &PriorModel, config: &SampleConfig, bound: Bound) -> Result<Vec<Sample>, PriorsError> {
    let points =
        Work::new(model, config, bound)?.pieces(|pieces, triangle| on_pieces(model, config, pieces, triangle))?;
    Ok(points.into_iter().flatten().collect())
}

/// A part of a triangle over which the spacing hardly changes.
#[derive(Debug, Clone, Copy)]
struct Piece {
    corners: [Vector; 3],
    spacing_m: f64,
    share: f64,
}

struct Work<'a> {
    model: &'a PriorModel,
    config: &'a SampleConfig,
    bound: Bound,
    creases: Creases,
    made: AtomicUsize,
}

impl<'a> Work<'a> {
    fn new(model: &'a PriorModel, config: &'a SampleConfig, bound: Bound) -> Result<Self, PriorsError> {
        let creases = Creases::new(model, bound.max_spacing_m)?;
        Ok(Self { model, config, bound, creases, made: AtomicUsize::new(0) })
    }

    /// What `of_triangle` makes of the pieces of each triangle.
    fn pieces<T: Send>(&self, of_triangle: impl Fn(&[Piece], usize) -> T + Sync) -> Result<Vec<T>, PriorsError> {
        let triangles = 0..self.model.mesh().triangles.len();
        triangles
            .into_par_iter()
            .map(|triangle| {
                let mut pieces = Vec::new();
                self.cut(triangle, &mut pieces)?;
                Ok(of_triangle(&pieces, triangle))
            })
            .collect()
    }

    fn cut(&self, triangle: usize, pieces: &mut Vec<Piece>) -> Result<(), PriorsError> {
        let weight = self.config.weight(self.model, triangle);
        if weight == 0.0 {
            return Ok(());
        }
        let corners = self.model.mesh().corners(triangle);
        // The creases of the pieces still to be cut, one list after the other; those of a piece end
        // where its parts' begin.
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
            if made > MAX_CUTS {
                return Err(PriorsError::TooMany { asked: (made / CUTS_PER_POINT) as u64, limit: LIMIT });
            }
            let [a, b, c] = [0, 1, 2].map(|i| corners[(longest + i) % 3]);
            let middle = [0, 1, 2].map(|i| 0.5 * (a[i] + b[i]));
            let radius = corners.iter().map(|&corner| norm(sub(corner, centre))).fold(0.0, f64::max);
            // At the far side of the piece the bound of a crease may be lower by the radius, and
            // all others' higher.
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
