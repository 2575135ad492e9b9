//! Simple cameras and views for tests.

use camera::{ImagePoint, Rpc, RpcCamera};
use raster::Grid;

use crate::view::View;

/// Metres per degree of the small world of the tests, at its equator.
const METRES_PER_DEGREE: f64 = 111_320.0;

/// A camera of half-metre pixels around (0°, 0°), leaning so that a metre of height moves the image by
/// `parallax` = (samples, lines). It is linear, so every distance in it is exact.
pub(crate) fn leaning_camera(size: usize, parallax: [f64; 2]) -> RpcCamera {
    let half = size as f64 / 2.0;
    let extent_deg = half * 0.5 / METRES_PER_DEGREE;
    let height_scale = 100.0;
    let polynomial = |terms: [f64; 4]| std::array::from_fn(|i| terms.get(i).copied().unwrap_or(0.0));
    RpcCamera::new(Rpc {
        line_off: half - 0.5,
        samp_off: half - 0.5,
        lat_off: 0.0,
        long_off: 0.0,
        height_off: 0.0,
        line_scale: half,
        samp_scale: half,
        lat_scale: extent_deg,
        long_scale: extent_deg,
        height_scale,
        line_num: polynomial([0.0, 0.0, -1.0, parallax[1] * height_scale / half]),
        line_den: polynomial([1.0, 0.0, 0.0, 0.0]),
        samp_num: polynomial([0.0, 1.0, 0.0, parallax[0] * height_scale / half]),
        samp_den: polynomial([1.0, 0.0, 0.0, 0.0]),
        err_bias_m: None,
        err_rand_m: None,
    })
}

/// Numbers below the one asked for, always the same ones (a linear congruential generator; Numerical Recipes, 7.1).
pub(crate) fn random() -> impl FnMut(u32) -> u32 {
    let mut state = 12345u32;
    move |n| {
        state = state.wrapping_mul(1_664_525).wrapping_add(1_013_904_223);
        (state >> 8) % n
    }
}

/// A smooth texture over the ground, different everywhere, with detail down to a few pixels.
fn texture(east_m: f64, north_m: f64) -> f32 {
    let wave = |a: f64, b: f64, c: f64| (a * east_m + b * north_m + c).sin();
    let value = wave(1.1, 0.3, 0.0) + wave(-0.4, 1.3, 1.0) + wave(0.9, -0.8, 2.0) + wave(0.13, 0.21, 3.0);
    (200.0 + 40.0 * value + 25.0 * wave(2.1, 1.7, 0.5) * wave(0.37, -0.23, 0.2)) as f32
}

/// The picture that a camera has of the ground at a constant height.
pub(crate) fn view_of_plane(camera: RpcCamera, size: usize, height_m: f64) -> View {
    let mut image = Grid::filled(size, size, 0.0);
    for line in 0..size {
        for sample in 0..size {
            let at = ImagePoint::new(sample as f64, line as f64);
            let g = camera.localize(at, height_m).expect("the test camera is linear");
            image[(sample, line)] = texture(g.lon_deg * METRES_PER_DEGREE, g.lat_deg * METRES_PER_DEGREE);
        }
    }
    View::new(camera, image)
}
