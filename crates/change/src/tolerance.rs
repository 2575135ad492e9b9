//! Differences that a displacement of the surfaces within a tolerance does not explain.
//!
//! A cell has risen by what the new height lies above all old heights within the tolerance, or by
//! what all new heights within it lie above the old height, whichever is more. A wall that moved by
//! less than the tolerance thus has not changed, while a new building counts up to its walls.

use raster::Grid;

/// Returns the difference after − before that is left, metres; NaN where either surface has no
/// height. `reach` is the tolerance in cells.
pub(crate) fn unexplained(before: &Grid<f32>, after: &Grid<f32>, reach: usize) -> Grid<f32> {
    let ranges = |grid: &Grid<f32>| (extreme(grid, reach, f32::min), extreme(grid, reach, f32::max));
    let ((low_before, high_before), (low_after, high_after)) = (ranges(before), ranges(after));
    let mut left = Grid::filled(before.width(), before.height(), f32::NAN);
    for (at, left) in left.data_mut().iter_mut().enumerate() {
        let (old, new) = (before.data()[at], after.data()[at]);
        if !(old.is_finite() && new.is_finite()) {
            continue;
        }
        let beyond = |height: f32, low: f32, high: f32| height - height.clamp(low, high);
        let of_new = beyond(new, low_before.data()[at], high_before.data()[at]);
        let of_old = -beyond(old, low_after.data()[at], high_after.data()[at]);
        *left = if of_new.abs() >= of_old.abs() { of_new } else { of_old };
    }
    left
}

/// Returns the extreme value within a square window that reaches `reach` cells to each side; NaN
/// where the window has none.
pub(crate) fn extreme(grid: &Grid<f32>, reach: usize, pick: fn(f32, f32) -> f32) -> Grid<f32> {
    let (width, height) = (grid.width(), grid.height());
    let mut along = Grid::filled(width, height, f32::NAN);
    for row in 0..height {
        let source = grid.row(row);
        for (column, out) in along.row_mut(row).iter_mut().enumerate() {
            let window = &source[column.saturating_sub(reach)..(column + reach + 1).min(width)];
            *out = window.iter().copied().fold(f32::NAN, pick);
        }
    }
    let mut found = Grid::filled(width, height, f32::NAN);
    for row in 0..height {
        for near in row.saturating_sub(reach)..(row + reach + 1).min(height) {
            let source = along.row(near);
            for (out, &value) in found.row_mut(row).iter_mut().zip(source) {
                *out = pick(*out, value);
            }
        }
    }
    found
}

#[cfg(test)]
mod tests {
    use super::*;

    /// A wall at a column, 8 m high to its right.
    fn wall(at: usize) -> Grid<f32> {
        Grid::from_vec(30, 12, (0..360).map(|i| if i % 30 >= at { 8.0 } else { 0.0 }).collect()).unwrap()
    }

    #[test]
    fn a_wall_that_moves_within_the_tolerance_has_not_changed() {
        for moved in [13, 15, 17] {
            assert!(unexplained(&wall(15), &wall(moved), 2).data().iter().all(|d| *d == 0.0), "{moved}");
        }
        let left = unexplained(&wall(15), &wall(20), 2);
        assert!(left.row(5)[17] == -8.0 && left.row(5)[10] == 0.0);
    }

    #[test]
    fn new_and_lost_buildings_count_up_to_their_walls() {
        let (none, mut built) = (Grid::filled(30, 12, 1.0f32), Grid::filled(30, 12, 1.0f32));
        for row in 4..9 {
            built.row_mut(row)[10..20].fill(6.0);
        }
        built[(0, 0)] = f32::NAN;
        for (before, after, sign) in [(&none, &built, 1.0), (&built, &none, -1.0)] {
            let left = unexplained(before, after, 3);
            assert!(left.data()[0].is_nan());
            for at in 1..360 {
                let expected = if built.data()[at] > 5.0 { 5.0 * sign } else { 0.0 };
                assert_eq!(left.data()[at], expected, "{at}");
            }
        }
    }
}
