//! Transposition of grids, so that a pass along rows also serves for columns.

use raster::Grid;
use rayon::prelude::*;

/// Returns the grid with columns and rows exchanged.
pub(crate) fn transposed<T: Copy + Default + Send + Sync>(grid: &Grid<T>) -> Grid<T> {
    let mut turned = Grid::filled(grid.height(), grid.width(), T::default());
    let rows = turned.width().max(1);
    turned.data_mut().par_chunks_mut(rows).enumerate().for_each(|(column, out)| {
        out.iter_mut().enumerate().for_each(|(row, out)| *out = grid[(column, row)]);
    });
    turned
}
