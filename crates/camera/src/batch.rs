//! Projection of many points at a time, with the bits of [`RpcCamera::project`] for each.
//!
//! Points go by blocks that stay in the first cache. Within a block, one polynomial after the other
//! is computed for all points, in the order of operations of the single point, so that the compiler
//! can use vector registers and no bit changes. Coordinates lie in one slice each. A point without
//! an image position becomes NaN in both coordinates.

use multiversion::multiversion;

use crate::limits::{DENOMINATOR_MIN, EXTRAPOLATION_MAX, short_way};
use crate::plane::PlaneRatio;
use crate::polynomial::{PlaneCubic, at_height, plane_value};
use crate::{ImageCorrection, ImagePoint, Rpc, RpcCamera, RpcPlane};

/// Points of a block: ten columns of it fit the first cache of every processor.
const BLOCK: usize = 256;

/// A column of a block.
type Column = [f64; BLOCK];

impl RpcCamera {
    /// Projects ground points: longitude and latitude in degrees, heights in metres. `sample` and
    /// `line` take the corrected image positions, pixels.
    ///
    /// ```
    /// use camera::{Rpc, RpcCamera};
    /// # use geodesy::LonLatHeight;
    /// # fn many(rpc: Rpc) -> Result<(), camera::CameraError> {
    /// let camera = RpcCamera::new(rpc);
    /// let (mut sample, mut line) = ([0.0; 2], [0.0; 2]);
    /// camera.project_many([&[2.30, 2.31], &[48.8, 48.9], &[35.0, 80.0]], [&mut sample, &mut line]);
    /// let second = camera.project(LonLatHeight::new(2.31, 48.9, 80.0))?;
    /// assert_eq!((second.sample, second.line), (sample[1], line[1]));
    /// # Ok(())
    /// # }
    /// ```
    ///
    /// # Panics
    /// The slices differ in length.
    pub fn project_many(&self, [lon_deg, lat_deg, height_m]: [&[f64]; 3], [sample, line]: [&mut [f64]; 2]) {
        let count = lon_deg.len();
        let lengths = [lat_deg.len(), height_m.len(), sample.len(), line.len()];
        assert!(lengths == [count; 4], "{count} longitudes, but {lengths:?} other numbers");
        for start in (0..count).step_by(BLOCK) {
            let part = start..(start + BLOCK).min(count);
            let ground = [&lon_deg[part.clone()], &lat_deg[part.clone()], &height_m[part.clone()]];
            project_block(&self.rpc, &self.correction, ground, [&mut sample[part.clone()], &mut line[part]]);
        }
    }
}

impl RpcPlane {
    /// Projects points of the plane: longitude and latitude in degrees. `sample` and `line` take
    /// the image positions, corrected by `correction`, pixels.
    ///
    /// # Panics
    /// The slices differ in length.
    pub fn project_many(
        &self,
        correction: &ImageCorrection,
        [lon_deg, lat_deg]: [&[f64]; 2],
        [sample, line]: [&mut [f64]; 2],
    ) {
        let count = lon_deg.len();
        let lengths = [lat_deg.len(), sample.len(), line.len()];
        assert!(lengths == [count; 3], "{count} longitudes, but {lengths:?} other numbers");
        for start in (0..count).step_by(BLOCK) {
            let part = start..(start + BLOCK).min(count);
            let ground = [&lon_deg[part.clone()], &lat_deg[part.clone()]];
            project_plane_block(self, correction, ground, [&mut sample[part.clone()], &mut line[part]]);
        }
    }
}

#[multiversion(targets("x86_64+avx512f+avx512dq+avx512vl", "x86_64+avx2"))]
fn project_block(rpc: &Rpc, correction: &ImageCorrection, ground: [&[f64]; 3], [sample, line]: [&mut [f64]; 2]) {
    let count = sample.len();
    let [mut l, mut p, mut h] = [[0.0; BLOCK]; 3];
    for i in 0..count {
        l[i] = short_way(ground[0][i] - rpc.long_off) / rpc.long_scale;
        p[i] = (ground[1][i] - rpc.lat_off) / rpc.lat_scale;
        h[i] = (ground[2][i] - rpc.height_off) / rpc.height_scale;
    }
    let cubic = |c: &[f64; 20]| {
        let mut values = [0.0; BLOCK];
        for i in 0..count {
            values[i] = plane_value(&at_height(c, h[i]), l[i], p[i]);
        }
        values
    };
    let numbers = [cubic(&rpc.samp_num), cubic(&rpc.samp_den), cubic(&rpc.line_num), cubic(&rpc.line_den)];
    let axes = [[rpc.samp_off, rpc.samp_scale], [rpc.line_off, rpc.line_scale]];
    finish([&l, &p], &numbers, axes, correction, [sample, line]);
}

#[multiversion(targets("x86_64+avx512f+avx512dq+avx512vl", "x86_64+avx2"))]
fn project_plane_block(
    plane: &RpcPlane,
    correction: &ImageCorrection,
    ground: [&[f64]; 2],
    [sample, line]: [&mut [f64]; 2],
) {
    let count = sample.len();
    let [mut l, mut p] = [[0.0; BLOCK]; 2];
    for i in 0..count {
        [l[i], p[i]] = plane.normalised(ground[0][i], ground[1][i]);
    }
    let cubic = |c: &PlaneCubic| {
        let mut values = [0.0; BLOCK];
        for i in 0..count {
            values[i] = plane_value(c, l[i], p[i]);
        }
        values
    };
    let RpcPlane { samp, line: lines, .. } = plane;
    let numbers = [cubic(&samp.num), cubic(&samp.den), cubic(&lines.num), cubic(&lines.den)];
    let axes = [samp, lines].map(|ratio: &PlaneRatio| ratio.axis.numbers());
    finish([&l, &p], &numbers, axes, correction, [sample, line]);
}

/// Divides the polynomials and corrects the positions; NaN where the checks of a single point fail.
/// `axes` are offset and scale of sample and line.
#[inline(always)]
fn finish(
    [l, p]: [&Column; 2],
    [sample_num, sample_den, line_num, line_den]: &[Column; 4],
    axes: [[f64; 2]; 2],
    correction: &ImageCorrection,
    [sample, line]: [&mut [f64]; 2],
) {
    let reached = |x: f64| x.abs() <= EXTRAPOLATION_MAX;
    let finite = |x: f64| x.abs() <= f64::MAX;
    let divides = |n: f64, d: f64| finite(n) & finite(d) & (d.abs() >= DENOMINATOR_MIN);
    for i in 0..sample.len() {
        let ratios = [[sample_num[i], sample_den[i]], [line_num[i], line_den[i]]];
        let seen =
            reached(l[i]) & reached(p[i]) & divides(ratios[0][0], ratios[0][1]) & divides(ratios[1][0], ratios[1][1]);
        let [s, t] = [0, 1].map(|k| axes[k][0] + axes[k][1] * (ratios[k][0] / ratios[k][1]));
        let at = correction.apply(ImagePoint { sample: s, line: t });
        sample[i] = if seen { at.sample } else { f64::NAN };
        line[i] = if seen { at.line } else { f64::NAN };
    }
}
