//! Checks counts, shares, distances and errors of samples, and that threads and coordinates do not
//! change them.

use super::*;
use crate::model::tests::{cuboid, joined};
use city::{ModelPoint, TriangleMesh};
use numeric::vector::{along, dot, norm, sub};

const SPACINGS: [Spacing; 3] = [Spacing::Random, Spacing::Stratified, Spacing::PoissonDisk];

fn house() -> PriorModel {
    PriorModel::new(cuboid([0.0; 3], [8.0, 6.0, 3.0]), &[true]).unwrap()
}

fn config(amount: Amount, spacing: Spacing) -> SampleConfig {
    SampleConfig { amount, spacing, ..SampleConfig::default() }
}

fn of_class(points: &[Sample], class: SurfaceClass) -> usize {
    points.iter().filter(|p| p.class == class).count()
}

#[test]
fn classes_get_their_share_of_the_area() {
    // Roof 48 m², walls 84 m², ground 48 m².
    for spacing in SPACINGS {
        let made = sample(&house(), &config(Amount::Count(6_600), spacing)).unwrap();
        assert_eq!(made.points.len(), 6_600, "{spacing:?}");
        assert!((made.area_m2 - 132.0).abs() < 1e-9);
        assert_eq!(made.skipped_m2, [(SurfaceClass::Ground, 48.0)]);
        let (roof, ground) = (of_class(&made.points, SurfaceClass::Roof), of_class(&made.points, SurfaceClass::Ground));
        // The standard deviation of independent points is 39.
        let allowed = if spacing == Spacing::Stratified { 2 } else { 160 };
        assert!(roof.abs_diff(2_400) <= allowed && ground == 0, "{spacing:?}: {roof}, {ground}");
        let expected = (132.0f32 / 6_600.0).sqrt();
        assert!(made.points.iter().all(|p| (p.spacing_m - expected).abs() < 1e-6));
    }
}

#[test]
fn points_lie_on_their_triangles_and_fill_them() {
    let model = house();
    for spacing in SPACINGS {
        let made = sample(&model, &config(Amount::Count(2_000), spacing)).unwrap();
        let mut middle = [0.0; 3];
        for point in &made.points {
            let [a, b, c] = model.mesh().corners(point.triangle as usize);
            let normal = model.normal(point.triangle as usize);
            assert!(dot(sub(point.position, a), normal).abs() < 1e-12);
            for (from, to) in [(a, b), (b, c), (c, a)] {
                let side = numeric::vector::cross(sub(to, from), sub(point.position, from));
                assert!(dot(side, normal) > -1e-9);
            }
            if point.class == SurfaceClass::Roof {
                middle = along(middle, 1.0, point.position);
            }
        }
        let n = of_class(&made.points, SurfaceClass::Roof) as f64;
        // The standard deviation of the mean of independent points along the roof is 0.09 m.
        assert!((middle[0] / n - 4.0).abs() < 0.35 && (middle[1] / n - 3.0).abs() < 0.3, "{spacing:?} {middle:?} {n}");
    }
}

#[test]
fn a_density_gives_its_number_and_weights_change_it() {
    let weights = ClassWeights::visible().with(SurfaceClass::Roof, 3.0).unwrap();
    let config = SampleConfig { weights, ..config(Amount::PerSquareMetre(10.0), Spacing::Stratified) };
    let made = sample(&house(), &config).unwrap();
    assert!(of_class(&made.points, SurfaceClass::Roof).abs_diff(1_440) <= 2);
    assert!(of_class(&made.points, SurfaceClass::Wall).abs_diff(840) <= 4);
    let roof = made.points.iter().find(|p| p.class == SurfaceClass::Roof).unwrap();
    assert!((roof.spacing_m - (1.0f32 / 30.0).sqrt()).abs() < 1e-4);
}

