//! Projection and localisation undo each other, and where they cannot they say so.

mod common;

use camera::{CameraError, ImageCorrection, ImagePoint, Rpc, RpcCamera};
use common::{crop_far_from_offset, fold_inside, pole_inside, pushbroom};
use geodesy::LonLatHeight;
use proptest::prelude::*;

fn distance(a: ImagePoint, b: ImagePoint) -> f64 {
    (a.sample - b.sample).hypot(a.line - b.line)
}

fn cube() -> impl Strategy<Value = [f64; 3]> {
    [-1.0..=1.0, -1.0..=1.0, -1.0..=1.0]
}

fn moved(mut rpc: Rpc, lon_deg: f64, lat_deg: f64) -> Rpc {
    rpc.long_off = lon_deg;
    rpc.lat_off = lat_deg;
    rpc
}

proptest! {
    #[test]
    fn localisation_inverts_projection_over_the_cube(at in cube()) {
        let far_north = moved(pushbroom(), 12.0, 85.0);
        let antimeridian = moved(pushbroom(), 179.95, -17.0);
        for rpc in [pushbroom(), crop_far_from_offset(), far_north, antimeridian] {
            let ground = rpc.domain().at(at);
            let image = rpc.project(ground).unwrap();
            let back = rpc.localize(image, ground.height_m).unwrap();
            prop_assert!((back.lon_deg - ground.lon_deg).abs() < 1e-12);
            prop_assert!((back.lat_deg - ground.lat_deg).abs() < 1e-12);
            prop_assert!(distance(rpc.project(back).unwrap(), image) < 1e-6);
        }
    }

    /// Poles and folds inside the domain: the image position is met, or the answer is an error.
    #[test]
    fn a_model_with_a_pole_or_a_fold_is_inverted_or_refused(at in cube()) {
        for rpc in [pole_inside(), fold_inside()] {
            let ground = rpc.domain().at(at);
            if let Ok(image) = rpc.project(ground)
                && image.line.abs() < 1e6
            {
                let back = rpc.localize(image, ground.height_m).unwrap();
                prop_assert!(distance(rpc.project(back).unwrap(), image) < 1e-6);
            }
        }
    }

    #[test]
    fn the_same_place_has_one_image_whichever_way_its_longitude_is_written(at in cube()) {
        let rpc = moved(pushbroom(), 179.95, -17.0);
        let g = rpc.domain().at(at);
        let turned = LonLatHeight { lon_deg: g.lon_deg - 360.0, ..g };
        prop_assert!(distance(rpc.project(g).unwrap(), rpc.project(turned).unwrap()) < 1e-6);
        prop_assert!(rpc.domain().contains(turned) == rpc.domain().contains(g));
    }

    #[test]
    fn the_jacobian_is_the_slope_of_the_projection(at in cube()) {
        let camera = RpcCamera { rpc: pushbroom(), correction: tilted() };
        let g = camera.rpc.domain().at(at);
        let j = camera.jacobian(g).unwrap();
        let steps = [[1e-5, 0.0, 0.0], [0.0, 1e-5, 0.0], [0.0, 0.0, 1.0]];
        for (axis, [dx, dy, dz]) in steps.into_iter().enumerate() {
            let along = |t: f64| {
                camera.project(LonLatHeight::new(g.lon_deg + t * dx, g.lat_deg + t * dy, g.height_m + t * dz)).unwrap()
            };
            let (a, b) = (along(1.0), along(-1.0));
            let width = 2.0 * (dx + dy + dz);
            let size = j.sample[axis].hypot(j.line[axis]);
            prop_assert!(((a.sample - b.sample) / width - j.sample[axis]).abs() < 1e-5 * size);
            prop_assert!(((a.line - b.line) / width - j.line[axis]).abs() < 1e-5 * size);
        }
    }

    #[test]
    fn cropping_and_rescaling_move_the_image_and_nothing_else(at in cube(), scale in 0.1..4.0) {
        let camera = RpcCamera { rpc: pushbroom(), correction: tilted() };
        let g = camera.rpc.domain().at(at);
        let p = camera.project(g).unwrap();
        let cropped = camera.cropped(ImagePoint::new(1200.0, -35.0)).project(g).unwrap();
        prop_assert!(distance(cropped, ImagePoint::new(p.sample - 1200.0, p.line + 35.0)) < 1e-8);
        let rescaled = camera.rescaled(scale).project(g).unwrap();
        let expected = ImagePoint::new((p.sample + 0.5) * scale - 0.5, (p.line + 0.5) * scale - 0.5);
        prop_assert!(distance(rescaled, expected) < 1e-8);
    }

    #[test]
    fn corrections_compose_and_invert(s in 0.0..40_000.0, l in 0.0..40_000.0) {
        let p = ImagePoint::new(s, l);
        let (first, second) = (tilted(), ImageCorrection { centre: ImagePoint::new(9.0, 4.0), ..tilted() });
        prop_assert!(distance(first.then(&second).apply(p), second.apply(first.apply(p))) < 1e-8);
        prop_assert!(distance(first.invert(first.apply(p)).unwrap(), p) < 1e-8);
    }
}

fn tilted() -> ImageCorrection {
    ImageCorrection {
        translation_px: [1.5, -2.25],
        linear: [[1e-4, -2e-4], [3e-4, -1e-4]],
        centre: ImagePoint::new(20_000.0, 21_000.0),
    }
}

