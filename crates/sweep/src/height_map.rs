//! Heights of one view on one level, with measures of their reliability.

use raster::{Grid, Window};

use crate::tiles::paste;

/// Heights of one view on one level, with their reliability.
///
/// ```
/// let map = sweep::HeightMap::empty(4, 3, 120.0);
/// assert!(map.height_m.data().iter().all(|h| h.is_nan()));
/// ```
#[derive(Debug, Clone)]
pub struct HeightMap {
    /// Origin of `height_m`, metres above the ellipsoid.
    pub origin_m: f64,
    /// Height above the origin, metres; NaN where there is none.
    pub height_m: Grid<f32>,
    /// Standard deviation of the height, from the sharpness of its mode, metres.
    pub sigma_m: Grid<f32>,
    /// Distinctness of the height: 0 if a second height fits as well, up to 1.
    pub confidence: Grid<f32>,
    /// Share of the contrast around the pixel that the views agree on at its height, 0 to 1. Near 0
    /// the height comes from its surroundings only.
    pub support: Grid<f32>,
}

impl HeightMap {
    /// Returns a map without heights.
    pub fn empty(width: usize, height: usize, origin_m: f64) -> Self {
        Self {
            origin_m,
            height_m: Grid::filled(width, height, f32::NAN),
            sigma_m: Grid::filled(width, height, f32::NAN),
            confidence: Grid::filled(width, height, 0.0),
            support: Grid::filled(width, height, 0.0),
        }
    }

    /// Drops all but the heights: what other views are compared with once the view is placed.
    pub fn keep_heights(&mut self) {
        for measure in [&mut self.sigma_m, &mut self.confidence, &mut self.support] {
            *measure = Grid::filled(0, 0, f32::NAN);
        }
    }

    /// Removes the height of a pixel.
    pub(crate) fn clear(&mut self, at: (usize, usize)) {
        self.height_m[at] = f32::NAN;
        self.sigma_m[at] = f32::NAN;
        self.confidence[at] = 0.0;
        self.support[at] = 0.0;
    }

    /// Copies a part of the map to a window.
    pub(crate) fn put(&mut self, at: Window, part: &Self) {
        paste(&mut self.height_m, at, &part.height_m);
        paste(&mut self.sigma_m, at, &part.sigma_m);
        paste(&mut self.confidence, at, &part.confidence);
        paste(&mut self.support, at, &part.support);
    }
}

/// Returns the least and the greatest height in a window, metres above the ellipsoid; `None` if it
/// has no height.
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
