//! The rasters of a surface.

use raster::{Grid, Window};
use sweep::fusion::{CellSource, FILLED, FusedSurface, VOID};

/// The rasters of a surface, all of one size.
#[derive(Debug, Clone)]
pub struct SurfaceRasters {
    /// Height above the ellipsoid from which `height_m` counts, metres.
    pub origin_m: f64,
    /// Heights above the origin, metres; NaN in voids.
    pub height_m: Grid<f32>,
    /// Standard deviations of the heights, metres; NaN in voids. They are estimates where
    /// a height was filled.
    pub sigma_m: Grid<f32>,
    /// Number of views that observed the height.
    pub views: Grid<u8>,
    /// Probability that the height is right, 0 to 1, see [`sweep::fusion::TrustModel`].
    pub confidence: Grid<f32>,
    /// 1 where a height was filled, 0 where it was observed, 255 in voids.
    pub filled: Grid<u8>,
    /// Where each height comes from, or why there is none: codes of [`CellSource`].
    pub source: Grid<u8>,
}

impl SurfaceRasters {
    /// Makes the rasters of a surface after its clean-up. `source` says where each
    /// height comes from.
    pub fn new(fused: FusedSurface, source: &Grid<CellSource>, origin_m: f64) -> Self {
        let marks = source.map(|source| source.filled_flag());
        let FusedSurface { height_m, mut sigma_m, mut views, mut confidence, .. } = fused;
        for (i, h) in height_m.data().iter().enumerate() {
            if h.is_nan() {
                sigma_m.data_mut()[i] = f32::NAN;
            }
            // No observation is behind a cell that was filled or removed as speckle.
            if h.is_nan() || marks.data()[i] == FILLED {
                views.data_mut()[i] = 0;
            }
        }
        for grid in [&mut sigma_m, &mut confidence] {
            grid.data_mut().iter_mut().for_each(|v| *v = shortened(*v));
        }
        Self { origin_m, height_m, sigma_m, views, confidence, filled: marks, source: source.map(|s| s.code()) }
    }

    /// Makes the rasters of cells that all get no height.
    pub fn masked(size: (usize, usize)) -> Self {
        let void = Grid::filled(size.0, size.1, f32::NAN);
        Self {
            origin_m: 0.0,
            height_m: void.clone(),
            sigma_m: void.clone(),
            views: Grid::filled(size.0, size.1, 0),
            confidence: void,
            filled: Grid::filled(size.0, size.1, VOID),
            source: Grid::filled(size.0, size.1, CellSource::Masked.code()),
        }
    }

    /// Returns the cells of a window inside.
    #[must_use]
    pub fn cropped(self, cells: Window) -> Self {
        if cells == Window::whole(self.height_m.width(), self.height_m.height()) {
            return self;
        }
        Self {
            origin_m: self.origin_m,
            height_m: self.height_m.window(cells, f32::NAN),
            sigma_m: self.sigma_m.window(cells, f32::NAN),
            views: self.views.window(cells, 0),
            confidence: self.confidence.window(cells, f32::NAN),
            filled: self.filled.window(cells, VOID),
            source: self.source.window(cells, CellSource::Outside.code()),
        }
    }
}

/// Rounds a value to eight binary digits: the precision of a deviation or a confidence, in half the
/// bits.
fn shortened(value: f32) -> f32 {
    if value.is_finite() { f32::from_bits(value.to_bits().wrapping_add(0x8000) & 0xFFFF_0000) } else { value }
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn shortened_values_are_near() {
        for i in 0..1000u16 {
            let v = 0.001 + 0.37 * f32::from(i);
            assert!((f64::from(shortened(v)) / f64::from(v) - 1.0).abs() <= 1.0 / 256.0);
        }
        assert!(shortened(f32::NAN).is_nan() && shortened(1.0) == 1.0);
    }
}
