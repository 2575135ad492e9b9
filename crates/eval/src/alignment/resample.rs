//! Interpolation of grids with voids.
//!
//! A position has a value exactly if its *nearest* cell has one. The value is the bilinear mean of
//! the valid cells among the four neighbours, with their weights scaled to a sum of one. So no-data
//! never enters a mean, and voids neither grow nor shrink when a surface is shifted by part of a
//! cell. Coverage and completeness do not depend on the phase of the two grids.

use raster::Grid;

/// Returns the height at a fractional cell position, or `None` if the nearest cell is void or
/// outside.
pub fn bilinear(grid: &Grid<f32>, column: f64, row: f64) -> Option<f64> {
    let (left, top) = (floor(column)?, floor(row)?);
    let (u, v) = (column - left as f64, row - top as f64);
    let corners = corners(grid, left, top);
    let nearest = corners[usize::from(u >= 0.5) + 2 * usize::from(v >= 0.5)];
    if !nearest.is_finite() {
        return None;
    }
    if u == 0.0 && v == 0.0 {
        return Some(nearest);
    }
    let mut sum = 0.0;
    let mut weights = 0.0;
    let corner_weights = [(1.0 - u) * (1.0 - v), u * (1.0 - v), (1.0 - u) * v, u * v];
    for (value, weight) in corners.into_iter().zip(corner_weights) {
        if value.is_finite() {
            // The sum is relative to the nearest cell, so that a constant surface is reproduced
            // exactly.
            sum += weight * (value - nearest);
            weights += weight;
        }
    }
    Some(nearest + sum / weights)
}

/// Returns the cell at a column and a row, its right neighbour and the two below them. Cells
/// outside the grid are NaN.
fn corners(grid: &Grid<f32>, left: i64, top: i64) -> [f64; 4] {
    let all_inside = || {
        let (column, row) = (usize::try_from(left).ok()?, usize::try_from(top).ok()?);
        let is_inside = column + 1 < grid.width() && row + 1 < grid.height();
        is_inside.then(|| (&grid.row(row)[column..column + 2], &grid.row(row + 1)[column..column + 2]))
    };
    if let Some((upper, lower)) = all_inside() {
        return [upper[0], upper[1], lower[0], lower[1]].map(f64::from);
    }
    let cell = |column: i64, row: i64| {
        let cell = usize::try_from(column).ok().zip(usize::try_from(row).ok());
        cell.and_then(|(column, row)| grid.get(column, row)).map_or(f64::NAN, |&height| f64::from(height))
    };
    [cell(left, top), cell(left + 1, top), cell(left, top + 1), cell(left + 1, top + 1)]
}

/// Returns the cell nearest to a fractional position, or `None` outside the grid. Halves go to the
/// higher index.
pub fn nearest<T: Copy>(grid: &Grid<T>, column: f64, row: f64) -> Option<T> {
    let (column, row) = (floor(column + 0.5)?, floor(row + 0.5)?);
    grid.get(usize::try_from(column).ok()?, usize::try_from(row).ok()?).copied()
}

/// Returns the greatest index that is not above a position. Returns `None` for NaN and for values
/// that no grid can hold.
fn floor(value: f64) -> Option<i64> {
    let towards_zero = value as i64;
    (value.abs() < 1e15).then(|| towards_zero - i64::from(value < towards_zero as f64))
}

#[cfg(test)]
mod tests {
    use super::*;
    use proptest::prelude::*;

    fn plane(width: usize, height: usize) -> Grid<f32> {
        let cells = (0..width * height).map(|i| (i % width) as f32 * 2.0 - (i / width) as f32 * 0.5 + 7.0).collect();
        Grid::from_vec(width, height, cells).unwrap()
    }

    #[test]
    fn no_data_stays_out_of_the_mean_and_keeps_its_cell() {
        let mut grid = Grid::filled(3, 3, 10.0f32);
        grid[(1, 1)] = f32::NAN;
        assert_eq!(bilinear(&grid, 0.4, 0.4), Some(10.0));
        assert_eq!(bilinear(&grid, 0.6, 0.6), None);
        assert_eq!(bilinear(&grid, 1.4, 1.4), None);
        assert_eq!(bilinear(&grid, 1.5, 1.5), Some(10.0));
    }

    #[test]
    fn positions_outside_have_no_value() {
        let grid = plane(4, 3);
        for (column, row) in [(-0.6, 0.0), (3.5, 0.0), (0.0, 2.5), (f64::NAN, 0.0), (1e300, 0.0), (0.0, -1e300)] {
            assert_eq!(bilinear(&grid, column, row), None, "at {column}, {row}");
            assert_eq!(nearest(&grid, column, row), None, "at {column}, {row}");
        }
        assert!(bilinear(&grid, -0.5, 2.4).is_some());
    }

    proptest! {
        #[test]
        fn a_plane_is_reproduced(column in 0.0..7.0f64, row in 0.0..5.0f64) {
            let value = bilinear(&plane(8, 6), column, row).unwrap();
            prop_assert!((value - (2.0 * column - 0.5 * row + 7.0)).abs() < 1e-9);
        }

        #[test]
        fn a_value_exists_where_the_nearest_cell_has_one(
            column in -2.0..10.0f64, row in -2.0..8.0f64, hole in 0usize..48,
        ) {
            let mut grid = plane(8, 6);
            grid.data_mut()[hole] = f32::NAN;
            let by_nearest = nearest(&grid, column, row).is_some_and(f32::is_finite);
            prop_assert_eq!(bilinear(&grid, column, row).is_some(), by_nearest);
        }
    }
}
