//! Every way of casting rays against the same rays tested with every triangle, in f64 and by
//! another formula.

use bvh::{Bvh, BvhError, Eye, MISS, Ray, Target};
use numeric::vector::{Vector, cross, dot, sub};
use proptest::prelude::*;

/// Where a ray meets a triangle, after Möller and Trumbore (1997), and how far from its border in
/// parts of its size.
fn moller_trumbore(origin: Vector, direction: Vector, [a, b, c]: [Vector; 3]) -> Option<(f64, f64)> {
    let (e1, e2) = (sub(b, a), sub(c, a));
    let p = cross(direction, e2);
    let det = dot(e1, p);
    let s = sub(origin, a);
    let u = dot(s, p) / det;
    let q = cross(s, e1);
    let v = dot(direction, q) / det;
    let t = dot(e2, q) / det;
    let margin = u.min(v).min(1.0 - u - v);
    (det != 0.0 && margin >= -1e-9 && t > 0.0).then_some((t, margin))
}

/// The nearest hit over all triangles, and whether every decision on the way was clear of rounding.
fn brute_force(triangles: &[[Vector; 3]], origin: Vector, direction: Vector) -> (Option<f64>, bool) {
    let hits = || triangles.iter().filter_map(|&t| moller_trumbore(origin, direction, t));
    let nearest = hits().map(|(t, _)| t).fold(f64::INFINITY, f64::min);
    let clear = hits().all(|(t, margin)| t > nearest + 1e-6 || margin > 1e-9);
    ((nearest < f64::INFINITY).then_some(nearest), clear)
}

/// Triangles of all sizes in a cloud, with shared corners, repeated ones and ones without area
/// among them.
fn scene() -> impl Strategy<Value = Vec<[Vector; 3]>> {
    let corner = prop::array::uniform3(-50.0f64..50.0);
    let size = prop_oneof![Just(0.01), Just(1.0), Just(20.0), Just(150.0)];
    let triangle = (corner, size, prop::array::uniform3(prop::array::uniform3(-1.0f64..1.0)))
        .prop_map(|(at, size, offsets)| offsets.map(|o| [0, 1, 2].map(|i| at[i] + size * o[i])));
    (prop::collection::vec(triangle, 1..120), prop::option::of(0usize..120)).prop_map(|(mut all, again)| {
        if let Some(&triangle) = again.and_then(|i| all.get(i)) {
            all.push(triangle);
            all.push([triangle[0], triangle[1], triangle[1]]);
        }
        all
    })
}

fn built(triangles: &[[Vector; 3]]) -> Bvh {
    let positions: Vec<Vector> = triangles.iter().flatten().copied().collect();
    let indices: Vec<[u32; 3]> = (0..triangles.len() as u32).map(|i| [3 * i, 3 * i + 1, 3 * i + 2]).collect();
    Bvh::new(&positions, &indices).unwrap()
}

/// An eye that looks along a direction.
fn eye(centre: Vector, direction: Vector) -> Eye {
    let unit = |v: Vector| v.map(|c| c / dot(v, v).sqrt());
    let forward = unit(direction);
    let right = unit(cross(forward, if forward[2].abs() < 0.9 { [0.0, 0.0, 1.0] } else { [1.0, 0.0, 0.0] }));
    Eye { centre, right, down: cross(forward, right), forward }
}

fn through(eye: &Eye, x: f64, y: f64) -> Vector {
    [0, 1, 2].map(|i| eye.forward[i] + x * eye.right[i] + y * eye.down[i])
}

fn direction() -> impl Strategy<Value = Vector> {
    prop::array::uniform3(-1.0f64..1.0).prop_filter("has a length", |d| dot(*d, *d) > 1e-3)
}

