//! A triangle as an eye sees it: four linear functions of the image position (x, y).
//!
//! Three of them tell on which side of an edge a ray passes, the fourth is the inverse depth.
//!
//! With corners a, b, c in the frame of the eye, the ray (x, y, 1) passes an edge on the inner side
//! where (x, y, 1) · (b × c) ≥ 0 (2D homogeneous rasterisation, Olano and Greer 1997). The inverse
//! depth is linear too: 1/t = (x, y, 1) · N / det with N = a × b + b × c + c × a and det = a · (b ×
//! c). The neighbour of a triangle runs along their common edge the other way, so its cross product
//! is exactly the negative one. A ray counts as inside within the rounding of that product (1e-15
//! of it), so that none slips through where several triangles meet.

use crate::eye::Eye;
use crate::simd::{InstructionSet, Lanes};
use numeric::vector::cross;

/// Bound on the f32 rounding of a linear function: of both factors, the products and the sums, with
/// a reserve.
const ROUNDINGS: f64 = 6.0 * (f32::EPSILON as f64) / 2.0;
/// A triangle is edge-on if its volume with the eye is a smaller share of its bounding box than
/// this.
const EDGE_ON: f64 = 1e-14;

/// Bound on the f64 rounding of an edge function, as a share of the product of its corners'
/// distances.
const EDGE_ROUNDING: f64 = 4.0 * f64::EPSILON;

/// Coefficients of a linear function a·x + b·y + c.
pub(crate) type Linear = [f64; 3];

/// A triangle as an eye sees it, in f64.
#[derive(Debug, Clone, Copy)]
pub(crate) struct Facet {
    /// Edge functions, non-negative inside.
    pub(crate) edges: [Linear; 3],
    /// Rounding error of each edge function, per 1 + |x| + |y|.
    pub(crate) edge_slack: [f64; 3],
    /// Inverse depth, 1/m.
    pub(crate) inverse_depth: Linear,
    /// Lowest depth of the corners, metres; negative where one is behind the eye.
    pub(crate) nearest: f64,
}

/// The same functions in f32, with error bounds that hold for all rays of a tile.
#[derive(Debug, Clone, Copy)]
pub(crate) struct FastFacet {
    pub(crate) edges: [[f32; 3]; 3],
    pub(crate) edge_error: [f32; 3],
    pub(crate) inverse_depth: [f32; 3],
    pub(crate) inverse_error: f32,
    /// Largest inverse depth of the triangle, 1/m.
    pub(crate) nearest_inverse: f32,
}

#[inline(always)]
fn norm1(a: [f64; 3]) -> f64 {
    a[0].abs() + a[1].abs() + a[2].abs()
}

/// Returns the value of a linear function.
#[inline(always)]
pub(crate) fn value(linear: &Linear, x: f64, y: f64) -> f64 {
    linear[2] + linear[0] * x + linear[1] * y
}

impl Facet {
    /// Returns the triangle as the eye sees it, `None` if it is edge-on and no ray can meet its
    /// inside.
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
        // For the other side of the triangle all signs are reversed, which is exact.
        let sign = if det < 0.0 { -1.0 } else { 1.0 };
        let (edges, inverse) = (edges.map(|edge| edge.map(|n| sign * n)), 1.0 / det.abs());
        let normal = [0, 1, 2].map(|i| edges[0][i] + edges[1][i] + edges[2][i]);
        Some(Self { edges, edge_slack, inverse_depth: normal.map(|n| n * inverse), nearest: a[2].min(b[2]).min(c[2]) })
    }

    /// Returns the inverse depth at which a ray meets the triangle, `None` if it does not.
    #[inline(always)]
    pub(crate) fn meets(&self, x: f64, y: f64) -> Option<f64> {
        let spread = 1.0 + x.abs() + y.abs();
        let inside = (0..3).all(|i| value(&self.edges[i], x, y) >= -self.edge_slack[i] * spread);
        let inverse = value(&self.inverse_depth, x, y);
        (inside && inverse > 0.0).then_some(inverse)
    }

    /// Returns the functions in f32 with error bounds for rays with |x| ≤ `reach[0]` and |y| ≤
    /// `reach[1]`.
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

/// Returns eight values of a linear function in f32.
#[inline(always)]
pub(crate) fn values<I: InstructionSet>(isa: I, linear: &[f32; 3], x: I::Lanes, y: I::Lanes) -> I::Lanes {
    isa.splat(linear[2]).add(isa.splat(linear[0]).mul(x)).add(isa.splat(linear[1]).mul(y))
}
