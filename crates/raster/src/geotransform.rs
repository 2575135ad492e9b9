//! Affine map from raster cells to map coordinates.

use serde::{Deserialize, Serialize};

/// Affine map by GDAL's six coefficients: `x = c0 + (col + 0.5) c1 + (row + 0.5) c2`, `y = c3 +
/// (col + 0.5) c4 + (row + 0.5) c5`, where (col, row) follow this crate's convention (cell centres
/// are integers).
///
/// ```
/// let grid = raster::GeoTransform::north_up(500_000.0, 4_000_000.0, 0.5);
/// assert_eq!(grid.map_from_cell(0.0, 0.0), (500_000.25, 3_999_999.75));
/// assert_eq!(grid.cell_from_map(500_001.25, 3_999_999.75), Some((2.0, 0.0)));
/// ```
#[derive(Debug, Clone, Copy, PartialEq, Serialize, Deserialize)]
pub struct GeoTransform(pub [f64; 6]);

impl GeoTransform {
    /// Returns the transform of a north-up grid whose upper-left *corner* is at (`x_min`, `y_max`),
    /// with square cells of `cell` map units.
    pub const fn north_up(x_min: f64, y_max: f64, cell: f64) -> Self {
        Self([x_min, cell, 0.0, y_max, 0.0, -cell])
    }

    /// Returns the map coordinates of a fractional cell position.
    pub fn map_from_cell(&self, column: f64, row: f64) -> (f64, f64) {
        let c = &self.0;
        let (u, v) = (column + 0.5, row + 0.5);
        (c[0] + u * c[1] + v * c[2], c[3] + u * c[4] + v * c[5])
    }

    /// Returns the fractional cell position of map coordinates, or `None` if the transform is
    /// singular.
    pub fn cell_from_map(&self, x: f64, y: f64) -> Option<(f64, f64)> {
        let c = &self.0;
        let det = c[1] * c[5] - c[2] * c[4];
        if det == 0.0 || !det.is_finite() {
            return None;
        }
        let (dx, dy) = (x - c[0], y - c[3]);
        Some(((dx * c[5] - dy * c[2]) / det - 0.5, (dy * c[1] - dx * c[4]) / det - 0.5))
    }

    /// Returns the transform of a part of the grid whose first cell is at (`column`, `row`).
    pub fn shifted(&self, column: f64, row: f64) -> Self {
        let c = &self.0;
        let (x, y) = (c[0] + column * c[1] + row * c[2], c[3] + column * c[4] + row * c[5]);
        Self([x, c[1], c[2], y, c[4], c[5]])
    }

    /// Returns the side lengths of a cell along columns and rows, in map units.
    pub fn cell_size(&self) -> (f64, f64) {
        let c = &self.0;
        (c[1].hypot(c[4]), c[2].hypot(c[5]))
    }

    /// Returns the side lengths of a cell along columns and rows, metres, on a map whose units are
    /// `metres_per_unit` metres long along x and y.
    ///
    /// ```
    /// let feet = raster::GeoTransform::north_up(0.0, 0.0, 10.0).cell_size_m((0.3048, 0.3048));
    /// assert!((feet.0 - 3.048).abs() < 1e-12 && (feet.1 - 3.048).abs() < 1e-12);
    /// ```
    pub fn cell_size_m(&self, metres_per_unit: (f64, f64)) -> (f64, f64) {
        let (c, (x_m, y_m)) = (&self.0, metres_per_unit);
        ((c[1] * x_m).hypot(c[4] * y_m), (c[2] * x_m).hypot(c[5] * y_m))
    }
}
