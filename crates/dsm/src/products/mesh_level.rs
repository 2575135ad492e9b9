//! Levels of detail of a surface and its picture.

use raster::{GeoTransform, Grid};

/// Side of a tile, cells of its level.
pub(super) const TILE: usize = 256;

/// Heights at every so many cells, and the picture in the same resolution.
#[derive(Debug, Clone)]
pub(super) struct MeshLevel {
    /// Distance of the cells in cells of the finest level.
    pub(super) stride: usize,
    pub(super) heights: Grid<f32>,
    pub(super) picture: Grid<[u8; 3]>,
}

impl MeshLevel {
    /// The level with all cells.
    pub(super) fn finest(heights: &Grid<f32>, colours: &Grid<[u16; 3]>) -> Self {
        let picture = colours.map(|colour| colour.map(|channel| (channel >> 8) as u8));
        Self { stride: 1, heights: heights.clone(), picture }
    }

    /// Takes every second cell, and the mean colours around each.
    pub(super) fn halved(&self) -> Self {
        let size = (self.heights.width().div_ceil(2), self.heights.height().div_ceil(2));
        let mut heights = Grid::filled(size.0, size.1, f32::NAN);
        let mut picture = Grid::filled(size.0, size.1, [0u8; 3]);
        for row in 0..size.1 {
            for column in 0..size.0 {
                heights[(column, row)] = self.heights[(2 * column, 2 * row)];
                picture[(column, row)] = self.mean_colour(2 * column, 2 * row);
            }
        }
        Self { stride: 2 * self.stride, heights, picture }
    }

    /// Returns the place of the cells of this level.
    pub(super) fn geotransform(&self, finest: &GeoTransform) -> GeoTransform {
        // The first cell keeps its middle, so the corner moves by half of the growth of the cells.
        let [x, xc, xr, y, yc, yr] = finest.0;
        let stride = self.stride as f64;
        let shift = 0.5 * (1.0 - stride);
        GeoTransform([x + shift * (xc + xr), xc * stride, xr * stride, y + shift * (yc + yr), yc * stride, yr * stride])
    }

    /// Returns the mean of the colours of a cell and its right and lower neighbours.
    fn mean_colour(&self, column: usize, row: usize) -> [u8; 3] {
        let (mut sum, mut count) = ([0u32; 3], 0);
        for (dx, dy) in [(0, 0), (1, 0), (0, 1), (1, 1)] {
            if let Some(colour) = self.picture.get(column + dx, row + dy) {
                (0..3).for_each(|channel| sum[channel] += u32::from(colour[channel]));
                count += 1;
            }
        }
        sum.map(|sum| (sum / count.max(1)) as u8)
    }
}
