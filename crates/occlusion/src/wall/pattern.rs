//! Finds the cells around that are above a level, and the line or circle that separates them from
//! the others.
//!
//! The curve is the one of the widest margin in the sense of Vapnik, found by Newton steps on the
//! squared hinge loss: centres farther from it than the margin do not count, the others count less
//! the farther they are from the middle. If no curve separates the centres, the result is wrong
//! about few of them.

use nalgebra::{Matrix4, Vector4};
use raster::Grid;

use super::curve::Curve;
use super::sample::Sample;

/// Reach of the centres on either side of the four cells, cells.
const REACH: isize = 3;
/// Standard deviation of the weights, cells.
const SIGMA: f32 = 1.3;
/// Newton steps; most settle after four.
const STEPS: usize = 8;
/// Penalties of the squares of slope and curvature: small, so that the centres next to the curve
/// set the margin.
const SLOPE_COST: f64 = 3e-4;
const CURVATURE_COST: f64 = 0.03;

/// The centres around the four cells of which the first is at `corner`.
pub(super) fn samples(cells: &Grid<f32>, corner: (usize, usize), level: f32) -> Vec<Sample> {
    let around = |at: usize, by: isize, size: usize| at.checked_add_signed(by).filter(|&i| i < size);
    let mut found = Vec::with_capacity(64);
    for j in -REACH..=REACH + 1 {
        let Some(row) = around(corner.1, j, cells.height()) else { continue };
        for i in -REACH..=REACH + 1 {
            let Some(column) = around(corner.0, i, cells.width()) else { continue };
            let height = cells[(column, row)];
            if height.is_finite() {
                let place = [i as f32 - 0.5, j as f32 - 0.5];
                let squared = place[0] * place[0] + place[1] * place[1];
                let weight = (-squared / (2.0 * SIGMA * SIGMA)).exp();
                found.push(Sample { place, side: if height > level { 1.0 } else { -1.0 }, weight });
            }
        }
    }
    found
}

/// The line of the widest margin, or the circle where `round`; `None` where the centres do not
/// determine it.
pub(super) fn part(samples: &[Sample], round: bool) -> Option<Curve> {
    let mut curve = Vector4::zeros();
    let mut counted = 0;
    for _ in 0..STEPS {
        let (normal, right, counts) = equations(samples, &curve, round);
        if counts == counted {
            break;
        }
        (curve, counted) = (normal.cholesky()?.solve(&right), counts);
    }
    let slope = curve.x.hypot(curve.y);
    let [a, b, c, k] = [curve.x, curve.y, curve.z, curve.w].map(|v| (v / slope) as f32);
    (slope > 1e-6).then_some(Curve { a, b, c, k })
}

/// The normal equations of the centres within the margin of a curve, and which these are, a bit
/// each.
fn equations(samples: &[Sample], curve: &Vector4<f64>, round: bool) -> (Matrix4<f64>, Vector4<f64>, u64) {
    // In terms of 1, x, y and, for circles, q = x² + y².
    let (mut one, mut x1, mut y1, mut q1) = (1e-6, 0.0, 0.0, 0.0);
    let (mut xx, mut xy, mut yy) = (SLOPE_COST, 0.0, SLOPE_COST);
    let (mut xq, mut yq, mut qq) = (0.0, 0.0, CURVATURE_COST);
    let (mut right, mut counts) = (Vector4::zeros(), 0);
    for (bit, sample) in samples.iter().enumerate() {
        let [x, y] = sample.place.map(f64::from);
        let q = if round { x * x + y * y } else { 0.0 };
        let (side, w) = (f64::from(sample.side), f64::from(sample.weight));
        if side * (curve.x * x + curve.y * y + curve.z + curve.w * q) < 1.0 {
            counts |= 1_u64 << (bit % 64);
            let (wx, wy, wq) = (w * x, w * y, w * q);
            (one, x1, y1, q1) = (one + w, x1 + wx, y1 + wy, q1 + wq);
            (xx, xy, yy) = (xx + wx * x, xy + wx * y, yy + wy * y);
            (xq, yq, qq) = (xq + wx * q, yq + wy * q, qq + wq * q);
            right += side * Vector4::new(wx, wy, w, wq);
        }
    }
    #[rustfmt::skip]
    let normal = Matrix4::new(
        xx, xy, x1, xq,
        xy, yy, y1, yq,
        x1, y1, one, q1,
        xq, yq, q1, qq,
    );
    (normal, right, counts)
}
