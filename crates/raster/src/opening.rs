//! Extrema over square windows, and the opening that they make: the highest of the lowest heights,
//! which removes what is narrower than the window and stands out. Voids do not count.
//!
//! The minimum over `n` cells of a line is made by doubling: minima over 1, 2, 4, … cells, then two
//! of them that overlap. That takes log₂ n passes over the line, which the compiler vectorises.

use rayon::prelude::*;

use crate::Grid;

/// Opens a surface with a window of `2·radius + 1` cells. Cells without any finite height in their
/// window are NaN.
///
/// ```
/// use raster::{Grid, opened};
///
/// let mut surface = Grid::filled(9, 9, 1.0);
/// surface[(4, 4)] = 5.0;
/// assert!(opened(&surface, 1).data().iter().all(|height| *height == 1.0));
/// ```
pub fn opened(surface: &Grid<f32>, radius: usize) -> Grid<f32> {
    let low = minima(without_voids(surface), radius);
    // The maximum is the minimum of the negative. A window without heights must not win.
    let negative = low.map(|&h| if h == f32::INFINITY { h } else { -h });
    with_voids(&minima(negative, radius)).map(|h| -h)
}

/// Returns the lowest heights over square windows of `2·radius + 1` cells, NaN without any.
pub fn lowest(surface: &Grid<f32>, radius: usize) -> Grid<f32> {
    with_voids(&minima(without_voids(surface), radius))
}

/// Returns the highest heights over such windows.
pub fn highest(surface: &Grid<f32>, radius: usize) -> Grid<f32> {
    lowest(&surface.map(|h| -h), radius).map(|h| -h)
}

/// Puts infinity, which no minimum takes, into the place of voids.
fn without_voids(surface: &Grid<f32>) -> Grid<f32> {
    surface.map(|&h| if h.is_finite() { h } else { f32::INFINITY })
}

fn with_voids(minima: &Grid<f32>) -> Grid<f32> {
    minima.map(|&h| if h == f32::INFINITY { f32::NAN } else { h })
}

/// Returns the minima over square windows, which are cut at the borders of the grid.
fn minima(grid: Grid<f32>, radius: usize) -> Grid<f32> {
    row_minima(row_minima(grid, radius).transposed(), radius).transposed()
}

fn row_minima(mut grid: Grid<f32>, radius: usize) -> Grid<f32> {
    let width = grid.width();
    if width == 0 || radius == 0 {
        return grid;
    }
    let line = || [vec![0.0; width + 2 * radius], vec![0.0; width + 2 * radius]];
    grid.data_mut().par_chunks_mut(width).for_each_init(line, |[line, next], row| {
        line.fill(f32::INFINITY);
        line[radius..radius + width].copy_from_slice(row);
        let window = 2 * radius + 1;
        let mut length = 1;
        while length < window {
            let ahead = length.min(window - length);
            fold_ahead(line, ahead, next);
            std::mem::swap(line, next);
            length += ahead;
        }
        row.copy_from_slice(&line[..width]);
    });
    grid
}

/// Writes to `out` the minimum of every value and the one `ahead` places on.
fn fold_ahead(line: &[f32], ahead: usize, out: &mut [f32]) {
    let (folded, last) = out.split_at_mut(line.len() - ahead);
    for ((out, own), other) in folded.iter_mut().zip(line).zip(&line[ahead..]) {
        *out = if other < own { *other } else { *own };
    }
    last.copy_from_slice(&line[line.len() - ahead..]);
}

#[cfg(test)]
mod tests {
    use proptest::prelude::*;

    use super::*;

    proptest! {
        #[test]
        fn the_lowest_height_is_that_of_every_window(
            row in prop::collection::vec(-9.0f32..9.0, 1..40), radius in 0usize..12,
        ) {
            let found = lowest(&Grid::from_vec(row.len(), 1, row.clone()).unwrap(), radius);
            for (i, &value) in found.data().iter().enumerate() {
                let window = &row[i.saturating_sub(radius)..(i + radius + 1).min(row.len())];
                prop_assert_eq!(value, window.iter().copied().fold(f32::INFINITY, f32::min));
            }
        }
    }

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
    fn the_highest_heights_equal_a_plain_search() {
        let grid = Grid::from_vec(23, 17, (0..23 * 17).map(|i| (i * 7919 % 101) as f32).collect()).unwrap();
        for radius in [0, 1, 3, 30] {
            assert_eq!(highest(&grid, radius), plain(&grid, radius, f32::max));
        }
    }

    #[test]
    fn voids_stay_voids_only_without_neighbours() {
        let surface = Grid::filled(5, 5, f32::NAN);
        assert!(opened(&surface, 2).data().iter().all(|h| h.is_nan()));
    }

    #[test]
    fn what_is_narrower_than_the_window_goes_and_the_rest_stays() {
        let mut heights = Grid::filled(30, 20, 5.0f32);
        for row in 4..9 {
            for column in 4..9 {
                heights[(column, row)] = 12.0;
            }
            for column in 15..29 {
                heights[(column, row + 5)] = 9.0;
            }
        }
        heights[(20, 2)] = f32::NAN;
        let open = opened(&heights, 2);
        assert_eq!(open[(6, 6)], 12.0);
        let wider = opened(&heights, 3);
        assert_eq!(wider.data().iter().copied().fold(f32::NEG_INFINITY, f32::max), 5.0);
        assert!(opened(&Grid::filled(4, 4, f32::NAN), 2).data().iter().all(|h| h.is_nan()));
        assert_eq!(opened(&Grid::filled(0, 4, 1.0), 2).data().len(), 0);
    }
}