#[test]
fn disks_keep_their_distance_and_are_dense() {
    let made = sample(&house(), &config(Amount::Count(1_000), Spacing::PoissonDisk)).unwrap();
    let distance = made.disk_m.unwrap();
    let mut nearest = f64::INFINITY;
    for (i, a) in made.points.iter().enumerate() {
        for b in &made.points[..i] {
            nearest = nearest.min(norm(sub(a.position, b.position)));
        }
    }
    assert!(nearest >= distance * 0.999_999, "{nearest} {distance}");
    // Independent points of this density come as close as a thirtieth of the spacing. Saturated
    // disks have 0.83 of the spacing.
    assert!(distance > 0.6 * (132.0f64 / 1_000.0).sqrt(), "{distance}");
}

#[test]
fn threads_and_seeds() {
    let adaptive = Amount::Adaptive { error_m: 0.1, max_spacing_m: 1.0 };
    let amounts = SPACINGS.map(|s| config(Amount::Count(3_000), s)).into_iter().chain([config(adaptive, SPACINGS[0])]);
    for config in amounts {
        let run = |threads: usize, seed: u64| {
            let pool = rayon::ThreadPoolBuilder::new().num_threads(threads).build().unwrap();
            pool.install(|| sample(&house(), &SampleConfig { seed, ..config.clone() }).unwrap())
        };
        let one = run(1, 5);
        assert!(one == run(4, 5) && one == run(3, 5));
        assert_ne!(one.points, run(1, 6).points);
    }
}

#[test]
fn what_is_no_building_is_left_out() {
    let mesh = joined(cuboid([0.0; 3], [8.0, 6.0, 3.0]), &cuboid([20.0, 0.0, 0.0], [2.0, 2.0, 2.0]));
    let model = PriorModel::new(mesh, &[true, false]).unwrap();
    let base = config(Amount::Count(500), Spacing::Stratified);
    assert!(sample(&model, &base).unwrap().points.iter().all(|p| p.object == 0));
    let all = SampleConfig { everything: true, ..base };
    assert!(sample(&model, &all).unwrap().points.iter().any(|p| p.object == 1));
}

#[test]
fn what_cannot_be_sampled_is_refused() {
    let model = house();
    let fails = |config: SampleConfig| sample(&model, &config).unwrap_err();
    let amount = |amount| config(amount, Spacing::Stratified);
    assert!(matches!(fails(amount(Amount::PerSquareMetre(f64::NAN))), PriorsError::Config { .. }));
    assert!(matches!(fails(amount(Amount::PerSquareMetre(1e9))), PriorsError::TooMany { .. }));
    assert!(matches!(fails(amount(Amount::Count(usize::MAX))), PriorsError::TooMany { .. }));
    let adaptive = |error_m, max_spacing_m| amount(Amount::Adaptive { error_m, max_spacing_m });
    assert!(matches!(fails(adaptive(-1.0, 1.0)), PriorsError::Config { .. }));
    assert!(matches!(fails(adaptive(2.0, 1.0)), PriorsError::Config { .. }));
    let nothing = SurfaceClass::all().fold(ClassWeights::equal(), |w, class| w.with(class, 0.0).unwrap());
    let refused = fails(SampleConfig { weights: nothing, ..SampleConfig::default() });
    assert_eq!(refused, PriorsError::NothingToSample { total: 12 });
    assert!(ClassWeights::equal().with(SurfaceClass::Roof, -1.0).is_err());
    let empty = PriorModel::new(TriangleMesh::default(), &[]).unwrap();
    assert_eq!(sample(&empty, &SampleConfig::default()), Err(PriorsError::NothingToSample { total: 0 }));
    assert!(sample(&model, &amount(Amount::Count(0))).unwrap().points.is_empty());
}

