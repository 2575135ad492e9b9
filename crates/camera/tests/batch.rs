//! Arrays of points have the bits of single points.

mod common;

use camera::{ImageCorrection, ImagePoint, Rpc, RpcCamera};
use common::{crop_far_from_offset, fold_inside, pole_inside, pushbroom};
use geodesy::LonLatHeight;
use proptest::prelude::*;

/// Positions in half-widths of the domain: mostly inside, some far outside, some not numbers.
fn coordinate() -> impl Strategy<Value = f64> {
    prop_oneof![
        8 => -1.0..=1.0,
        1 => -20.0..=20.0,
        1 => prop_oneof![Just(f64::NAN), Just(f64::INFINITY), Just(f64::NEG_INFINITY), Just(1e300)],
    ]
}

/// The bits of a number; those of one NaN for all of them.
fn bits(value: f64) -> u64 {
    if value.is_nan() { f64::NAN.to_bits() } else { value.to_bits() }
}

fn expected(point: Result<ImagePoint, camera::CameraError>) -> [u64; 2] {
    point.map_or([f64::NAN; 2], |p| [p.sample, p.line]).map(bits)
}

proptest! {
    #[test]
    fn arrays_of_points_have_the_bits_of_single_points(
        at in prop::collection::vec([coordinate(), coordinate(), coordinate()], 0..700),
        linear in [[-0.01..=0.01, -0.01..=0.01], [-0.01..=0.01, -0.01..=0.01]],
    ) {
        let antimeridian = Rpc { long_off: 179.95, lat_off: -17.0, ..pushbroom() };
        for rpc in [pushbroom(), crop_far_from_offset(), pole_inside(), fold_inside(), antimeridian] {
            let points: Vec<LonLatHeight> = at.iter().map(|at| rpc.domain().at(*at)).collect();
            let correction = ImageCorrection { linear, ..ImageCorrection::translation(1.25, -0.5) };
            let camera = RpcCamera { rpc, correction };
            let column = |of: fn(&LonLatHeight) -> f64| points.iter().map(of).collect::<Vec<f64>>();
            let [lon, lat, height] = [column(|g| g.lon_deg), column(|g| g.lat_deg), column(|g| g.height_m)];
            let (mut sample, mut line) = (vec![0.0; at.len()], vec![0.0; at.len()]);
            camera.project_many([&lon, &lat, &height], [&mut sample, &mut line]);
            for (i, ground) in points.iter().enumerate() {
                prop_assert_eq!([sample[i], line[i]].map(bits), expected(camera.project(*ground)), "{:?}", ground);
            }
            let plane = camera.rpc.plane(camera.rpc.height_off + 31.0);
            plane.project_many(&camera.correction, [&lon, &lat], [&mut sample, &mut line]);
            for (i, ground) in points.iter().enumerate() {
                let single = plane.project(ground.lon_deg, ground.lat_deg).map(|p| camera.correction.apply(p));
                prop_assert_eq!([sample[i], line[i]].map(bits), expected(single), "{:?}", ground);
            }
        }
    }
}

#[test]
#[should_panic(expected = "3 longitudes, but [3, 2, 3, 3] other numbers")]
fn slices_of_different_lengths_are_refused() {
    let (mut sample, mut line) = ([0.0; 3], [0.0; 3]);
    RpcCamera::new(pushbroom()).project_many([&[7.0; 3], &[43.0; 3], &[0.0; 2]], [&mut sample, &mut line]);
}
