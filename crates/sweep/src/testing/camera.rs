//! Simple cameras for tests.

use camera::{Rpc, RpcCamera};

/// Metres per degree of the small world of the tests, at its equator.
pub(crate) const METRES_PER_DEGREE: f64 = 111_320.0;

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
