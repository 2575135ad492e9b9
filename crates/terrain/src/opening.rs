//! Morphological openings with square windows. Voids (NaN) do not count.
//!
//! The minimum over `n` cells of a line is made by doubling: minima over 1, 2, 4, … cells, then two
//! of them that overlap. That takes log₂ n passes over the line, which the compiler vectorises.

use raster::Grid;
use rayon::prelude::*;

/// Opens a surface with a window of `2·radius + 1` cells: what is narrower and stands out is
/// removed. Cells without any height in their window are NaN.
pub(crate) fn opened(surface: &Grid<f32>, radius: usize) -> Grid<f32> {
    let mut low = surface.map(|&h| if h.is_nan() { f32::INFINITY } else { h });
    low = minima(low, radius);
    // The maximum is the minimum of the negative. A window without heights must not win.
    let negative = low.map(|&h| if h == f32::INFINITY { h } else { -h });
    minima(negative, radius).map(|&h| if h == f32::INFINITY { f32::NAN } else { -h })
}

/// Returns the lowest heights over square windows of `2·radius + 1` cells, NaN without any.
pub(crate) fn lowest(surface: &Grid<f32>, radius: usize) -> Grid<f32> {
    let low = surface.map(|&h| if h.is_nan() { f32::INFINITY } else { h });
    minima(low, radius).map(|&h| if h == f32::INFINITY { f32::NAN } else { h })
}

/// Returns the highest heights over such windows.
pub(crate) fn highest(surface: &Grid<f32>, radius: usize) -> Grid<f32> {
    lowest(&surface.map(|h| -h), radius).map(|h| -h)
}

/// Returns the minima over square windows, which are cut at the borders of the grid.
fn minima(grid: Grid<f32>, radius: usize) -> Grid<f32> {
    let along_rows = row_minima(grid, radius);
    transposed(&row_minima(transposed(&along_rows), radius))
}

fn row_minima(mut grid: Grid<f32>, radius: usize) -> Grid<f32> {
    let width = grid.width();
    if width == 0 || radius == 0 {
        return grid;
    }
    let line = || vec![f32::INFINITY; width + 2 * radius];
    grid.data_mut().par_chunks_mut(width).for_each_init(line, |line, row| {
        line.fill(f32::INFINITY);
        line[radius..radius + width].copy_from_slice(row);
        let window = 2 * radius + 1;
        let mut length = 1;
        while length * 2 <= window {
            fold_ahead(line, length);
            length *= 2;
        }
        fold_ahead(line, window - length);
        row.copy_from_slice(&line[..width]);
    });
    grid
}

/// Replaces every value by the minimum of itself and the value `ahead` places on.
fn fold_ahead(line: &mut [f32], ahead: usize) {
    for at in 0..line.len().saturating_sub(ahead) {
        line[at] = line[at].min(line[at + ahead]);
    }
}

fn transposed(grid: &Grid<f32>) -> Grid<f32> {
    let (width, height) = (grid.width(), grid.height());
    let mut turned = Grid::filled(height, width, 0.0);
    if height == 0 {
        return turned;
    }
    turned.data_mut().par_chunks_mut(height).enumerate().for_each(|(column, line)| {
        for (row, cell) in line.iter_mut().enumerate() {
            *cell = grid.data()[row * width + column];
        }
    });
    turned
}

#[cfg(test)]
mod tests {
    use super::*;

    /// The definition, cell by cell.
    fn plain(surface: &Grid<f32>, radius: usize, pick: fn(f32, f32) -> f32) -> Grid<f32> {
        let mut out = surface.clone();
        for row in 0..surface.height() {
            for column in 0..surface.width() {
                let rows = row.saturating_sub(radius)..(row + radius + 1).min(surface.height());
                let around = rows.flat_map(|y| {
                    let columns = column.saturating_sub(radius)..(column + radius + 1).min(surface.width());
                    columns.map(move |x| surface[(x, y)])
                });
                out[(column, row)] = around.fold(f32::NAN, pick);
            }
        }
        out
    }

    #[test]
    fn openings_equal_their_definition() {
        let cell = |at: usize| ((at * 7919) % 101) as f32;
        let mut surface = Grid::from_vec(13, 9, (0..117).map(cell).collect()).unwrap();
        surface[(4, 4)] = f32::NAN;
        for radius in [0, 1, 2, 3, 5, 20] {
            let expected = plain(&plain(&surface, radius, f32::min), radius, f32::max);
            let found = opened(&surface, radius);
            for (a, b) in found.data().iter().zip(expected.data()) {
                assert!(a == b || (a.is_nan() && b.is_nan()), "radius {radius}: {a} {b}");
            }
        }
    }

    #[test]
    fn voids_stay_voids_only_without_neighbours() {
        let surface = Grid::filled(5, 5, f32::NAN);
        assert!(opened(&surface, 2).data().iter().all(|h| h.is_nan()));
    }
}
