//! Checks for polygons of all kinds the area of their triangles and their defects.

use super::*;
use proptest::prelude::*;

/// Cuts rings in a tilted plane away from the origin, and returns the area of the triangles and the
/// defects.
fn cut(rings: &[&[[f64; 2]]]) -> (f64, Vec<u16>) {
    let (u, v) = ([0.6, 0.0, 0.8], [0.0, 1.0, 0.0]);
    let lift = |p: &[f64; 2]| [0, 1, 2].map(|i| 100.0 + p[0] * u[i] + p[1] * v[i]);
    let points: Vec<Vector> = rings.iter().flat_map(|ring| ring.iter().map(lift)).collect();
    let mut next = 0;
    let indexed: Vec<Vec<u32>> = rings
        .iter()
        .map(|ring| {
            next += ring.len() as u32;
            (next - ring.len() as u32..next).collect()
        })
        .collect();
    let out = triangulate(&indexed, |i| points[i as usize]);
    let normal = cross(u, v);
    let at = |i: u32| out.added.get((u32::MAX - i) as usize).copied().unwrap_or_else(|| points[i as usize]);
    let area = |t: &[u32; 3]| 0.5 * dot(normal, cross(sub(at(t[1]), at(t[0])), sub(at(t[2]), at(t[0]))));
    (out.triangles.iter().map(area).sum(), out.findings.iter().map(|f| f.code.number()).collect())
}

fn square(x: f64, y: f64, size: f64) -> Vec<[f64; 2]> {
    vec![[x, y], [x + size, y], [x + size, y + size], [x, y + size]]
}

fn reversed(mut ring: Vec<[f64; 2]>) -> Vec<[f64; 2]> {
    ring.reverse();
    ring
}

#[track_caller]
fn covers(rings: &[&[[f64; 2]]], area: f64, codes: &[u16]) {
    let (found, defects) = cut(rings);
    assert!((found - area).abs() < 1e-9, "area {found}, expected {area}");
    assert_eq!(defects, codes);
}

#[test]
fn plain_polygons() {
    covers(&[&[[0.0, 0.0], [2.0, 0.0], [0.0, 2.0]]], 2.0, &[]);
    covers(&[&square(0.0, 0.0, 3.0)], 9.0, &[]);
    // An L, a concave kite, and a square with corners on its edges.
    covers(&[&[[0.0, 0.0], [2.0, 0.0], [2.0, 1.0], [1.0, 1.0], [1.0, 2.0], [0.0, 2.0]]], 3.0, &[]);
    covers(&[&[[0.0, 0.0], [2.0, -2.0], [1.0, 0.0], [2.0, 2.0]]], 2.0, &[]);
    covers(&[&[[0.0, 0.0], [1.0, 0.0], [2.0, 0.0], [2.0, 2.0], [1.0, 2.0], [0.0, 2.0]]], 4.0, &[]);
}

#[test]
fn holes() {
    let hole = reversed(square(1.0, 1.0, 1.0));
    covers(&[&square(0.0, 0.0, 4.0), &hole], 15.0, &[]);
    covers(&[&square(0.0, 0.0, 9.0), &hole, &reversed(square(4.0, 4.0, 2.0))], 76.0, &[]);
    covers(&[&square(0.0, 0.0, 4.0), &square(1.0, 1.0, 1.0)], 15.0, &[208]);
    covers(&[&square(0.0, 0.0, 4.0), &reversed(square(8.0, 1.0, 1.0))], 16.0, &[206]);
    covers(&[&square(0.0, 0.0, 9.0), &reversed(square(1.0, 1.0, 4.0)), &reversed(square(2.0, 2.0, 1.0))], 65.0, &[207]);
    // A hole given twice, a hole that crosses the border, and one that shares an edge with it.
    covers(&[&square(0.0, 0.0, 4.0), &hole, &hole], 15.0, &[202]);
    covers(&[&square(0.0, 0.0, 4.0), &reversed(square(3.0, 1.0, 2.0))], 14.0, &[201]);
    covers(&[&square(0.0, 0.0, 4.0), &reversed(square(2.0, 1.0, 2.0))], 12.0, &[201]);
    // A hole that cuts the square in two by touching the border with two corners.
    covers(&[&square(0.0, 0.0, 4.0), &reversed(vec![[0.0, 0.0], [4.0, 4.0], [2.0, 3.0]])], 14.0, &[205]);
    // A hole that touches the border with one corner.
    covers(&[&square(0.0, 0.0, 4.0), &reversed(vec![[0.0, 0.0], [2.0, 1.0], [1.0, 2.0]])], 14.5, &[]);
}

