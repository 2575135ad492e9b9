//! Simple cameras for tests.

use camera::{Rpc, RpcCamera};

/// Metres per degree at the equator, where the tests take place.
pub(crate) const METRES_PER_DEGREE: f64 = 111_320.0;

/// Returns a camera with pixels of half a metre around (0°, 0°), in which a metre of height moves
/// the image by `parallax` (samples, lines). It is linear, so that all distances in it are exact.
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
