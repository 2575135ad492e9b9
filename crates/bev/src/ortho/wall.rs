//! Where a wall stands among the cells of a raster.
//!
//! A raster says of a wall only which cell centres are above it and which below. Their pattern says more: along a straight
//! wall that is not parallel to the grid, the steps of the pattern give its place to a fraction of a cell. So the cells
//! are graded 1 (above the middle between the lowest and the highest of the four around the position) and 0, smoothed over the
//! neighbours, and the wall is where the smoothed grades, bilinear between the centres, cross one half. Every centre
//! keeps its own side by at least [`MARGIN`]: what is one cell wide stays about that wide. The crossing is taken at half less
//! [`LEAN`], since smoothing rounds the corners of buildings off. On either side the height is bilinear over that side's cells alone.

use raster::Grid;

/// Weights of the Gaussian at a cell and its neighbours along an axis: 0.7 cells wide, beyond them it is below 2 %.
const TAPS: [f32; 3] = [0.36, 1.0, 0.36];
/// Least distance of a centre's smoothed grade from one half.
const MARGIN: f32 = 0.1;
/// How far below one half the crossing is.
const LEAN: f32 = 0.02;

/// The height at a place `[u, v]` (0 to 1 along columns and rows) among four cells, of which the first is at `corner` and which
/// all have heights: upper left, upper right, lower left, lower right.
pub(super) fn height(cells: &Grid<f32>, corner: (usize, usize), heights: [f32; 4], [u, v]: [f32; 2]) -> f32 {
    let (low, high) = heights.iter().fold((f32::INFINITY, f32::NEG_INFINITY), |(l, h), &z| (l.min(z), h.max(z)));
    let middle = low + (high - low) / 2.0;
    let weights = [(1.0 - u) * (1.0 - v), u * (1.0 - v), (1.0 - u) * v, u * v];
    let mut crossing = LEAN;
    for (k, (&z, weight)) in heights.iter().zip(weights).enumerate() {
        if weight > 0.0 {
            let smooth = smoothed(cells, (corner.0 + k % 2, corner.1 + k / 2), middle) - 0.5;
            crossing += weight * if z > middle { smooth.max(MARGIN) } else { smooth.min(-MARGIN - LEAN) };
        }
    }
    let (mut sum, mut total) = (0.0, 0.0);
    for (&z, weight) in heights.iter().zip(weights) {
        if (z > middle) == (crossing >= 0.0) {
            sum += weight * z;
            total += weight;
        }
    }
    if total > 0.0 { sum / total } else { low }
}

/// The share of cells above a level around a cell, by the Gaussian; cells without a height do not count.
fn smoothed(cells: &Grid<f32>, (column, row): (usize, usize), level: f32) -> f32 {
    let inside = |at: usize, by: usize, size: usize| (at + by).checked_sub(1).filter(|&i| i < size);
    let (mut above, mut total) = (0.0, 0.0);
    for (j, along_rows) in TAPS.iter().enumerate() {
        let Some(r) = inside(row, j, cells.height()) else { continue };
        let line = cells.row(r);
        for (i, along_columns) in TAPS.iter().enumerate() {
            let Some(c) = inside(column, i, cells.width()) else { continue };
            if line[c].is_finite() {
                let weight = along_rows * along_columns;
                total += weight;
                above += if line[c] > level { weight } else { 0.0 };
            }
        }
    }
    if total > 0.0 { above / total } else { 0.5 }
}

#[cfg(test)]
mod tests {
    use super::*;
    use proptest::prelude::*;

    const SIZE: usize = 24;

    /// Cells above a straight wall: 10 m where a (c - 12) + b (r - 12) > d.
    fn wall(a: f32, b: f32, d: f32) -> Grid<f32> {
        let above = |i: usize| a * ((i % SIZE) as f32 - 12.0) + b * ((i / SIZE) as f32 - 12.0) > d;
        Grid::from_vec(SIZE, SIZE, (0..SIZE * SIZE).map(|i| if above(i) { 10.0 } else { 0.0 }).collect()).unwrap()
    }

    fn at(cells: &Grid<f32>, column: f32, row: f32) -> f32 {
        let (c, r) = (column as usize, row as usize);
        let heights = [(c, r), (c + 1, r), (c, r + 1), (c + 1, r + 1)].map(|cell| cells[cell]);
        height(cells, (c, r), heights, [column - c as f32, row - r as f32])
    }

    proptest! {
        /// The side of a straight wall is right but for a strip of a third of a cell, and on average of far less.
        #[test]
        fn a_straight_wall_is_found_between_the_cells(angle in 0.0..6.3f32, d in -1.0..1.0f32) {
            let (a, b) = (angle.cos(), angle.sin());
            let cells = wall(a, b, d);
            let (mut wrong, mut length) = (0, 0);
            for k in 0..160 * 160 {
                let [c, r] = [k % 160, k / 160].map(|i| 4.0 + (i as f32 + 0.5) / 10.0);
                let off = a * (c - 12.0) + b * (r - 12.0) - d;
                length += usize::from(off.abs() < 0.5);
                if (at(&cells, c, r) > 5.0) != (off > 0.0) {
                    wrong += 1;
                    // Along the grid's own axes the pattern has no steps, and says nothing but the cell.
                    prop_assert!(off.abs() < 0.72, "{off} at {c}, {r}");
                }
            }
            prop_assert!((wrong as f32) < 0.5 * length as f32);
        }
    }

    #[test]
    fn centres_keep_their_heights_and_a_turned_wall_its_place() {
        let (a, b) = (17.0_f32.to_radians().cos(), 17.0_f32.to_radians().sin());
        let cells = wall(a, b, 0.3);
        let mut off_by = 0.0;
        for r in 6..18 {
            for c in 6..18 {
                assert_eq!(at(&cells, c as f32, r as f32), cells[(c, r)]);
            }
            // Where the wall crosses this row of centres, against where it is found.
            let truth = 12.0 + (0.3 - b * (r as f32 - 12.0)) / a;
            let found = (0..2000).map(|i| 6.0 + i as f32 * 0.006).find(|&c| at(&cells, c, r as f32) > 5.0).unwrap();
            off_by += (found - truth).abs() / 12.0;
        }
        // Half a cell between the centres would be a quarter of a cell off on average.
        assert!(off_by < 0.17, "{off_by} cells");
    }
}