#[test]
fn broken_rings() {
    covers(&[&[[0.0, 0.0], [0.0, 0.0], [2.0, 0.0], [0.0, 2.0], [0.0, 0.0]]], 2.0, &[102]);
    covers(&[&[[0.0, 0.0], [2.0, 0.0], [0.0, 2.0], [0.0, 5.0], [0.0, 2.0]]], 2.0, &[104]);
    covers(&[&[[0.0, 0.0], [1.0, 0.0]]], 0.0, &[101]);
    covers(&[&[[0.0, 0.0], [1.0, 1.0], [2.0, 2.0], [3.0, 3.0]]], 0.0, &[1003]);
    covers(&[&[[f64::NAN, 0.0], [1.0, 1.0], [2.0, 0.0]]], 0.0, &[1003]);
    covers(&[], 0.0, &[]);
    // A ring that touches itself at a corner of two squares, and a bow tie with a large and a small
    // wing.
    let touching = [[0.0, 0.0], [1.0, 0.0], [1.0, 1.0], [2.0, 1.0], [2.0, 2.0], [1.0, 2.0], [1.0, 1.0], [0.0, 1.0]];
    covers(&[&touching], 2.0, &[104]);
    let (area, codes) = cut(&[&[[0.0, 0.0], [4.0, 0.0], [3.0, -1.0], [3.0, 3.0]]]);
    assert_eq!(codes, [104]);
    assert!((area - 5.0).abs() < 1e-9, "{area}");
}

#[test]
fn uneven_polygons_are_measured() {
    let points = [[0.0, 0.0, 0.0], [4.0, 0.0, 0.0], [4.0, 4.0, 0.2], [0.0, 4.0, 0.0]];
    let out = triangulate(&[vec![0, 1, 2, 3]], |i| points[i as usize]);
    let codes: Vec<_> = out.findings.iter().map(|f| (f.code.number(), f.dropped)).collect();
    assert_eq!((codes, out.triangles.len()), (vec![(203, false)], 2));
    let folded = [[0.0, 0.0, 0.0], [4.0, 0.0, 0.0], [4.0, 4.0, 3.0], [0.0, 4.0, 0.0]];
    let out = triangulate(&[vec![0, 1, 2, 3]], |i| folded[i as usize]);
    assert_eq!(out.findings.iter().map(|f| f.code.number()).collect::<Vec<_>>(), [203, 204]);
}

proptest! {
    /// A star-shaped ring does not intersect itself, so its triangles cover it exactly.
    #[test]
    fn star_polygons_are_covered(radii in prop::collection::vec(0.5f64..20.0, 3..60)) {
        let step = std::f64::consts::TAU / radii.len() as f64;
        let ring: Vec<[f64; 2]> =
            radii.iter().enumerate().map(|(i, r)| [r * (i as f64 * step).cos(), r * (i as f64 * step).sin()]).collect();
        let shoelace = |i: usize| {
            let (a, b) = (ring[i], ring[(i + 1) % ring.len()]);
            0.5 * (a[0] * b[1] - a[1] * b[0])
        };
        let expected: f64 = (0..ring.len()).map(shoelace).sum();
        let (area, codes) = cut(&[&ring]);
        prop_assert!(codes.is_empty(), "{codes:?}");
        prop_assert!((area - expected).abs() < 1e-9 * expected.max(1.0));
    }

    /// Random rings cause no panic, and their triangles do not exceed the bounding box.
    #[test]
    fn any_rings_end(rings in prop::collection::vec(prop::collection::vec((0i32..12, 0i32..12), 0..14), 0..4)) {
        let rings: Vec<Vec<[f64; 2]>> = rings
            .into_iter()
            .map(|ring| ring.into_iter().map(|(x, y)| [f64::from(x), f64::from(y)]).collect())
            .collect();
        let (area, _) = cut(&rings.iter().map(Vec::as_slice).collect::<Vec<_>>());
        prop_assert!(area.abs() <= 121.0 + 1e-9);
    }
}

#[test]
fn rings_of_many_crossings_are_given_up() {
    // A linear congruential walk, in which almost every edge crosses hundreds of others.
    let walk = |count: usize| -> Vec<[f64; 2]> {
        let place = |i: usize| ((i * 7_368_787 + 11) % 1_000_003) as f64 / 1000.0;
        (0..count).map(|i| [place(i), place(3 * i * i + 5)]).collect()
    };
    for count in [1000, 4000, 100_000] {
        let (area, codes) = cut(&[&walk(count)]);
        assert_eq!((area, codes), (0.0, vec![104, 1012]), "{count} corners");
    }
}
