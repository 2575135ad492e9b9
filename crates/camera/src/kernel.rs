//! The vectorised loops behind [`crate::batch`]: plain loops over blocks, compiled once for each instruction set and
//! chosen at run time. A point's result depends on nothing but the point: not on its place in a slice nor on its
//! neighbours. Machines with fused multiply-add differ from those without in the last bits.

use multiversion::multiversion;
use multiversion::target::target_cfg_f;

use crate::plane::{DENOMINATOR_MIN, EXTRAPOLATION_MAX, short_way};
use crate::polynomial::{PlaneCubic, at_height, plane_gradient, plane_value};
use crate::{Rpc, RpcPlane};

/// Points handled together: the block's scratch stays in the first-level cache.
pub(crate) const BLOCK: usize = 64;

/// Newton steps of a localisation after its affine start. Real sensors are below 1e-6 px after two of them.
const NEWTON_STEPS: usize = 3;

/// What is left before the last step may not exceed this, in pixels …
const LAST_RESIDUAL_PX: f64 = 1e-4;
/// … nor this fraction of what the step before found: then the last step leaves less than 1e-8 px.
const LAST_RATIO: f64 = 0.01;
/// Below this the ratio says nothing, because it is rounding.
const ROUNDING_PX: f64 = 1e-8;

/// Projects `n = sample.len()` points; all slices have that length. A point without an image becomes NaN.
#[multiversion(targets("x86_64+avx2+fma"))]
pub(crate) fn project(rpc: &Rpc, lon: &[f64], lat: &[f64], height: &[f64], sample: &mut [f64], line: &mut [f64]) {
    if target_cfg_f!(any(target_feature = "fma", target_arch = "aarch64")) {
        project_loop::<true>(rpc, lon, lat, height, sample, line);
    } else {
        project_loop::<false>(rpc, lon, lat, height, sample, line);
    }
}

/// As [`project`], on one plane.
#[multiversion(targets("x86_64+avx2+fma"))]
pub(crate) fn project_plane(plane: &RpcPlane, lon: &[f64], lat: &[f64], sample: &mut [f64], line: &mut [f64]) {
    if target_cfg_f!(any(target_feature = "fma", target_arch = "aarch64")) {
        project_plane_loop::<true>(plane, lon, lat, sample, line);
    } else {
        project_plane_loop::<false>(plane, lon, lat, sample, line);
    }
}

/// Localises `n = lon.len()` points; all slices have that length. A point for which the fixed number of steps did not
/// provably suffice becomes NaN: the caller gives it to the scalar form.
#[multiversion(targets("x86_64+avx2+fma"))]
pub(crate) fn localize(rpc: &Rpc, sample: &[f64], line: &[f64], height: &[f64], lon: &mut [f64], lat: &mut [f64]) {
    if target_cfg_f!(any(target_feature = "fma", target_arch = "aarch64")) {
        localize_loop::<true>(rpc, sample, line, height, lon, lat);
    } else {
        localize_loop::<false>(rpc, sample, line, height, lon, lat);
    }
}

#[inline(always)]
fn project_loop<const FMA: bool>(
    rpc: &Rpc,
    lon: &[f64],
    lat: &[f64],
    height: &[f64],
    sample: &mut [f64],
    line: &mut [f64],
) {
    let (by_lon, by_lat, by_height) = (1.0 / rpc.long_scale, 1.0 / rpc.lat_scale, 1.0 / rpc.height_scale);
    for ((((&lon, &lat), &height), sample), line) in lon.iter().zip(lat).zip(height).zip(sample).zip(line) {
        let l = short_way(lon - rpc.long_off) * by_lon;
        let p = (lat - rpc.lat_off) * by_lat;
        let h = (height - rpc.height_off) * by_height;
        let value = |c: &[f64; 20]| plane_value::<FMA>(&at_height::<FMA>(c, h), l, p);
        let (ns, ds) = (value(&rpc.samp_num), value(&rpc.samp_den));
        let (nl, dl) = (value(&rpc.line_num), value(&rpc.line_den));
        let good = usable(l, p, ds, dl);
        *sample = if good { rpc.samp_off + rpc.samp_scale * (ns / ds) } else { f64::NAN };
        *line = if good { rpc.line_off + rpc.line_scale * (nl / dl) } else { f64::NAN };
    }
}