/// Makes a tower of `sides` walls around the z axis.
fn tower(radius: f64, height: f64, sides: usize) -> TriangleMesh {
    let mut mesh = TriangleMesh { origin: ModelPoint::default(), ..TriangleMesh::default() };
    for i in 0..sides {
        let angle = std::f64::consts::TAU * i as f64 / sides as f64;
        let (sin, cos) = angle.sin_cos();
        mesh.positions.extend([[radius * cos, radius * sin, 0.0], [radius * cos, radius * sin, height]]);
        let (a, b) = (2 * i as u32, 2 * ((i + 1) % sides) as u32);
        mesh.triangles.extend([[a, b, b + 1], [a, b + 1, a + 1]]);
        mesh.surface_of.extend([i as u32; 2]);
        mesh.surfaces.push(city::MeshSurface { object: 0, class: SurfaceClass::Wall });
    }
    mesh
}

/// Returns the distance from a position to the nearest triangle.
fn to_mesh(mesh: &TriangleMesh, position: [f64; 3]) -> f64 {
    (0..mesh.triangles.len()).map(|t| to_triangle(position, mesh.corners(t))).fold(f64::INFINITY, f64::min)
}

fn to_triangle(p: [f64; 3], corners: [[f64; 3]; 3]) -> f64 {
    let [a, b, c] = corners;
    let normal = numeric::vector::unit(numeric::vector::cross(sub(b, a), sub(c, a))).unwrap();
    let inside = |from, to| dot(numeric::vector::cross(sub(to, from), sub(p, from)), normal) >= 0.0;
    if inside(a, b) && inside(b, c) && inside(c, a) {
        return dot(sub(p, a), normal).abs();
    }
    let to_edge = |from: [f64; 3], to: [f64; 3]| {
        let (span, offset) = (sub(to, from), sub(p, from));
        let t = (dot(offset, span) / dot(span, span)).clamp(0.0, 1.0);
        norm(sub(offset, span.map(|c| t * c)))
    };
    to_edge(a, b).min(to_edge(b, c)).min(to_edge(c, a))
}

#[test]
fn adaptive_disks_stay_within_the_error() {
    let small = joined(cuboid([0.0; 3], [20.0, 15.0, 6.0]), &cuboid([5.0, 5.0, 6.0], [1.0, 1.0, 1.5]));
    for (mesh, objects, error_m) in [(small, 2, 0.2), (tower(5.0, 10.0, 90), 1, 0.1), (tower(5.0, 10.0, 12), 1, 0.3)] {
        let model = PriorModel::new(mesh, &vec![true; objects]).unwrap();
        let weights = ClassWeights::equal();
        let amount = Amount::Adaptive { error_m, max_spacing_m: 2.0 };
        let config = SampleConfig { amount, weights, ..SampleConfig::default() };
        let made = sample(&model, &config).unwrap();
        let mut worst = 0.0f64;
        for point in made.points.iter().step_by(7) {
            let normal = point.normal.map(f64::from);
            let side = numeric::vector::unit(numeric::vector::cross(normal, [0.3, 0.5, 0.7])).unwrap();
            let other = numeric::vector::cross(normal, side);
            for step in 0..8 {
                let (sin, cos) = (f64::from(step) * std::f64::consts::FRAC_PI_4).sin_cos();
                let radius = f64::from(point.spacing_m);
                let rim = along(along(point.position, radius * cos, side), radius * sin, other);
                worst = worst.max(to_mesh(model.mesh(), rim));
            }
        }
        // The spacing of a piece is the spacing at its middle. Its points may be nearer to an edge
        // by up to 0.7 spacings.
        assert!(worst <= 1.5 * error_m, "{worst} for {error_m}");
        let spacings =
            made.points.iter().map(|p| p.spacing_m).fold((f32::INFINITY, 0.0f32), |(l, h), s| (l.min(s), h.max(s)));
        assert!(spacings.1 > 2.0 * spacings.0, "{spacings:?}");
        let curve = error_curve(&model, &config, &[4.0, 2.0, 1.0]).unwrap();
        assert!(
            (curve[2].points - made.points.len() as f64).abs() < 3.0 * (model.mesh().triangles.len() as f64).sqrt()
        );
        assert!(curve[0].points < curve[1].points && curve[1].points < curve[2].points, "{curve:?}");
        assert!(curve[2].points < curve[2].even_points, "{curve:?}");
    }
}
