//! The chain from a reference pixel over the ground at a height to a source pixel, exact and as a
//! local map.
//!
//! Inside a tile the exact RPC chain is replaced by `x = c(h) + A (p − centre)`, with `c` quadratic
//! in the height h. For a given tile the source image then only shifts as the height changes, which
//! makes the cost kernels fast. The map is compared with the exact chain at the tile's corners and
//! four heights; a tile over the error bound is divided.

use camera::{CameraError, ImagePoint, RpcCamera};
use raster::{Window, level_from_level0, level0_from_level};

/// Projects a reference pixel at a height into the source image.
///
/// `at` and the result are positions on pyramid level `level`; `height_m` is metres above the
/// ellipsoid.
///
/// ```
/// use camera::{CameraError, ImagePoint, RpcCamera};
///
/// fn parallax_px_per_m(a: &RpcCamera, b: &RpcCamera, at: ImagePoint) -> Result<f64, CameraError> {
///     let low = sweep::source_from_reference(a, b, 0, at, 0.0)?;
///     let high = sweep::source_from_reference(a, b, 0, at, 10.0)?;
///     Ok((high.sample - low.sample).hypot(high.line - low.line) / 10.0)
/// }
/// ```
///
/// # Errors
/// Returns the error of the camera that fails: the reference in localising, the source in
/// projecting.
pub fn source_from_reference(
    reference: &RpcCamera,
    source: &RpcCamera,
    level: u32,
    at: ImagePoint,
    height_m: f64,
) -> Result<ImagePoint, CameraError> {
    let at = ImagePoint::new(level0_from_level(at.sample, level), level0_from_level(at.line, level));
    let p = source.project(reference.localize(at, height_m)?)?;
    Ok(ImagePoint::new(level_from_level0(p.sample, level), level_from_level0(p.line, level)))
}

/// [`source_from_reference`] for kernels, which hold positions as (column, row).
pub(crate) fn source_column_row(
    reference: &RpcCamera,
    source: &RpcCamera,
    level: u32,
    [column, row]: [f64; 2],
    height_m: f64,
) -> Result<[f64; 2], CameraError> {
    let at = source_from_reference(reference, source, level, ImagePoint::new(column, row), height_m)?;
    Ok([at.sample, at.line])
}

/// Box of pixel centres on a pyramid level, from `(x0, y0)` to `(x1, y1)` inclusive.
#[derive(Debug, Clone, Copy)]
pub(crate) struct PixelBox {
    /// First column.
    pub(crate) x0: f64,
    /// First row.
    pub(crate) y0: f64,
    /// Last column.
    pub(crate) x1: f64,
    /// Last row.
    pub(crate) y1: f64,
}

impl PixelBox {
    /// Returns the box of a window's pixels.
    pub(crate) fn of_window(w: Window) -> Self {
        let (x1, y1) = (w.x + w.width as i64 - 1, w.y + w.height as i64 - 1);
        Self { x0: w.x as f64, y0: w.y as f64, x1: x1 as f64, y1: y1 as f64 }
    }

    /// Returns the box of a single position.
    pub(crate) fn of_point([x, y]: [f64; 2]) -> Self {
        Self { x0: x, y0: y, x1: x, y1: y }
    }

    /// Returns the centre of the box.
    pub(crate) fn centre(self) -> [f64; 2] {
        [0.5 * (self.x0 + self.x1), 0.5 * (self.y0 + self.y1)]
    }
}

/// A local map from positions in a tile of the reference, and heights, to the source: see the
/// module.
///
/// Positions are (column, row) on the level; the target may be any plane.
#[derive(Debug, Clone, Copy)]
pub(crate) struct LocalMap {
    /// Centre of the tile.
    centre: [f64; 2],
    /// The matrix A.
    linear: [[f64; 2]; 2],
    /// Middle of the heights, metres above the ellipsoid.
    mid_height_m: f64,
    /// Source position c of the tile's centre, for column and row: constant, per metre and per
    /// square metre of height above the middle.
    by_height: [[f64; 3]; 2],
    /// Largest distance to the exact chain at the check points, source pixels.
    pub(crate) max_error_px: f64,
}