proptest! {
    #![proptest_config(ProptestConfig { cases: 300, ..ProptestConfig::default() })]

    #[test]
    fn an_image_is_what_brute_force_sees(
        triangles in scene(), centre in prop::array::uniform3(-80.0f64..80.0), direction in direction(),
        fov in 0.05f64..2.0,
    ) {
        let (bvh, eye) = (built(&triangles), eye(centre, direction));
        let (width, height) = (43, 37);
        let pixel = |column: usize, row: usize| {
            [fov * (column as f64 / width as f64 - 0.5), fov * (row as f64 / width as f64 - 0.4)]
        };
        let image = bvh.cast_image(&eye, width, height, |column, row| Some(pixel(column, row)));
        for row in 0..height {
            for column in 0..width {
                let [x, y] = pixel(column, row);
                let (expected, clear) = brute_force(&triangles, centre, through(&eye, x, y));
                let (depth, triangle) = (image.depth[row * width + column], image.triangle[row * width + column]);
                prop_assert_eq!(depth.is_finite(), triangle != MISS);
                if !clear {
                    continue;
                }
                prop_assert_eq!(expected.is_some(), depth.is_finite(), "{} {}: {:?} {}", column, row, expected, depth);
                if let Some(expected) = expected {
                    prop_assert!((f64::from(depth) - expected).abs() < 1e-3, "{} {}", depth, expected);
                    let hit = moller_trumbore(centre, through(&eye, x, y), triangles[triangle as usize]);
                    prop_assert!(hit.is_some_and(|(t, _)| (t - expected).abs() < 1e-6));
                }
            }
        }
    }

    #[test]
    fn hidden_points_are_what_brute_force_hides(
        triangles in scene(), centre in prop::array::uniform3(-80.0f64..80.0), direction in direction(),
        targets in prop::collection::vec((-1.5f64..1.5, -1.5f64..1.5, 0.1f64..200.0), 1..400),
    ) {
        let (bvh, eye) = (built(&triangles), eye(centre, direction));
        let targets: Vec<Target> = targets.into_iter().map(|(x, y, depth)| Target { x, y, depth }).collect();
        for (target, hidden) in targets.iter().zip(bvh.occluded(&eye, &targets)) {
            let (nearest, clear) = brute_force(&triangles, centre, through(&eye, target.x, target.y));
            if clear && nearest.is_none_or(|t| (t - target.depth).abs() > 1e-6) {
                prop_assert_eq!(hidden, nearest.is_some_and(|t| t < target.depth), "{:?} {:?}", target, nearest);
            }
        }
    }

    #[test]
    fn single_rays_are_what_brute_force_finds(
        triangles in scene(), rays in prop::collection::vec((prop::array::uniform3(-80.0f64..80.0), direction()), 1..60),
        axis in 0usize..3, end in 1.0f64..300.0,
    ) {
        let bvh = built(&triangles);
        for (number, (origin, mut direction)) in rays.into_iter().enumerate() {
            if number % 4 == 0 {
                direction[axis] = 0.0;
            }
            let ray = Ray { origin, direction, end: f64::INFINITY };
            let (expected, clear) = brute_force(&triangles, origin, direction);
            if !clear {
                continue;
            }
            let found = bvh.closest_hit(&ray);
            prop_assert_eq!(found.is_some(), expected.is_some(), "{:?}", ray);
            if let (Some(found), Some(expected)) = (found, expected) {
                prop_assert!((found.t - expected).abs() < 1e-6 * expected.max(1.0));
            }
            if expected.is_none_or(|t| (t - end).abs() > 1e-6) {
                prop_assert_eq!(bvh.any_hit(&Ray { end, ..ray }), expected.is_some_and(|t| t < end));
            }
        }
    }
}

/// A bumpy sheet of triangles in which every inner edge is shared, far from the origin.
fn sheet(side: usize) -> (Vec<Vector>, Vec<[u32; 3]>) {
    let bump = |i: usize, j: usize| ((i * 7919 + j * 104_729) % 101) as f64 / 25.0;
    let positions = (0..=side).flat_map(|i| (0..=side).map(move |j| (i, j)));
    let positions = positions.map(|(i, j)| [4000.0 + i as f64 / 3.0, -7000.0 + j as f64 / 7.0, bump(i, j)]).collect();
    let at = |i: usize, j: usize| (i * (side + 1) + j) as u32;
    let cells = (0..side).flat_map(|i| (0..side).map(move |j| (i, j)));
    let triangles = cells.flat_map(|(i, j)| {
        let [a, b, c, d] = [at(i, j), at(i + 1, j), at(i + 1, j + 1), at(i, j + 1)];
        if (i + j) % 2 == 0 { [[a, b, c], [a, c, d]] } else { [[a, b, d], [b, c, d]] }
    });
    (positions, triangles.collect())
}

