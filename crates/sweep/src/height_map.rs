//! Heights of one view, with what tells how reliable they are.

use raster::{Grid, Window};

use crate::tiles::paste;

/// Heights of one view on one level, with their reliability.
#[derive(Debug, Clone)]
pub struct HeightMap {
    /// What `height_m` counts from, metres above the ellipsoid.
    pub origin_m: f64,
    /// Height per pixel minus the origin, metres; NaN where there is none.
    pub height_m: Grid<f32>,
    /// Standard deviation of the height by the spread of its mode, metres.
    pub sigma_m: Grid<f32>,
    /// 0 (a second height is as good) to 1.
    pub confidence: Grid<f32>,
    /// Share of the picture's contrast around each pixel that the views agree on at its height, 0 to 1; next to 0 no
    /// picture stands behind the height, only its surroundings.
    pub support: Grid<f32>,
}

impl HeightMap {
    /// A map without any height.
    pub fn empty(width: usize, height: usize, origin_m: f64) -> Self {
        Self {
            origin_m,
            height_m: Grid::filled(width, height, f32::NAN),
            sigma_m: Grid::filled(width, height, f32::NAN),
            confidence: Grid::filled(width, height, 0.0),
            support: Grid::filled(width, height, 0.0),
        }
    }

    /// Makes a pixel one without a height.
    pub(crate) fn clear(&mut self, at: (usize, usize)) {
        self.height_m[at] = f32::NAN;
        self.sigma_m[at] = f32::NAN;
        self.confidence[at] = 0.0;
        self.support[at] = 0.0;
    }

    pub(crate) fn put(&mut self, at: Window, part: &Self) {
        paste(&mut self.height_m, at, &part.height_m);
        paste(&mut self.sigma_m, at, &part.sigma_m);
        paste(&mut self.confidence, at, &part.confidence);
        paste(&mut self.support, at, &part.support);
    }
}

/// Least and greatest height in a window.
pub(crate) fn height_span(map: &HeightMap, w: Window) -> Option<(f64, f64)> {
    let (mut lo, mut hi) = (f32::INFINITY, f32::NEG_INFINITY);
    for y in 0..w.height {
        for h in &map.height_m.row(w.y as usize + y)[w.x as usize..][..w.width] {
            lo = lo.min(*h);
            hi = hi.max(*h);
        }
    }
    (lo <= hi).then(|| (map.origin_m + f64::from(lo), map.origin_m + f64::from(hi)))
}
