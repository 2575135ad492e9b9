//! Prepares rings for triangulation: fits a plane by Newell's method, and removes repeated vertices
//! and spikes.

use numeric::vector::{Vector, cross, dot, norm, scale, sub, unit};

/// Plane fitted to a ring. The ring is counter-clockwise when the normal points at the viewer.
#[derive(Debug, Clone, Copy, PartialEq)]
pub(crate) struct Plane {
    /// A point of the plane: the mean of the vertices.
    pub(crate) point: Vector,
    /// Unit normal.
    pub(crate) normal: Vector,
    /// Area of the projection of the ring onto the plane, square metres.
    pub(crate) area: f64,
}

impl Plane {
    /// Fits the plane through the mean of the vertices with Newell's normal.
    ///
    /// Returns `None` when the area of the ring is lost in the rounding of its size: fewer than
    /// three vertices, or all of them on a line.
    pub(crate) fn of_ring(ring: &[Vector]) -> Option<Self> {
        let first = *ring.first()?;
        let local = |i: usize| sub(ring[i % ring.len()], first);
        let doubled = (1..ring.len()).map(|i| cross(local(i), local(i + 1)));
        let doubled = doubled.fold([0.0; 3], |sum, c| [sum[0] + c[0], sum[1] + c[1], sum[2] + c[2]]);
        let size = ring.iter().map(|&p| norm(sub(p, first))).fold(0.0, f64::max);
        let area = 0.5 * norm(doubled);
        if area.partial_cmp(&(1e-9 * size * size)) != Some(std::cmp::Ordering::Greater) {
            return None;
        }
        let sum = ring.iter().map(|&p| sub(p, first)).fold([0.0; 3], |s, p| [s[0] + p[0], s[1] + p[1], s[2] + p[2]]);
        let mean = scale(sum, 1.0 / ring.len() as f64);
        let point = [first[0] + mean[0], first[1] + mean[1], first[2] + mean[2]];
        Some(Self { point, normal: unit(doubled)?, area })
    }

    /// Returns the signed distance of a point, positive on the side of the normal.
    pub(crate) fn distance(&self, point: Vector) -> f64 {
        dot(self.normal, sub(point, self.point))
    }

    /// Returns two unit vectors in the plane that form a right-handed frame with the normal.
    pub(crate) fn axes(&self) -> (Vector, Vector) {
        let n = self.normal;
        // The coordinate axis with the smallest component of the normal keeps the cross product
        // long.
        let least = (0..3).min_by(|&a, &b| n[a].abs().total_cmp(&n[b].abs())).unwrap_or(0);
        let mut axis = [0.0; 3];
        axis[least] = 1.0;
        let u = unit(cross(axis, n)).unwrap_or([1.0, 0.0, 0.0]);
        (u, cross(n, u))
    }
}

/// Counts of what cleaning removed from a ring.
#[derive(Debug, Clone, Copy, PartialEq, Eq, Default)]
pub(crate) struct Cleaned {
    /// Vertices that repeated the one before.
    pub(crate) repeated: usize,
    /// Tips of spikes a → b → a.
    pub(crate) spikes: usize,
}

/// Removes vertices that repeat the one before, and the tips b of spikes a → b → a, also across the
/// end of the ring.
pub(crate) fn clean(ring: &mut Vec<u32>, same: impl Fn(u32, u32) -> bool) -> Cleaned {
    let mut found = Cleaned::default();
    let mut kept: Vec<u32> = Vec::with_capacity(ring.len());
    for &vertex in ring.iter() {
        push_clean(&mut kept, vertex, &same, &mut found);
    }
    loop {
        let n = kept.len();
        if n > 1 && same(kept[0], kept[n - 1]) {
            found.repeated += 1;
            kept.pop();
        } else if n > 2 && same(kept[0], kept[n - 2]) {
            found.spikes += 1;
            kept.truncate(n - 2);
        } else if n > 2 && same(kept[1], kept[n - 1]) {
            found.spikes += 1;
            kept.remove(0);
            kept.pop();
        } else {
            break;
        }
    }
    *ring = kept;
    found
}

/// Appends a vertex to a clean ring, unless it repeats the last one or ends a spike.
fn push_clean(kept: &mut Vec<u32>, vertex: u32, same: &impl Fn(u32, u32) -> bool, found: &mut Cleaned) {
    if kept.last().is_some_and(|&last| same(last, vertex)) {
        found.repeated += 1;
        return;
    }
    if kept.len() >= 2 && same(kept[kept.len() - 2], vertex) {
        found.spikes += 1;
        kept.pop();
        return;
    }
    kept.push(vertex);
}

#[cfg(test)]
mod tests {
    use super::*;

    fn cleaned(ring: &[u32]) -> (Vec<u32>, Cleaned) {
        let mut ring = ring.to_vec();
        let found = clean(&mut ring, |a, b| a == b);
        (ring, found)
    }

    #[test]
    fn repeated_vertices_and_spikes_go() {
        assert_eq!(cleaned(&[1, 2, 3, 4]), (vec![1, 2, 3, 4], Cleaned::default()));
        assert_eq!(cleaned(&[1, 2, 2, 3, 1]), (vec![1, 2, 3], Cleaned { repeated: 2, spikes: 0 }));
        assert_eq!(cleaned(&[1, 2, 9, 2, 3]), (vec![1, 2, 3], Cleaned { repeated: 0, spikes: 1 }));
        assert_eq!(cleaned(&[9, 1, 2, 3, 1]).0, vec![1, 2, 3]);
        assert_eq!(cleaned(&[1, 2, 3, 1, 9]).0, vec![1, 2, 3]);
        assert!(cleaned(&[1, 2, 3, 2]).0.len() < 3);
        assert!(cleaned(&[5, 5, 5]).0.len() < 3);
    }

    #[test]
    fn the_plane_of_a_ring_looks_at_its_viewer() {
        let square = [[10.0, 0.0, 2.0], [11.0, 0.0, 2.0], [11.0, 1.0, 2.0], [10.0, 1.0, 2.0]];
        let plane = Plane::of_ring(&square).unwrap();
        assert_eq!((plane.normal, plane.area), ([0.0, 0.0, 1.0], 1.0));
        assert_eq!(plane.distance([0.0, 0.0, 5.0]), 3.0);
        let (u, v) = plane.axes();
        assert_eq!(cross(u, v), plane.normal);
        let line = [[0.0, 0.0, 0.0], [1.0, 1.0, 1.0], [2.0, 2.0, 2.0]];
        assert!(Plane::of_ring(&line).is_none() && Plane::of_ring(&[]).is_none());
        assert!(Plane::of_ring(&[[f64::NAN; 3]; 3]).is_none());
    }
}