impl LocalMap {
    /// Fits the map to `exact` over the box `[x0, x1] × [y0, y1]` of pixel centres and the heights
    /// from `h_lo` to `h_hi`, and measures its error.
    ///
    /// # Errors
    /// Returns an error of `exact`.
    pub(crate) fn fit(
        area: PixelBox,
        (h_lo, h_hi): (f64, f64),
        exact: impl Fn([f64; 2], f64) -> Result<[f64; 2], CameraError>,
    ) -> Result<Self, CameraError> {
        let PixelBox { x0, y0, x1, y1 } = area;
        let centre = area.centre();
        let mid_height_m = 0.5 * (h_lo + h_hi);
        // Half a metre keeps the quadratic well defined when the range is a single plane.
        let half = (0.5 * (h_hi - h_lo)).max(0.5);
        let (rx, ry) = ((0.5 * (x1 - x0)).max(1.0), (0.5 * (y1 - y0)).max(1.0));
        let mid = exact(centre, mid_height_m)?;
        let (low, high) = (exact(centre, mid_height_m - half)?, exact(centre, mid_height_m + half)?);
        let (left, right) =
            (exact([centre[0] - rx, centre[1]], mid_height_m)?, exact([centre[0] + rx, centre[1]], mid_height_m)?);
        let (up, down) =
            (exact([centre[0], centre[1] - ry], mid_height_m)?, exact([centre[0], centre[1] + ry], mid_height_m)?);
        let axis = |i: usize| {
            [mid[i], (high[i] - low[i]) / (2.0 * half), (high[i] - 2.0 * mid[i] + low[i]) / (2.0 * half * half)]
        };
        let row = |i: usize| [(right[i] - left[i]) / (2.0 * rx), (down[i] - up[i]) / (2.0 * ry)];
        let mut map =
            Self { centre, linear: [row(0), row(1)], mid_height_m, by_height: [axis(0), axis(1)], max_error_px: 0.0 };
        for h in [mid_height_m - half, mid_height_m - 0.5 * half, mid_height_m + 0.5 * half, mid_height_m + half] {
            for p in [[x0, y0], [x1, y0], [x0, y1], [x1, y1]] {
                let (e, m) = (exact(p, h)?, map.at(p, h));
                map.max_error_px = map.max_error_px.max((e[0] - m[0]).hypot(e[1] - m[1]));
            }
        }
        Ok(map)
    }

    /// Maps a reference position at a height to the source.
    #[inline(always)]
    pub(crate) fn at(&self, p: [f64; 2], height_m: f64) -> [f64; 2] {
        let c = self.centre_at(height_m);
        let d = [p[0] - self.centre[0], p[1] - self.centre[1]];
        [
            c[0] + self.linear[0][0] * d[0] + self.linear[0][1] * d[1],
            c[1] + self.linear[1][0] * d[0] + self.linear[1][1] * d[1],
        ]
    }

    /// Returns the shift, in *reference* pixels, that brings the source image from its place over
    /// the reference at the middle height to that at `height_m`; `None` if the linear part is
    /// singular.
    pub(crate) fn shift_at(&self, height_m: f64) -> Option<[f64; 2]> {
        let (c, m) = (self.centre_at(height_m), self.centre_at(self.mid_height_m));
        self.solve([c[0] - m[0], c[1] - m[1]])
    }

    /// Returns the reference vector that the linear part maps to a source vector.
    fn solve(&self, d: [f64; 2]) -> Option<[f64; 2]> {
        let [[a, b], [e, f]] = self.linear;
        let det = a * f - b * e;
        (det.abs() > 1e-9).then(|| [(f * d[0] - b * d[1]) / det, (a * d[1] - e * d[0]) / det])
    }

    /// Returns the reference position of a source position at the middle height; `None` if the map
    /// is singular.
    pub(crate) fn reference_from_source(&self, q: [f64; 2]) -> Option<[f64; 2]> {
        let c = self.centre_at(self.mid_height_m);
        let [dx, dy] = self.solve([q[0] - c[0], q[1] - c[1]])?;
        Some([self.centre[0] + dx, self.centre[1] + dy])
    }

    /// Returns the middle height, from which [`Self::shift_at`] counts, metres above the ellipsoid.
    pub(crate) fn mid_height_m(&self) -> f64 {
        self.mid_height_m
    }

    #[inline(always)]
    fn centre_at(&self, height_m: f64) -> [f64; 2] {
        let t = height_m - self.mid_height_m;
        let f = |c: [f64; 3]| c[0] + t * (c[1] + t * c[2]);
        [f(self.by_height[0]), f(self.by_height[1])]
    }
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::testing::camera::leaning_camera;
    use proptest::prelude::*;

    proptest! {
        /// The chain to the other image and back.
        #[test]
        fn the_chain_there_and_back_ends_where_it_began(
            (u, v) in (0.0..200.0f64, 0.0..200.0f64), h in -50.0..150.0f64, level in 0..4u32,
        ) {
            let (a, b) = (leaning_camera(400, [0.4, -0.1]), leaning_camera(400, [-0.2, 0.5]));
            let there = source_column_row(&a, &b, level, [u, v], h).unwrap();
            let back = source_column_row(&b, &a, level, there, h).unwrap();
            prop_assert!((back[0] - u).abs() < 1e-6 && (back[1] - v).abs() < 1e-6, "{back:?}");
        }

        #[test]
        fn the_local_map_keeps_its_stated_error(u in 0.0..63.0f64, v in 0.0..63.0f64, t in 0.0..1.0f64) {
            let (a, b) = (leaning_camera(400, [0.4, -0.1]), leaning_camera(400, [-0.2, 0.5]));
            let exact = |p, h| source_column_row(&a, &b, 0, p, h);
            let map = LocalMap::fit(PixelBox { x0: 0.0, y0: 0.0, x1: 63.0, y1: 63.0 }, (-20.0, 80.0), exact).unwrap();
            let h = -20.0 + 100.0 * t;
            let (e, m) = (exact([u, v], h).unwrap(), map.at([u, v], h));
            prop_assert!((e[0] - m[0]).hypot(e[1] - m[1]) <= map.max_error_px + 1e-6);
        }
    }
}
