//! The batch forms agree with the scalar ones, fail as values, and do not depend on the arrangement of the points.

mod common;

use camera::{CameraError, ImageCorrection, ImagePoint, Rpc, RpcCamera};
use common::{crop_far_from_offset, fold_inside, pole_inside, pushbroom};

/// Not a multiple of any vector's width.
const N: usize = 1003;

struct Points {
    lon: Vec<f64>,
    lat: Vec<f64>,
    height: Vec<f64>,
}

/// Positions spread over the validity cube.
fn points(rpc: &Rpc) -> Points {
    let fraction = |i: usize, step: f64| 2.0 * (i as f64 * step).fract() - 1.0;
    let at = |i| rpc.domain().at([fraction(i, 0.618_034), fraction(i, 0.754_878), fraction(i, 0.569_840)]);
    Points {
        lon: (0..N).map(|i| at(i).lon_deg).collect(),
        lat: (0..N).map(|i| at(i).lat_deg).collect(),
        height: (0..N).map(|i| at(i).height_m).collect(),
    }
}

fn ground(p: &Points, i: usize) -> geodesy::LonLatHeight {
    geodesy::LonLatHeight::new(p.lon[i], p.lat[i], p.height[i])
}

#[test]
fn batches_agree_with_the_scalar_forms() {
    for rpc in [pushbroom(), crop_far_from_offset(), pole_inside(), fold_inside()] {
        let correction =
            ImageCorrection { linear: [[1e-4, 0.0], [2e-4, 0.0]], ..ImageCorrection::translation(1.0, -2.0) };
        let camera = RpcCamera { rpc, correction };
        let p = points(&camera.rpc);
        let (mut s, mut l) = (vec![0.0; N], vec![0.0; N]);
        let failed = camera.project_batch(&p.lon, &p.lat, &p.height, &mut s, &mut l).unwrap();
        assert_eq!(failed, (0..N).filter(|&i| camera.project(ground(&p, i)).is_err()).count());
        let (mut x, mut y) = (vec![0.0; N], vec![0.0; N]);
        let failed = camera.localize_batch(&s, &l, &p.height, &mut x, &mut y).unwrap();
        assert_eq!(failed, x.iter().zip(&y).filter(|(x, y)| x.is_nan() && y.is_nan()).count());
        for i in 0..N {
            let exact = camera.project(ground(&p, i)).unwrap();
            // Towards the pole of one of these models rounding grows with the square of the coordinate.
            let size = (exact.sample.hypot(exact.line) / 1e5).powi(2).max(1.0);
            assert!((exact.sample - s[i]).hypot(exact.line - l[i]) < 1e-8 * size, "{exact:?} {} {}", s[i], l[i]);
            let one = camera.localize(ImagePoint::new(s[i], l[i]), p.height[i]);
            assert_eq!(one.is_err(), x[i].is_nan());
            if let Ok(one) = one {
                assert!(
                    (one.lon_deg - x[i]).abs().max((one.lat_deg - y[i]).abs()) < 1e-10,
                    "{one:?} {} {}",
                    x[i],
                    y[i]
                );
            }
        }
    }
}

#[test]
fn a_plane_s_batch_is_the_model_at_that_height() {
    let rpc = pushbroom();
    let p = points(&rpc);
    let plane = rpc.plane(421.5);
    let (mut s, mut l) = (vec![0.0; N], vec![0.0; N]);
    assert_eq!(plane.project_batch(&p.lon, &p.lat, &mut s, &mut l), Ok(0));
    for i in 0..N {
        let exact = rpc.project(geodesy::LonLatHeight { height_m: 421.5, ..ground(&p, i) }).unwrap();
        assert!((exact.sample - s[i]).hypot(exact.line - l[i]) < 1e-8);
    }
}

/// The same bits whether a point stands in the middle of a long slice, in its remainder, or alone.
#[test]
fn results_do_not_depend_on_the_arrangement() {
    let rpc = pushbroom();
    let p = points(&rpc);
    let (mut s, mut l) = (vec![0.0; N], vec![0.0; N]);
    rpc.project_batch(&p.lon, &p.lat, &p.height, &mut s, &mut l).unwrap();
    let (mut x, mut y) = (vec![0.0; N], vec![0.0; N]);
    rpc.localize_batch(&s, &l, &p.height, &mut x, &mut y).unwrap();
    for length in [1, 3, 10] {
        for first in [0, 7, 500, N - length] {
            let part = first..first + length;
            let (mut a, mut b) = (vec![0.0; length], vec![0.0; length]);
            let (lon, lat, h) = (&p.lon[part.clone()], &p.lat[part.clone()], &p.height[part.clone()]);
            rpc.project_batch(lon, lat, h, &mut a, &mut b).unwrap();
            assert_eq!((&a[..], &b[..]), (&s[part.clone()], &l[part.clone()]));
            let (image_s, image_l) = (&s[part.clone()], &l[part.clone()]);
            rpc.localize_batch(image_s, image_l, h, &mut a, &mut b).unwrap();
            assert_eq!((&a[..], &b[..]), (&x[part.clone()], &y[part]));
        }
    }
}

#[test]
fn points_that_fail_are_nan_and_counted() {
    let rpc = pushbroom();
    let lon = [7.26, f64::NAN, 120.0, 7.26, f64::INFINITY];
    let lat = [43.71, 43.71, 43.71, f64::NAN, 43.71];
    let height = [300.0; 5];
    let (mut s, mut l) = ([0.0; 5], [0.0; 5]);
    assert_eq!(rpc.project_batch(&lon, &lat, &height, &mut s, &mut l), Ok(4));
    assert!(s[0].is_finite() && s[1..].iter().chain(&l[1..]).all(|v| v.is_nan()));
    let (mut x, mut y) = ([0.0; 5], [0.0; 5]);
    let samples = [20_000.0, 1e12, f64::NAN, f64::NEG_INFINITY, -1e9];
    assert_eq!(rpc.localize_batch(&samples, &[20_000.0; 5], &height, &mut x, &mut y), Ok(4));
    assert!(x[0].is_finite() && x[1..].iter().chain(&y[1..]).all(|v| v.is_nan()));
}

#[test]
fn slices_of_different_lengths_are_an_error() {
    let (mut a, mut b) = ([0.0; 3], [0.0; 3]);
    let found = pushbroom().project_batch(&[7.0; 3], &[43.0; 2], &[0.0; 3], &mut a, &mut b);
    assert_eq!(found, Err(CameraError::Length { expected: 3, found: 2 }));
    let found = pushbroom().localize_batch(&[7.0; 3], &[43.0; 3], &[0.0; 4], &mut a, &mut b);
    assert_eq!(found, Err(CameraError::Length { expected: 3, found: 4 }));
}
