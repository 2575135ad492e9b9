//! Geometry of rings in their plane: constraints of a triangulation, crossings, and points inside.

use spade::handles::FixedVertexHandle;
use spade::{ConstrainedDelaunayTriangulation, HasPosition, Point2, Triangulation as _};

/// Limit of the vertices that the crossings of one polygon may add.
pub(super) const MAX_CROSSINGS: usize = 20_000;

/// A vertex in the plane of its polygon.
#[derive(Debug, Clone, Copy)]
pub(super) struct Corner {
    pub(super) at: Point2<f64>,
    /// Index of the vertex; `None` for a vertex that was added where edges cross.
    pub(super) vertex: Option<u32>,
}

impl HasPosition for Corner {
    type Scalar = f64;

    fn position(&self) -> Point2<f64> {
        self.at
    }
}

/// Constrained Delaunay triangulation of the corners of a polygon.
pub(super) type Cdt = ConstrainedDelaunayTriangulation<Corner>;

pub(super) fn midpoint(a: Point2<f64>, b: Point2<f64>) -> Point2<f64> {
    Point2::new(0.5 * (a.x + b.x), 0.5 * (a.y + b.y))
}

/// Inserts a ring and its edges as constraints, except for edges that cross another constraint.
///
/// Returns whether no edge was left out, or `None` when `spade` refuses a coordinate. Without
/// `patient` it stops at the first edge that crosses.
pub(super) fn constrain_ring(cdt: &mut Cdt, ring: &[Corner], patient: bool) -> Option<bool> {
    let handles: Vec<FixedVertexHandle> = ring.iter().map(|&corner| cdt.insert(corner).ok()).collect::<Option<_>>()?;
    let mut complete = true;
    for (i, &from) in handles.iter().enumerate() {
        let to = handles[(i + 1) % handles.len()];
        if from != to && cdt.can_add_constraint(from, to) {
            cdt.add_constraint(from, to);
        } else if from != to {
            complete = false;
            if !patient {
                break;
            }
        }
    }
    Some(complete)
}

/// Iterates over the edges of a ring.
pub(super) fn ring_edges(ring: &[Corner]) -> impl Iterator<Item = [Point2<f64>; 2]> + '_ {
    (0..ring.len()).map(|i| [ring[i].at, ring[(i + 1) % ring.len()].at])
}

/// Returns the ring with a new vertex at each crossing of one of its edges with one of `edges`.
pub(super) fn split_at_crossings(ring: &[Corner], edges: &[[Point2<f64>; 2]]) -> Vec<Corner> {
    let mut split = Vec::with_capacity(ring.len());
    for (corner, edge) in ring.iter().zip(ring_edges(ring)) {
        split.push(*corner);
        let mut cuts: Vec<(f64, Point2<f64>)> = edges.iter().filter_map(|&other| crossing(edge, other)).collect();
        cuts.sort_by(|a, b| a.0.total_cmp(&b.0));
        split.extend(cuts.into_iter().map(|(_, at)| Corner { at, vertex: None }));
        if split.len() > ring.len() + MAX_CROSSINGS {
            break;
        }
    }
    split
}

/// Returns the crossing of two edges inside both: the fraction along the first one, and the place.
fn crossing([a, b]: [Point2<f64>; 2], [c, d]: [Point2<f64>; 2]) -> Option<(f64, Point2<f64>)> {
    let side = |p: Point2<f64>, q: Point2<f64>, r: Point2<f64>| (q.x - p.x) * (r.y - p.y) - (q.y - p.y) * (r.x - p.x);
    let (from, to) = (side(c, d, a), side(c, d, b));
    let crosses = from * to < 0.0 && side(a, b, c) * side(a, b, d) < 0.0;
    let t = from / (from - to);
    // Computing the place along the edge with the lower coordinates gives the same place for both
    // edges.
    let along = |p: Point2<f64>, q: Point2<f64>, t: f64| Point2::new(p.x + t * (q.x - p.x), p.y + t * (q.y - p.y));
    crosses.then(|| {
        let key = |p: Point2<f64>, q: Point2<f64>| [p.x, p.y, q.x, q.y];
        let at = if key(a, b) <= key(c, d) {
            along(a, b, t)
        } else {
            let (start, end) = (side(a, b, c), side(a, b, d));
            along(c, d, start / (start - end))
        };
        (t, at)
    })
}

/// Returns whether a point is inside a ring, by the even-odd rule.
pub(super) fn contains(ring: &[Corner], point: Point2<f64>) -> bool {
    let mut inside = false;
    let mut from = match ring.last() {
        Some(corner) => corner.at,
        None => return false,
    };
    for corner in ring {
        let to = corner.at;
        if (from.y > point.y) != (to.y > point.y) {
            let x = from.x + (point.y - from.y) / (to.y - from.y) * (to.x - from.x);
            inside ^= point.x < x;
        }
        from = to;
    }
    inside
}
