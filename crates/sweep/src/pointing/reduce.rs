//! What a track says of the corrections, whatever its ground point.
//!
//! With J the Jacobian of a track's projections with respect to its ground point and B the design
//! matrix of the corrections x, the residuals r = B x + J g hold for any ground step g. With
//! J = Q R, the projection P = I − Q Qᵀ removes g: `P (r − B x) = 0`. B has one block per view, so
//! that BᵀPB has one small block per pair of views of the track: this is the Schur complement of
//! the ground point in the normal equations.

use camera::{ImagePoint, RpcCamera};
use geodesy::LonLatHeight;
use nalgebra::{Matrix2x3, SMatrix, Vector2, Vector3};

use super::block_system::BlockSystem;
use super::intersect::{Known, Track, intersect};
use super::model::{ModelOrder, OwnDesign, PARAMETERS, own_design};

/// A track's residuals without those that its ground point explains.
pub(super) struct Reduced {
    /// Ground point under the cameras that were given.
    pub(super) ground: LonLatHeight,
    parts: Vec<Part>,
    /// Sum of the squared residuals, square pixels.
    square: f64,
    /// Number of residuals less that of the unknowns of the ground point.
    freedom: usize,
}

/// The part of one view.
struct Part {
    view: usize,
    residual: Vector2<f64>,
    design: OwnDesign,
    /// Rows of Q.
    explained: Matrix2x3<f64>,
}

impl Reduced {
    /// Finds a track's ground point, and its residuals without those that the ground point
    /// explains. Returns `None` if the rays do not meet, or the track has fewer than two views and
    /// no known position.
    pub(super) fn of(
        cameras: &[RpcCamera],
        sizes: &[(usize, usize)],
        track: &Track,
        order: ModelOrder,
        (known, start): (Option<&Known>, Option<LonLatHeight>),
    ) -> Option<Self> {
        let known_rows = if known.is_some() { 3 } else { 0 };
        let freedom = (2 * track.len() + known_rows).checked_sub(3).filter(|freedom| *freedom > 0)?;
        let found = intersect(cameras, track, known, start)?;
        let mut rows: Vec<(f64, Vector3<f64>)> = Vec::with_capacity(2 * track.len() + known_rows);
        for (residual, jacobian) in &found.seen {
            rows.extend((0..2).map(|axis| (residual[axis], jacobian.row(axis).transpose())));
        }
        if let Some(known) = known {
            let row = |axis: usize| (found.known_px[axis], Vector3::ith(axis, known.px_per_m[axis]));
            rows.extend((0..3).map(row));
        }
        orthonormalise(&mut rows)?;
        let explained: Vector3<f64> = rows.iter().map(|(r, q)| q * *r).sum();
        rows.iter_mut().for_each(|(r, q)| *r -= q.dot(&explained));
        let square = rows.iter().map(|(r, _)| r * r).sum();
        let part = |(i, (view, place)): (usize, &(usize, ImagePoint))| {
            let [(r0, q0), (r1, q1)] = [&rows[2 * i], &rows[2 * i + 1]];
            Part {
                view: *view,
                residual: Vector2::new(*r0, *r1),
                design: own_design(*place, sizes[*view], order),
                explained: Matrix2x3::from_rows(&[q0.transpose(), q1.transpose()]),
            }
        };
        let parts = track.iter().enumerate().map(part).collect();
        Some(Self { ground: found.ground, parts, square, freedom })
    }

    /// Returns the root mean square of the residuals per degree of freedom, pixels.
    pub(super) fn norm_px(&self) -> f64 {
        (self.square / self.freedom as f64).sqrt()
    }

    /// Returns the root mean square residual in each view per degree of freedom, pixels.
    pub(super) fn by_view(&self) -> impl Iterator<Item = (usize, f64)> {
        let share = self.parts.len() as f64 / self.freedom as f64;
        self.parts.iter().map(move |part| (part.view, (share * part.residual.norm_squared()).sqrt()))
    }

    /// Adds the track's normal equations with a weight.
    pub(super) fn add_to(&self, system: &mut BlockSystem, weight: f64) {
        let ground: Vec<SMatrix<f64, PARAMETERS, 3>> =
            self.parts.iter().map(|part| part.design.transpose() * part.explained).collect();
        for (i, part) in self.parts.iter().enumerate() {
            system.add_right(part.view, &(part.design.transpose() * part.residual * weight));
            let own = part.design.transpose() * part.design - ground[i] * ground[i].transpose();
            system.add(part.view, part.view, &(own * weight));
            for (j, other) in self.parts[..i].iter().enumerate() {
                let (row, column) = if part.view >= other.view { (i, j) } else { (j, i) };
                let shared = ground[row] * ground[column].transpose() * -weight;
                // A view that sees the point twice has both parts in its own block.
                let both = if part.view == other.view { shared + shared.transpose() } else { shared };
                system.add(self.parts[row].view, self.parts[column].view, &both);
            }
        }
    }
}

/// Makes the three columns of the Jacobian orthonormal (modified Gram–Schmidt, twice for the sake
/// of nearly parallel lines of sight). Returns `None` when they are dependent.
fn orthonormalise(rows: &mut [(f64, Vector3<f64>)]) -> Option<()> {
    for _ in 0..2 {
        for column in 0..3 {
            for earlier in 0..column {
                let along: f64 = rows.iter().map(|(_, q)| q[earlier] * q[column]).sum();
                rows.iter_mut().for_each(|(_, q)| q[column] -= along * q[earlier]);
            }
            let norm = rows.iter().map(|(_, q)| q[column] * q[column]).sum::<f64>().sqrt();
            if norm.is_nan() || norm <= 0.0 {
                return None;
            }
            rows.iter_mut().for_each(|(_, q)| q[column] /= norm);
        }
    }
    Some(())
}
