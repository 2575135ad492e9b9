//! Triangulation of a ring by ear clipping: a corner whose triangle contains no other corner is cut
//! off, then the next.
//!
//! A Delaunay triangulation is the better choice for a planar polygon. A polygon that is not planar
//! is a different surface under every triangulation, and none of them is right. Ear clipping
//! (Meisters 1975), in the order of the widely used library `earcut`, gives the same surface as
//! other tools.

use std::cmp::Ordering;

/// Cuts a counter-clockwise ring without holes into triangles.
///
/// Returns `None` when no ear is left, which happens in rings that intersect themselves.
pub(crate) fn cut(ring: &[[f64; 2]]) -> Option<Vec<[usize; 3]>> {
    let count = ring.len();
    let mut next: Vec<usize> = (0..count).map(|i| (i + 1) % count).collect();
    let mut previous: Vec<usize> = (0..count).map(|i| (i + count - 1) % count).collect();
    let mut triangles = Vec::with_capacity(count.saturating_sub(2));
    let mut ear = count.checked_sub(1)?;
    let mut stop = ear;
    while previous[ear] != next[ear] {
        let (before, after) = (previous[ear], next[ear]);
        if is_ear(ring, before, ear, after, &previous, &next) {
            triangles.push([before, ear, after]);
            (next[before], previous[after]) = (after, before);
            (ear, stop) = (after, after);
            continue;
        }
        ear = after;
        if ear == stop {
            return None;
        }
    }
    (triangles.len() + 2 == count).then_some(triangles)
}

/// Returns twice the area of a triangle, positive when it is counter-clockwise.
fn area(a: [f64; 2], b: [f64; 2], c: [f64; 2]) -> f64 {
    (b[0] - a[0]) * (c[1] - b[1]) - (b[1] - a[1]) * (c[0] - b[0])
}

/// Returns whether the triangle at corner `ear` is convex and contains no other corner.
fn is_ear(ring: &[[f64; 2]], before: usize, ear: usize, after: usize, previous: &[usize], next: &[usize]) -> bool {
    let [a, b, c] = [ring[before], ring[ear], ring[after]];
    if area(a, b, c).partial_cmp(&0.0) != Some(Ordering::Greater) {
        return false;
    }
    let mut at = next[after];
    while at != before {
        let p = ring[at];
        // If any corner is inside, then a reflex one is, so the others need no test.
        let inside = area(a, b, p) >= 0.0 && area(b, c, p) >= 0.0 && area(c, a, p) >= 0.0;
        if inside && p != a && area(ring[previous[at]], p, ring[next[at]]) <= 0.0 {
            return false;
        }
        at = next[at];
    }
    true
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn a_quadrilateral_is_cut_from_its_first_corner() {
        let square = [[0.0, 0.0], [1.0, 0.0], [1.0, 1.0], [0.0, 1.0]];
        assert_eq!(cut(&square), Some(vec![[2, 3, 0], [2, 0, 1]]));
    }

    #[test]
    fn rings_with_inner_corners_are_covered() {
        let comb = [
            [0.0, 0.0],
            [9.0, 0.0],
            [9.0, 5.0],
            [8.0, 5.0],
            [8.0, 1.0],
            [5.0, 1.0],
            [5.0, 5.0],
            [4.0, 5.0],
            [4.0, 1.0],
            [1.0, 1.0],
            [1.0, 5.0],
            [0.0, 5.0],
        ];
        let triangles = cut(&comb).unwrap();
        let areas: Vec<f64> = triangles.iter().map(|&[a, b, c]| area(comb[a], comb[b], comb[c])).collect();
        assert!(areas.iter().all(|&a| a > 0.0));
        assert!((areas.iter().sum::<f64>() - 2.0 * (9.0 + 3.0 * 4.0)).abs() < 1e-12);
    }

    #[test]
    fn rings_that_are_none() {
        assert_eq!(cut(&[]), None);
        assert_eq!(cut(&[[0.0, 0.0], [1.0, 0.0]]), Some(vec![]));
        assert_eq!(cut(&[[0.0, 0.0], [1.0, 1.0], [1.0, 0.0], [0.0, 1.0]]), None, "a bow tie");
        assert_eq!(cut(&[[f64::NAN; 2]; 5]), None);
    }
}