/// On a fold the two ground points of one image point lie on either side: the centre's side is the
/// answer.
#[test]
fn the_centre_s_side_of_a_fold_is_preferred() {
    let rpc = fold_inside();
    let beyond = rpc.domain().at([0.9, 0.1, 0.2]);
    let back = rpc.localize(rpc.project(beyond).unwrap(), beyond.height_m).unwrap();
    assert!((back.lon_deg - rpc.long_off) / rpc.long_scale < 0.6);
}

#[test]
fn points_far_outside_the_domain_are_refused_both_ways() {
    let rpc = pushbroom();
    let there = LonLatHeight::new(rpc.long_off + 40.0, rpc.lat_off, 0.0);
    assert!(matches!(rpc.project(there), Err(CameraError::OutsideDomain { .. })));
    let found = rpc.localize(ImagePoint::new(1e9, -3e8), 300.0);
    assert!(matches!(found, Err(CameraError::OutsideDomain { .. } | CameraError::NotConverged { .. })), "{found:?}");
}

#[test]
fn coordinates_that_are_not_finite_are_refused() {
    let rpc = pushbroom();
    for bad in [f64::NAN, f64::INFINITY, f64::NEG_INFINITY] {
        for g in [[bad, 43.7, 0.0], [7.3, bad, 0.0], [7.3, 43.7, bad]] {
            assert_eq!(rpc.project(LonLatHeight::new(g[0], g[1], g[2])), Err(CameraError::NotFinite));
        }
        assert_eq!(rpc.localize(ImagePoint::new(bad, 1.0), 0.0), Err(CameraError::NotFinite));
        assert_eq!(rpc.localize(ImagePoint::new(1.0, 1.0), bad), Err(CameraError::NotFinite));
    }
}

#[test]
fn a_pole_is_an_error() {
    let mut rpc = pushbroom();
    rpc.line_den = [0.0; 20];
    rpc.line_den[0] = 1.0;
    rpc.line_den[1] = -2.0;
    let on_it = rpc.domain().at([0.5, 0.0, 0.0]);
    assert!(matches!(rpc.project(on_it), Err(CameraError::Denominator { .. })));
}

/// A named way to spoil an RPC.
type Spoiled = (&'static str, fn(&mut Rpc));

#[test]
fn validation_names_the_entry() {
    assert_eq!(pushbroom().validate(), Ok(()));
    let cases: [Spoiled; 10] = [
        ("SAMP_OFF is NaN", |r| r.samp_off = f64::NAN),
        ("HEIGHT_SCALE is zero", |r| r.height_scale = 0.0),
        ("SAMP_NUM_COEFF_7 is inf", |r| r.samp_num[6] = f64::INFINITY),
        ("LAT_OFF is 91°", |r| r.lat_off = 91.0),
        ("LINE_DEN_COEFF_1 is zero", |r| r.line_den[0] = 0.0),
        ("SAMP_SCALE is 1e9", |r| r.samp_scale = 1e9),
        ("LAT_SCALE is 1e308", |r| r.lat_scale = 1e308),
        ("HEIGHT_OFF is 1e7", |r| r.height_off = 1e7),
        ("the coefficients place a corner", |r| r.line_num[6] = 1e6),
        ("the image does not depend on both", |r| {
            (r.samp_num, r.samp_den) = (r.line_num, r.line_den);
        }),
    ];
    for (expected, spoil) in cases {
        let mut rpc = pushbroom();
        spoil(&mut rpc);
        let found = rpc.validate().expect_err(expected);
        assert!(found.to_string().starts_with(expected), "{found}");
    }
}

/// The direction against the chord between two heights of the same image point, in Earth-centred
/// coordinates.
#[test]
fn the_view_direction_is_the_chord_between_heights() {
    let camera = RpcCamera { rpc: moved(pushbroom(), 12.0, 85.0), correction: tilted() };
    let ground = camera.rpc.domain().at([0.3, -0.4, 0.1]);
    let image = camera.project(ground).unwrap();
    let frame = geodesy::EnuFrame::new(ground);
    let at = |h: f64| frame.enu_from_ground(camera.localize(image, ground.height_m + h).unwrap());
    let (a, b) = (at(-5.0), at(5.0));
    let (e, n, u) = (b.east - a.east, b.north - a.north, b.up - a.up);
    let size = (e * e + n * n + u * u).sqrt();
    let d = camera.view_direction(ground).unwrap();
    for (chord, tangent) in [(e, d.east), (n, d.north), (u, d.up)] {
        assert!((chord / size - tangent).abs() < 1e-6, "{chord} {tangent}");
    }
}

/// One pixel to the right and one down, localised on the same plane, are one GSD away.
#[test]
fn the_gsd_is_the_ground_distance_of_one_pixel() {
    let camera = RpcCamera::new(pushbroom());
    let (p, h) = (ImagePoint::new(15_000.0, 24_000.0), 250.0);
    let ground = camera.localize(p, h).unwrap();
    let frame = geodesy::EnuFrame::new(ground);
    let distance_to = |p| {
        let at = frame.enu_from_ground(camera.localize(p, h).unwrap());
        at.east.hypot(at.north)
    };
    let gsd = camera.gsd_at(p, h).unwrap();
    assert!((distance_to(ImagePoint::new(15_001.0, 24_000.0)) - gsd.sample_m).abs() < 1e-5);
    assert!((distance_to(ImagePoint::new(15_000.0, 24_001.0)) - gsd.line_m).abs() < 1e-5);
}
