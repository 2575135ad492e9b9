//! Fills cells without a value from the nearest coarser mean (pull-push).

use crate::Grid;

/// Fills the NaN cells of a grid with means of the values around, from ever larger squares. A grid
/// without any value stays as it is.
///
/// ```
/// use raster::{Grid, fill_voids};
///
/// let mut grid = Grid::filled(5, 3, f32::NAN);
/// grid[(0, 0)] = 2.0;
/// grid[(4, 2)] = 4.0;
/// let filled = fill_voids(&grid);
/// assert_eq!((filled[(0, 0)], filled[(1, 1)], filled[(4, 1)]), (2.0, 2.0, 4.0));
/// ```
pub fn fill_voids(grid: &Grid<f32>) -> Grid<f32> {
    let is_full = |grid: &Grid<f32>| !grid.data().iter().any(|v| v.is_nan());
    let mut levels = vec![grid.clone()];
    while let Some(last) = levels.last().filter(|last| last.width() * last.height() > 1 && !is_full(last)) {
        levels.push(halved(last));
    }
    let mut filled = levels.pop().unwrap_or_else(|| grid.clone());
    while let Some(mut fine) = levels.pop() {
        let width = fine.width();
        for (cell, value) in fine.data_mut().iter_mut().enumerate().filter(|(_, value)| value.is_nan()) {
            *value = filled[(cell % width / 2, cell / width / 2)];
        }
        filled = fine;
    }
    filled
}

/// Returns the means of the known cells of squares of two by two.
fn halved(grid: &Grid<f32>) -> Grid<f32> {
    let mut out = Grid::filled(grid.width().div_ceil(2), grid.height().div_ceil(2), f32::NAN);
    for row in 0..out.height() {
        for column in 0..out.width() {
            let (mut sum, mut count) = (0.0f64, 0u32);
            for (dx, dy) in [(0, 0), (1, 0), (0, 1), (1, 1)] {
                if let Some(value) = grid.get(2 * column + dx, 2 * row + dy).filter(|value| !value.is_nan()) {
                    sum += f64::from(*value);
                    count += 1;
                }
            }
            if count > 0 {
                out[(column, row)] = (sum / f64::from(count)) as f32;
            }
        }
    }
    out
}
