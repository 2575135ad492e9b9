//! A triangle seen from an eye: three planes through its edges and one through itself, as linear functions of (x, y).
//!
//! With corners a, b, c in the frame of the eye, the ray (x, y, 1) passes an edge on the inner side where
//! (x, y, 1) · (b × c) ≥ 0 (2D homogeneous rasterisation, Olano and Greer 1997). The inverse depth of the plane is linear
//! as well: 1/t = (x, y, 1) · N / det with N = a × b + b × c + c × a and det = a · (b × c). The cross product of
//! an edge is exactly the opposite for the neighbour that runs along it the other way; and a ray counts as inside within the
//! rounding of that product (1e-15 of it), so none slips through between the triangles around a corner either.

use crate::eye::Eye;
use crate::simd::Lanes;
use numeric::vector::cross;

/// Roundings of f32 between an exact linear function and its value: both factors, the products, the sums; with reserve.
const ROUNDINGS: f64 = 6.0 * (f32::EPSILON as f64) / 2.0;
/// A triangle is seen edge-on when the ratio of its volume with the eye to the box of it is below this.
const EDGE_ON: f64 = 1e-14;

/// Roundings of f64 in the value of an edge function, in parts of the product of its corners' distances.
const EDGE_ROUNDING: f64 = 4.0 * f64::EPSILON;

/// A linear function c + a·x + b·y.
pub(crate) type Linear = [f64; 3];

/// A triangle seen from an eye, exact (f64).
#[derive(Debug, Clone, Copy)]
pub(crate) struct Facet {
    /// Non-negative inside, per edge.
    pub(crate) edges: [Linear; 3],
    /// What each edge function may be off by rounding, per 1 + |x| + |y|.
    pub(crate) edge_slack: [f64; 3],
    /// The inverse depth, 1/m.
    pub(crate) inverse_depth: Linear,
    /// Lowest depth of the corners, metres; negative where one is behind the eye.
    pub(crate) nearest: f64,
}

/// The same in f32, with bounds of the error over the rays of a tile.
#[derive(Debug, Clone, Copy)]
pub(crate) struct FastFacet {
    pub(crate) edges: [[f32; 3]; 3],
    pub(crate) edge_error: [f32; 3],
    pub(crate) inverse_depth: [f32; 3],
    pub(crate) inverse_error: f32,
    /// The largest inverse depth of the triangle.
    pub(crate) nearest_inverse: f32,
}

#[inline(always)]
fn norm1(a: [f64; 3]) -> f64 {
    a[0].abs() + a[1].abs() + a[2].abs()
}

/// The value of a linear function.
#[inline(always)]
pub(crate) fn value(linear: &Linear, x: f64, y: f64) -> f64 {
    linear[2] + linear[0] * x + linear[1] * y
}

impl Facet {
    /// The triangle as the eye sees it; `None` edge-on, when no ray meets its inside.
    #[inline(always)]
    pub(crate) fn new(eye: &Eye, corners: &[[f64; 3]; 3]) -> Option<Self> {
        let [a, b, c] = corners.map(|corner| eye.eye_from_world(corner));
        let edges = [cross(b, c), cross(c, a), cross(a, b)];
        let det = a[0] * edges[0][0] + a[1] * edges[0][1] + a[2] * edges[0][2];
        let (size_a, size_b, size_c) = (norm1(a), norm1(b), norm1(c));
        if det.abs() <= EDGE_ON * size_a * size_b * size_c {
            return None;
        }
        let edge_slack = [size_b * size_c, size_c * size_a, size_a * size_b].map(|product| EDGE_ROUNDING * product);
        // Seen from the other side all signs turn around, which costs no rounding.
        let sign = if det < 0.0 { -1.0 } else { 1.0 };
        let (edges, inverse) = (edges.map(|edge| edge.map(|n| sign * n)), 1.0 / det.abs());
        let normal = [0, 1, 2].map(|i| edges[0][i] + edges[1][i] + edges[2][i]);
        Some(Self { edges, edge_slack, inverse_depth: normal.map(|n| n * inverse), nearest: a[2].min(b[2]).min(c[2]) })
    }

    /// The inverse depth at which a ray meets the triangle.
    #[inline(always)]
    pub(crate) fn meets(&self, x: f64, y: f64) -> Option<f64> {
        let spread = 1.0 + x.abs() + y.abs();
        let inside = (0..3).all(|i| value(&self.edges[i], x, y) >= -self.edge_slack[i] * spread);
        let inverse = value(&self.inverse_depth, x, y);
        (inside && inverse > 0.0).then_some(inverse)
    }

    /// In f32, for rays with |x| ≤ `reach[0]` and |y| ≤ `reach[1]`.
    #[inline(always)]
    pub(crate) fn fast(&self, reach: [f64; 2]) -> FastFacet {
        let error = |l: &Linear, slack: f64| {
            let roundings = ROUNDINGS * (l[2].abs() + l[0].abs() * reach[0] + l[1].abs() * reach[1]);
            (roundings + slack * (1.0 + reach[0] + reach[1])) as f32
        };
        FastFacet {
            edges: self.edges.map(|edge| edge.map(|n| n as f32)),
            edge_error: [0, 1, 2].map(|i| error(&self.edges[i], self.edge_slack[i])),
            inverse_depth: self.inverse_depth.map(|n| n as f32),
            inverse_error: error(&self.inverse_depth, 0.0),
            nearest_inverse: if self.nearest > 0.0 { (1.000_001 / self.nearest) as f32 } else { f32::INFINITY },
        }
    }
}

/// Eight values of a linear function in f32.
#[inline(always)]
pub(crate) fn values<V: Lanes>(linear: &[f32; 3], x: V, y: V) -> V {
    V::splat(linear[2]).add(V::splat(linear[0]).mul(x)).add(V::splat(linear[1]).mul(y))
}
