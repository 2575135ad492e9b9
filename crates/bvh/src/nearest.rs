//! The point of the triangles that is nearest to a position.
//!
//! Boxes are visited from near to far, and those farther than the nearest triangle so far are
//! skipped. Boxes are rounded outwards, so that none is farther than what it holds; distances are
//! f64. The nearest point of a triangle is that of the region of its plane that the position lies
//! over: corner, edge or inside (Ericson, Real-Time Collision Detection, 2005, 5.1.5).

use crate::Bvh;
use crate::node::{Child, Node, WIDTH};
use numeric::vector::{Vector, along, dot, sub};

/// Share by which a squared distance to a box may be too great through rounding.
const ROUNDING: f64 = 1e-12;

/// The nearest point of the triangles.
#[derive(Debug, Clone, Copy, PartialEq)]
pub struct NearestPoint {
    /// Index of the triangle; the lowest of several at the same distance.
    pub triangle: u32,
    /// The point on the triangle, metres from the local origin.
    pub point: [f64; 3],
    /// Its distance from the position, metres.
    pub distance_m: f64,
}

impl Bvh {
    /// Returns the point of the triangles that is nearest to a position, if there is one within a
    /// distance in metres. Triangles whose three corners are one point are not there.
    ///
    /// # Examples
    /// ```
    /// use bvh::Bvh;
    ///
    /// let square = [[0.0, 0.0, 5.0], [1.0, 0.0, 5.0], [1.0, 1.0, 5.0], [0.0, 1.0, 5.0]];
    /// let tree = Bvh::new(&square, &[[0, 1, 2], [0, 2, 3]])?;
    /// let found = tree.nearest([3.0, 0.5, 5.0], 2.0).expect("the square is 2 m away");
    /// assert_eq!((found.triangle, found.point, found.distance_m), (0, [1.0, 0.5, 5.0], 2.0));
    /// assert!(tree.nearest([3.0, 0.5, 5.0], 1.9).is_none());
    /// # Ok::<(), bvh::BvhError>(())
    /// ```
    pub fn nearest(&self, position: [f64; 3], within_m: f64) -> Option<NearestPoint> {
        if self.is_empty() || !position.iter().all(|c| c.is_finite()) || within_m.is_nan() || within_m < 0.0 {
            return None;
        }
        let mut best: Option<(f64, u32, Vector)> = None;
        let mut limit = within_m * within_m;
        let mut stack: Vec<(Child, f64)> = Vec::with_capacity(64);
        stack.push((Child::node(0), 0.0));
        while let Some((child, squared)) = stack.pop() {
            if squared > limit {
                continue;
            }
            let Some(triangles) = child.triangles() else {
                let node = &self.nodes[child.index()];
                let first = stack.len();
                for slot in 0..WIDTH {
                    let squared = squared_distance(node, slot, position);
                    if squared.is_finite() && squared <= limit {
                        stack.push((node.children[slot], squared));
                    }
                }
                stack[first..].sort_unstable_by(|a, b| b.1.total_cmp(&a.1));
                continue;
            };
            for number in triangles {
                let corners = &self.corners[number];
                if corners[1] == corners[0] && corners[2] == corners[0] {
                    continue;
                }
                let point = nearest_of_triangle(position, corners);
                let offset = sub(position, point);
                let (squared, index) = (dot(offset, offset), self.index_of[number]);
                let is_nearer = best.is_none_or(|(known, other, _)| squared < known || index < other);
                if squared <= limit && is_nearer {
                    best = Some((squared, index, point));
                    limit = squared;
                }
            }
        }
        best.map(|(squared, triangle, point)| NearestPoint { triangle, point, distance_m: squared.sqrt() })
    }
}

/// Returns at most the squared distance of a position from a child's box; +∞ where there is none.
fn squared_distance(node: &Node, slot: usize, position: Vector) -> f64 {
    let outside = |axis: usize| {
        let (low, high) = (f64::from(node.low[axis][slot]), f64::from(node.high[axis][slot]));
        (low - position[axis]).max(position[axis] - high).max(0.0)
    };
    (1.0 - ROUNDING) * (0..3).map(|axis| outside(axis).powi(2)).sum::<f64>()
}

/// Returns the point of a triangle that is nearest to a position.
fn nearest_of_triangle(p: Vector, &[a, b, c]: &[Vector; 3]) -> Vector {
    let (ab, ac) = (sub(b, a), sub(c, a));
    let from = |corner: Vector| [dot(ab, sub(p, corner)), dot(ac, sub(p, corner))];
    let ([a1, a2], [b1, b2], [c1, c2]) = (from(a), from(b), from(c));
    if a1 <= 0.0 && a2 <= 0.0 {
        return a;
    }
    if b1 >= 0.0 && b2 <= b1 {
        return b;
    }
    let over_c = a1 * b2 - b1 * a2;
    if over_c <= 0.0 && a1 >= 0.0 && b1 <= 0.0 {
        return along(a, a1 / (a1 - b1), ab);
    }
    if c2 >= 0.0 && c1 <= c2 {
        return c;
    }
    let over_b = c1 * a2 - a1 * c2;
    if over_b <= 0.0 && a2 >= 0.0 && c2 <= 0.0 {
        return along(a, a2 / (a2 - c2), ac);
    }
    let over_a = b1 * c2 - c1 * b2;
    if over_a <= 0.0 && b2 >= b1 && c1 >= c2 {
        return along(b, (b2 - b1) / ((b2 - b1) + (c1 - c2)), sub(c, b));
    }
    let sum = over_a + over_b + over_c;
    along(along(a, over_b / sum, ab), over_c / sum, ac)
}