#[inline(always)]
fn project_plane_loop<const FMA: bool>(
    plane: &RpcPlane,
    lon: &[f64],
    lat: &[f64],
    sample: &mut [f64],
    line: &mut [f64],
) {
    let (by_lon, by_lat) = (1.0 / plane.long_scale, 1.0 / plane.lat_scale);
    for (((&lon, &lat), sample), line) in lon.iter().zip(lat).zip(sample).zip(line) {
        let l = short_way(lon - plane.long_off) * by_lon;
        let p = (lat - plane.lat_off) * by_lat;
        let value = |c: &PlaneCubic| plane_value::<FMA>(c, l, p);
        let (ns, ds) = (value(&plane.samp.num), value(&plane.samp.den));
        let (nl, dl) = (value(&plane.line.num), value(&plane.line.den));
        let good = usable(l, p, ds, dl);
        *sample = if good { plane.samp.off + plane.samp.scale * (ns / ds) } else { f64::NAN };
        *line = if good { plane.line.off + plane.line.scale * (nl / dl) } else { f64::NAN };
    }
}

/// Whether a point lies within reach and away from the poles; false for NaN.
#[inline(always)]
fn usable(l: f64, p: f64, ds: f64, dl: f64) -> bool {
    (l.abs() <= EXTRAPOLATION_MAX)
        & (p.abs() <= EXTRAPOLATION_MAX)
        & (ds.abs() >= DENOMINATOR_MIN)
        & (dl.abs() >= DENOMINATOR_MIN)
}

#[inline(always)]
fn localize_loop<const FMA: bool>(
    rpc: &Rpc,
    sample: &[f64],
    line: &[f64],
    height: &[f64],
    lon: &mut [f64],
    lat: &mut [f64],
) {
    let (by_sample, by_line, by_height) = (1.0 / rpc.samp_scale, 1.0 / rpc.line_scale, 1.0 / rpc.height_scale);
    // Residuals are compared in pixels; one of the scales may be far larger than the other.
    let pixels = rpc.samp_scale.abs().max(rpc.line_scale.abs());
    for ((((&sample, &line), &height), lon), lat) in sample.iter().zip(line).zip(height).zip(lon).zip(lat) {
        let target = [(sample - rpc.samp_off) * by_sample, (line - rpc.line_off) * by_line];
        let h = (height - rpc.height_off) * by_height;
        let cubics = [&rpc.samp_num, &rpc.samp_den, &rpc.line_num, &rpc.line_den].map(|c| at_height::<FMA>(c, h));
        // The affine start is a Newton step from the centre, where only three terms of each cubic are left.
        let first = newton_step::<FMA>(&cubics, target, 0.0, 0.0);
        let (mut l, mut p) = (first.step[0], first.step[1]);
        let (mut before, mut last) = (f64::INFINITY, first);
        for _ in 0..NEWTON_STEPS {
            before = last.residual;
            last = newton_step::<FMA>(&cubics, target, l, p);
            l += last.step[0];
            p += last.step[1];
        }
        let residual = last.residual * pixels;
        let good = (residual <= LAST_RESIDUAL_PX)
            & ((last.residual <= LAST_RATIO * before) | (residual <= ROUNDING_PX))
            & (last.dens[0] * first.dens[0] > 0.0)
            & (last.dens[1] * first.dens[1] > 0.0)
            & (last.determinant * first.determinant > 0.0)
            & usable(l, p, last.dens[0], last.dens[1]);
        *lon = if good { rpc.long_off + rpc.long_scale * l } else { f64::NAN };
        *lat = if good { rpc.lat_off + rpc.lat_scale * p } else { f64::NAN };
    }
}

/// A Newton step in normalised coordinates.
#[derive(Clone, Copy)]
struct Step {
    step: [f64; 2],
    /// Sum of the sizes of both residuals, normalised.
    residual: f64,
    dens: [f64; 2],
    determinant: f64,
}

/// One step towards r = N/D, s = M/E equal to the target. Each row of the linear system is multiplied by its
/// denominator, which saves the divisions in the derivatives of the ratios.
#[inline(always)]
fn newton_step<const FMA: bool>(cubics: &[PlaneCubic; 4], target: [f64; 2], l: f64, p: f64) -> Step {
    let [n, n_l, n_p] = plane_gradient::<FMA>(&cubics[0], l, p);
    let [d, d_l, d_p] = plane_gradient::<FMA>(&cubics[1], l, p);
    let [m, m_l, m_p] = plane_gradient::<FMA>(&cubics[2], l, p);
    let [e, e_l, e_p] = plane_gradient::<FMA>(&cubics[3], l, p);
    let (r, s) = (n / d, m / e);
    let (a, b) = (target[0] - r, target[1] - s);
    let (r_l, r_p) = (n_l - r * d_l, n_p - r * d_p);
    let (s_l, s_p) = (m_l - s * e_l, m_p - s * e_p);
    let (ad, be) = (a * d, b * e);
    let determinant = r_l * s_p - r_p * s_l;
    let inverse = 1.0 / determinant;
    Step {
        step: [(s_p * ad - r_p * be) * inverse, (r_l * be - s_l * ad) * inverse],
        residual: a.abs() + b.abs(),
        dens: [d, e],
        determinant: determinant * d * e,
    }
}