#[test]
fn no_ray_slips_between_triangles() {
    let (positions, triangles) = sheet(40);
    let bvh = Bvh::new(&positions, &triangles).unwrap();
    let centre = [4006.0, -6997.0, 60.0];
    let down = Eye::new(centre, [[1.0, 0.0, 0.0], [0.0, -1.0, 0.0], [0.0, 0.0, -1.0]]);
    // Rays exactly through the inner corners and the middles of the edges between them.
    let mut places: Vec<[f64; 2]> = Vec::new();
    for i in 1..40usize {
        for j in 1..40usize {
            let [a, b] = [positions[i * 41 + j], positions[i * 41 + j + 1]];
            let middle = [0, 1, 2].map(|k| 0.5 * (a[k] + b[k]));
            places.extend([a, middle].map(|p| {
                let [x, y, z] = down.eye_from_world(p);
                [x / z, y / z]
            }));
        }
    }
    let image = bvh.cast_image(&down, places.len(), 1, |column, _| Some(places[column]));
    assert_eq!(image.triangle.iter().filter(|&&t| t == MISS).count(), 0);
    let targets: Vec<Target> = places.iter().map(|&[x, y]| Target { x, y, depth: 1000.0 }).collect();
    assert!(bvh.occluded(&down, &targets).iter().all(|&hidden| hidden));
    for [x, y] in places {
        let ray = Ray { origin: centre, direction: through(&down, x, y), end: f64::INFINITY };
        assert!(bvh.closest_hit(&ray).is_some());
    }
}

#[test]
fn nothing_depends_on_the_number_of_threads() {
    let (positions, triangles) = sheet(60);
    let view = eye([3990.0, -7010.0, 30.0], [1.0, 1.0, -1.2]);
    let run = |threads: usize| {
        rayon::ThreadPoolBuilder::new().num_threads(threads).build().unwrap().install(|| {
            let bvh = Bvh::new(&positions, &triangles).unwrap();
            let place = |column: usize, row: usize| [column as f64 / 100.0 - 1.0, row as f64 / 100.0 - 1.0];
            let image = bvh.cast_image(&view, 200, 200, |column, row| Some(place(column, row)));
            let targets: Vec<Target> = (0..5000)
                .map(|i| Target {
                    x: (i % 71) as f64 / 50.0 - 0.7,
                    y: (i % 97) as f64 / 60.0 - 0.8,
                    depth: (i % 40) as f64,
                })
                .collect();
            (image, bvh.occluded(&view, &targets))
        })
    };
    let one = run(1);
    assert!(one.0.triangle.iter().any(|&t| t != MISS) && one.1.iter().any(|&hidden| !hidden));
    assert_eq!(one, run(4));
}

#[test]
fn inputs_that_make_no_sense() {
    assert!(matches!(Bvh::new(&[[0.0; 3]], &[[0, 0, 1]]), Err(BvhError::Corner { triangle: 0, corner: 1, .. })));
    for bad in [f64::NAN, f64::INFINITY, 1e30] {
        assert!(matches!(Bvh::new(&[[0.0, bad, 0.0]], &[[0; 3]]), Err(BvhError::Position { triangle: 0, .. })));
    }
    let view = eye([0.0; 3], [0.0, 0.0, 1.0]);
    let nowhere = Eye { centre: [f64::NAN; 3], ..view };
    let targets = [(0.0, 5.0), (f64::NAN, 5.0), (0.0, -1.0), (0.0, f64::INFINITY)];
    let targets = targets.map(|(x, depth)| Target { x, y: 0.0, depth });
    let empty = Bvh::new(&[], &[]).unwrap();
    let wall = Bvh::new(&[[-9.0, -9.0, 9.0], [9.0, -9.0, 9.0], [0.0, 9.0, 9.0]], &[[0, 1, 2]]).unwrap();
    for bvh in [&empty, &wall] {
        assert_eq!(bvh.occluded(&view, &targets), [false, true, true, true]);
        assert_eq!(bvh.occluded(&nowhere, &targets), [true; 4]);
        assert!(bvh.occluded(&view, &[]).is_empty());
        assert_eq!(bvh.cast_image(&view, 0, 7, |_, _| None).depth.len(), 0);
        let image = bvh.cast_image(&view, 3, 1, |column, _| [None, Some([f64::NAN, 0.0]), Some([0.0, 0.0])][column]);
        assert_eq!(image.triangle[..2], [MISS; 2]);
        assert_eq!(image.depth[2].is_finite(), !bvh.is_empty());
        assert!(bvh.cast_image(&nowhere, 2, 2, |_, _| Some([0.0; 2])).triangle.iter().all(|&t| t == MISS));
        for direction in [[0.0; 3], [f64::NAN; 3]] {
            assert!(bvh.closest_hit(&Ray { origin: [0.0; 3], direction, end: 9.0 }).is_none());
        }
    }
    let straight = Ray { origin: [0.0; 3], direction: [0.0, 0.0, 3.0], end: f64::INFINITY };
    assert_eq!(wall.closest_hit(&straight).map(|hit| (hit.t, hit.triangle)), Some((3.0, 0)));
    assert!(!wall.any_hit(&Ray { end: 2.9, ..straight }) && wall.any_hit(&Ray { end: 3.1, ..straight }));
}

