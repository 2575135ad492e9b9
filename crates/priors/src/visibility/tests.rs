//! Compares the visibility of points on boxes with a test of every triangle.

use bvh::Ray;
use proptest::prelude::*;

use super::*;
use crate::model::tests::{cuboid, joined};
use crate::view::tests::{nadir, pinhole};
use crate::{Amount, SampleConfig, sample};

fn two_boxes() -> PriorModel {
    let mesh = joined(cuboid([0.0; 3], [8.0, 6.0, 3.0]), &cuboid([12.0, 1.0, 0.0], [6.0, 6.0, 12.0]));
    PriorModel::new(mesh, &[true, true]).unwrap()
}

fn points(model: &PriorModel, count: usize) -> Vec<Sample> {
    sample(model, &SampleConfig { amount: Amount::Count(count), ..SampleConfig::default() }).unwrap().points
}

fn seen(model: &PriorModel, samples: &[Sample], views: &[View], config: VisibilityConfig) -> Visible {
    let mut visibility = Visibility::new(model, samples, config).unwrap();
    for view in views {
        visibility.add(view);
    }
    visibility.finish()
}

/// Makes a camera that faces a point.
fn looking_at(centre: [f64; 3], at: [f64; 3]) -> View {
    let forward = numeric::vector::unit(sub(at, centre)).unwrap();
    let right = numeric::vector::unit(numeric::vector::cross(forward, [0.0, 0.0, 1.0])).unwrap();
    let down = numeric::vector::cross(forward, right);
    View { lens: pinhole(200, 150, 120.0), pose: camera::Pose { rotation: [right, down, forward], centre } }
}

#[test]
fn only_roofs_are_seen_from_straight_above() {
    let model = two_boxes();
    let samples = points(&model, 4_000);
    let view = nadir([9.0, 4.0, 60.0], pinhole(300, 300, 500.0));
    let all = VisibilityConfig { min_views: 1, max_incidence_deg: Some(80.0), ..VisibilityConfig::default() };
    let visible = seen(&model, &samples, &[view], all);
    let is_roof = |s: &Sample| s.class == city::SurfaceClass::Roof;
    assert_eq!(visible.points.len(), samples.iter().filter(|s| is_roof(s)).count());
    assert!(visible.points.iter().all(|&p| is_roof(&samples[p as usize])));
    assert_eq!(visible.per_view[0].visible, visible.points.len());
    assert_eq!(visible.pairs, visible.points.len() as u64);
    assert_eq!(visible.histogram[1], visible.points.len());
    assert_eq!(visible.histogram.iter().sum::<usize>(), samples.len());
}

#[test]
fn two_views_are_needed_by_default() {
    let model = two_boxes();
    let samples = points(&model, 3_000);
    let views = [looking_at([-30.0, 3.0, 8.0], [4.0, 3.0, 2.0]), looking_at([14.0, -40.0, 12.0], [8.0, 3.0, 2.0])];
    // The limit of 90° excludes points just behind an edge that are occluded by less than ε.
    let config = VisibilityConfig { max_incidence_deg: Some(90.0), ..VisibilityConfig::default() };
    let visible = seen(&model, &samples, &views, config);
    // Only roofs are visible from the west and from the south.
    assert!(visible.points.len() > 200);
    for (&point, observations) in visible.points.iter().zip(&visible.observations) {
        let sample = &samples[point as usize];
        assert_eq!(sample.class, city::SurfaceClass::Roof, "{sample:?}");
        assert_eq!(observations.iter().map(|o| o.view).collect::<Vec<_>>(), [0, 1]);
    }
    let none = seen(&model, &samples, &views, VisibilityConfig { near_m: 60.0, ..VisibilityConfig::default() });
    assert!(none.points.is_empty() && none.per_view[0].candidates == 0);
}

#[test]
fn the_best_observations_are_kept() {
    let model = two_boxes();
    let samples = points(&model, 2_000);
    let heights = [90.0, 30.0, 50.0, 20.0, 70.0];
    let views = heights.map(|h| nadir([4.0, 3.0, h], pinhole(400, 400, 150.0)));
    let config = VisibilityConfig { max_observations: 2, ..VisibilityConfig::default() };
    let visible = seen(&model, &samples, &views, config);
    let low = |p: u32| samples[p as usize].object == 0 && samples[p as usize].class == city::SurfaceClass::Roof;
    let mut checked = 0;
    for (&point, observations) in visible.points.iter().zip(&visible.observations) {
        if low(point) {
            assert_eq!(observations.iter().map(|o| o.view).collect::<Vec<_>>(), [1, 3]);
            let [x, y, _] = samples[point as usize].position;
            assert!((observations[1].pixel.sample - (199.5 + 150.0 * (x - 4.0) / 17.0)).abs() < 1e-9);
            assert!((observations[1].pixel.line - (199.5 - 150.0 * (y - 3.0) / 17.0)).abs() < 1e-9);
            checked += 1;
        }
    }
    assert!(checked > 100);
    assert!(visible.views.iter().all(|&v| v >= 2));
}

#[test]
fn numbers_that_mean_nothing_are_refused() {
    let model = two_boxes();
    let base = VisibilityConfig::default();
    let refused = [
        VisibilityConfig { epsilon_m: -0.1, ..base },
        VisibilityConfig { margin_px: f64::NAN, ..base },
        VisibilityConfig { near_m: f64::INFINITY, ..base },
        VisibilityConfig { max_incidence_deg: Some(0.0), ..base },
        VisibilityConfig { max_observations: 0, ..base },
    ];
    for config in refused {
        assert!(Visibility::new(&model, &[], config).is_err(), "{config:?}");
    }
}

proptest! {
    #![proptest_config(ProptestConfig::with_cases(24))]

    #[test]
    fn a_ray_for_every_point_says_the_same(x in -40.0..-10.0f64, y in -40.0..40.0f64, z in 1.0..40.0f64) {
        let model = two_boxes();
        let samples = points(&model, 400);
        let view = looking_at([x, y, z], [8.0, 4.0, 3.0]);
        let config = VisibilityConfig { min_views: 1, ..VisibilityConfig::default() };
        let visible = seen(&model, &samples, std::slice::from_ref(&view), config);
        let expected = (0..samples.len() as u32).filter(|&i| {
            let towards = sub(samples[i as usize].position, view.pose.centre);
            let [u, v, depth] = view.eye().eye_from_world(samples[i as usize].position);
            let ray = Ray { origin: view.pose.centre, direction: towards, end: 1.0 - 0.05 / norm(towards) };
            view.pixel(u / depth, v / depth, 5.0).is_some() && !model.bvh().any_hit(&ray)
        });
        prop_assert_eq!(&visible.points, &expected.collect::<Vec<_>>());
    }
}
