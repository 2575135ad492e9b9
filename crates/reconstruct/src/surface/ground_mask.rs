//! Cells of a surface that get no height.

use raster::{Grid, Window};

/// Cells of a grid that get no height.
#[derive(Debug, Clone)]
pub struct GroundMask {
    /// Cells under a mask. Heights found there are not trusted.
    pub masked: Grid<bool>,
    /// Cells outside the area.
    pub outside: Grid<bool>,
}

impl GroundMask {
    /// Returns whether no cell of a window gets a height.
    pub fn excludes_all(&self, cells: Window) -> bool {
        let columns = self.masked.width();
        let row = |y: usize| (y * columns + cells.x as usize)..(y * columns + cells.x as usize + cells.width);
        (cells.y as usize..cells.y as usize + cells.height).flat_map(row).all(|cell| self.excludes(cell))
    }

    /// Returns whether a cell gets no height.
    pub fn excludes(&self, cell: usize) -> bool {
        self.masked.data()[cell] || self.outside.data()[cell]
    }
}
