//! RPCs of our own making for the tests: sizes and signs as real sensors have them.
#![allow(dead_code)]

use camera::Rpc;

/// A 0.5 m pushbroom on a 20 km scene, 15° off nadir: small cubic terms, denominators within 1 % of
/// 1.
pub(crate) fn pushbroom() -> Rpc {
    let mut line_num = small_terms(1, 3e-4);
    line_num[..4].copy_from_slice(&[-2.1e-3, 0.047, -1.062, 0.018]);
    let mut samp_num = small_terms(2, 3e-4);
    samp_num[..4].copy_from_slice(&[3.4e-3, 1.034, 0.012, -0.021]);
    let mut line_den = small_terms(3, 1e-4);
    line_den[..4].copy_from_slice(&[1.0, 1.1e-3, -2.4e-3, -4e-4]);
    let mut samp_den = small_terms(4, 1e-4);
    samp_den[..4].copy_from_slice(&[1.0, -2.0e-3, 1.7e-3, -5e-4]);
    Rpc {
        line_off: 20_213.0,
        samp_off: 19_871.5,
        lat_off: 43.71,
        long_off: 7.26,
        height_off: 310.0,
        line_scale: 20_214.0,
        samp_scale: 19_872.5,
        lat_scale: 0.0912,
        long_scale: 0.1243,
        height_scale: 420.0,
        line_num,
        line_den,
        samp_num,
        samp_den,
        err_bias_m: None,
        err_rand_m: None,
    }
}

/// A crop of [`pushbroom`] whose own scales were kept small: normalised image coordinates near −37.
pub(crate) fn crop_far_from_offset() -> Rpc {
    let mut rpc = pushbroom().cropped(camera::ImagePoint::new(1024.0, 39_000.0));
    let grow = |c: &mut [f64; 20], factor: f64| c.iter_mut().for_each(|c| *c *= factor);
    grow(&mut rpc.line_num, rpc.line_scale / 512.0);
    grow(&mut rpc.samp_num, rpc.samp_scale / 512.0);
    rpc.line_scale = 512.0;
    rpc.samp_scale = 512.0;
    rpc
}

/// A pole inside the domain: the line's denominator vanishes near L = 0.8.
pub(crate) fn pole_inside() -> Rpc {
    let mut rpc = pushbroom();
    rpc.line_den[1] = -1.25;
    rpc
}

/// A fold inside the domain: the sample turns back near L = 0.6.
pub(crate) fn fold_inside() -> Rpc {
    let mut rpc = pushbroom();
    rpc.samp_num[7] = -rpc.samp_num[1] / 1.2;
    rpc
}

/// Deterministic small numbers of both signs.
fn small_terms(seed: usize, size: f64) -> [f64; 20] {
    std::array::from_fn(|i| size * (((i * 13 + seed * 7) % 17) as f64 - 8.0) / 8.0)
}
