//! The confidence of a tile's heights, from a raster of confidences on the source's grid.

use raster::{Grid, bilinear};

use super::TileMap;

/// Confidences (0 to 1) at the pixels of a tile that have a height, NaN elsewhere; where the raster has none it is 0.
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