#[test]
fn of_equal_triangles_the_first_is_hit() {
    let wall = [[-9.0, -9.0, 9.0], [9.0, -9.0, 9.0], [0.0, 9.0, 9.0]];
    let turned = [wall[1], wall[0], wall[2]];
    let many: Vec<[Vector; 3]> = std::iter::repeat_n([turned, wall], 9).flatten().collect();
    let bvh = built(&many);
    let view = eye([0.1, 0.2, 0.0], [0.0, 0.0, 1.0]);
    let image = bvh.cast_image(&view, 8, 8, |column, row| Some([column as f64 / 99.0, row as f64 / 99.0]));
    assert!(image.triangle.iter().all(|&t| t == 0), "{:?}", image.triangle);
    let ray = Ray { origin: [0.1, 0.2, 0.0], direction: [0.01, 0.0, 1.0], end: f64::INFINITY };
    assert_eq!(bvh.closest_hit(&ray).map(|hit| hit.triangle), Some(0));
}

/// Distance of a position from a triangle: that from its plane where it lies over the inside, else
/// from the nearest of its edges.
fn distance(p: Vector, [a, b, c]: [Vector; 3]) -> f64 {
    let normal = cross(sub(b, a), sub(c, a));
    let over = |from: Vector, to: Vector| dot(cross(sub(to, from), sub(p, from)), normal) > 0.0;
    if over(a, b) && over(b, c) && over(c, a) {
        return dot(sub(p, a), normal).abs() / dot(normal, normal).sqrt();
    }
    let edge = |from: Vector, to: Vector| {
        let side = sub(to, from);
        let length = dot(side, side);
        let t = if length > 0.0 { (dot(sub(p, from), side) / length).clamp(0.0, 1.0) } else { 0.0 };
        let off = sub(p, [0, 1, 2].map(|i| from[i] + t * side[i]));
        dot(off, off).sqrt()
    };
    edge(a, b).min(edge(b, c)).min(edge(c, a))
}

proptest! {
    #![proptest_config(ProptestConfig { cases: 300, ..ProptestConfig::default() })]

    #[test]
    fn the_nearest_point_is_that_of_brute_force(
        triangles in scene(), positions in prop::collection::vec(prop::array::uniform3(-90.0f64..90.0), 1..20),
        within in prop_oneof![Just(f64::INFINITY), 0.0f64..60.0],
    ) {
        let bvh = built(&triangles);
        for position in positions {
            let expected = triangles.iter().map(|&t| distance(position, t)).fold(f64::INFINITY, f64::min);
            let found = bvh.nearest(position, within);
            if (expected - within).abs() > 1e-9 {
                prop_assert_eq!(found.is_some(), expected < within);
            }
            let Some(found) = found else { continue };
            let off = sub(position, found.point);
            prop_assert!((found.distance_m - expected).abs() < 1e-9, "{} {}", found.distance_m, expected);
            prop_assert!((dot(off, off).sqrt() - found.distance_m).abs() < 1e-12);
            let own = distance(position, triangles[found.triangle as usize]);
            prop_assert!((own - expected).abs() < 1e-9, "another triangle is nearer");
        }
    }
}

#[test]
fn what_is_nowhere_has_no_nearest_point() {
    let tree = built(&[[[0.0; 3], [1.0, 0.0, 0.0], [0.0, 1.0, 0.0]], [[3.0; 3]; 3]]);
    assert_eq!(tree.nearest([3.0; 3], f64::INFINITY).map(|found| found.triangle), Some(0));
    assert!(tree.nearest([f64::NAN, 0.0, 0.0], 1.0).is_none() && tree.nearest([0.0; 3], -1.0).is_none());
    assert!(built(&[]).nearest([0.0; 3], f64::INFINITY).is_none());
    // Of a repeated triangle the first is found.
    let twice = built(&[[[0.0; 3], [1.0, 0.0, 0.0], [0.0, 1.0, 0.0]]; 9]);
    assert_eq!(twice.nearest([0.2, 0.2, 4.0], 5.0).map(|found| (found.triangle, found.distance_m)), Some((0, 4.0)));
}
