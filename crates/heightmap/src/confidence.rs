//! Confidences of the heights of a tile, from a raster of confidences.

use raster::{Grid, bilinear};

use crate::lattice::TileMap;

/// Reads confidences (0 to 1) at the pixels of a tile that have a height, NaN elsewhere. Where the
/// raster has no value, the confidence is 0.
pub fn confidence_from_grid(grid: &Grid<f32>, map: &TileMap, heights: &Grid<f32>) -> Grid<f32> {
    let mut confidences = Grid::filled(heights.width(), heights.height(), f32::NAN);
    for row in 0..heights.height() {
        for (column, confidence) in confidences.row_mut(row).iter_mut().enumerate() {
            if heights[(column, row)].is_finite() {
                let [c, r, _] = map.at(column as f64, row as f64);
                let found = bilinear(grid, c, r);
                *confidence = if found.is_nan() { 0.0 } else { found.clamp(0.0, 1.0) };
            }
        }
    }
    confidences
}
