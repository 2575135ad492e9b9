//! Low-pass filter for surfaces with voids: normalised convolution (Knutsson and Westin 1993, CVPR)
//! with the binomial of nine taps along columns and rows (standard deviation 1.41 cells). Voids
//! stay void and enter no mean.

use raster::Grid;
use rayon::prelude::*;

const TAPS: [f32; 9] = [1.0, 8.0, 28.0, 56.0, 70.0, 56.0, 28.0, 8.0, 1.0];
const REACH: usize = TAPS.len() / 2;

/// Smooths the surface where it is valid.
pub(crate) fn smoothed(grid: &Grid<f32>) -> Grid<f32> {
    let width = grid.width().max(1);
    // The sums are relative to some height of the surface, so that single precision is enough.
    let origin = grid.data().iter().copied().find(|h| h.is_finite()).unwrap_or(0.0);
    let mut sums = vec![[0.0f32; 2]; grid.data().len()];
    sums.par_chunks_mut(width)
        .zip(grid.data().par_chunks(width))
        .for_each(|(sums, heights)| along_row(heights, origin, sums));
    let mut result = Grid::filled(grid.width(), grid.height(), f32::NAN);
    result.data_mut().par_chunks_mut(width).enumerate().for_each(|(row, out)| {
        let mut column_sums = vec![[0.0f32; 2]; width];
        let first = row.saturating_sub(REACH);
        for (r, sums) in sums.chunks(width).enumerate().skip(first).take(row + REACH + 1 - first) {
            let weight = TAPS[r + REACH - row];
            column_sums.iter_mut().zip(sums).for_each(|(total, s)| {
                *total = [total[0] + weight * s[0], total[1] + weight * s[1]];
            });
        }
        for ((out, sum), height) in out.iter_mut().zip(&column_sums).zip(grid.row(row)) {
            if height.is_finite() {
                *out = origin + sum[0] / sum[1];
            }
        }
    });
    result
}

/// Computes the weighted sums of the valid heights (less `origin`) and of their weights, around
/// each cell of a row.
fn along_row(heights: &[f32], origin: f32, sums: &mut [[f32; 2]]) {
    for (column, height) in heights.iter().enumerate().filter(|(_, h)| h.is_finite()) {
        let first = column.saturating_sub(REACH);
        for (c, sum) in sums.iter_mut().enumerate().skip(first).take(column + REACH + 1 - first) {
            let weight = TAPS[c + REACH - column];
            *sum = [sum[0] + weight * (height - origin), sum[1] + weight];
        }
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn a_plane_stays_inside_and_voids_stay_void() {
        let mut plane = Grid::filled(21, 19, 0.0f32);
        for row in 0..19 {
            for column in 0..21 {
                plane[(column, row)] = 2300.0 + 0.5 * column as f32 - 0.25 * row as f32;
            }
        }
        let smooth = smoothed(&plane);
        assert!((smooth[(10, 9)] - plane[(10, 9)]).abs() < 1e-3);
        plane[(10, 9)] = f32::NAN;
        let smooth = smoothed(&plane);
        assert!(smooth[(10, 9)].is_nan());
        assert!(smooth.data().iter().filter(|h| h.is_finite()).count() == 21 * 19 - 1);
    }

    #[test]
    fn a_constant_surface_is_kept_whatever_its_voids() {
        let mut grid = Grid::filled(12, 9, 81.5f32);
        grid.data_mut().iter_mut().step_by(3).for_each(|h| *h = f32::NAN);
        assert!(smoothed(&grid).data().iter().filter(|h| h.is_finite()).all(|&h| h == 81.5));
        assert_eq!(smoothed(&Grid::filled(0, 4, 0.0f32)).data().len(), 0);
    }
}
