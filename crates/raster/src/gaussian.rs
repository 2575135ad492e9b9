//! Gaussian smoothing of grids with no-data.
//!
//! The convolution is separable, truncated at 3 σ, and normalised by the weight of the valid
//! pixels. So neither no-data nor the image's edge darkens its surroundings. No-data stays no-data.

use rayon::prelude::*;

use crate::Grid;

/// Smooths with a standard deviation in pixels. Returns the grid unchanged if σ is not positive or
/// not finite.
pub fn gaussian(grid: &Grid<f32>, sigma_px: f32) -> Grid<f32> {
    let width = grid.width();
    if sigma_px.is_nan() || sigma_px <= 0.0 || !sigma_px.is_finite() || width == 0 {
        return grid.clone();
    }
    let taps = taps(sigma_px, width.max(grid.height()));
    let mut along = Grid::filled(width, grid.height(), [0.0_f32; 2]);
    along.data_mut().par_chunks_mut(width).enumerate().for_each(|(row, out)| {
        for (column, sum) in out.iter_mut().enumerate() {
            *sum = accumulate(&taps, column, width, |i| match grid.row(row)[i] {
                value if value.is_finite() => [value, 1.0],
                _ => [0.0; 2],
            });
        }
    });
    let mut smooth = Grid::filled(width, grid.height(), f32::NAN);
    smooth.data_mut().par_chunks_mut(width).enumerate().for_each(|(row, out)| {
        for (column, value) in out.iter_mut().enumerate() {
            if grid[(column, row)].is_finite() {
                let [sum, weight] = accumulate(&taps, row, grid.height(), |i| along[(column, i)]);
                *value = sum / weight;
            }
        }
    });
    smooth
}

/// Returns the weights at distances 0, 1, … They never reach beyond the grid.
fn taps(sigma_px: f32, longest: usize) -> Vec<f32> {
    let reach = ((3.0 * sigma_px).ceil() as usize).min(longest);
    (0..=reach).map(|d| (-0.5 * (d as f32 / sigma_px).powi(2)).exp()).collect()
}

/// Returns the weighted sum of the pairs around `centre` in `0..length`.
fn accumulate(taps: &[f32], centre: usize, length: usize, pair: impl Fn(usize) -> [f32; 2]) -> [f32; 2] {
    let reach = taps.len() - 1;
    let (first, last) = (centre.saturating_sub(reach), (centre + reach).min(length - 1));
    let mut sum = [0.0_f32; 2];
    for i in first..=last {
        let (tap, [value, weight]) = (taps[i.abs_diff(centre)], pair(i));
        sum = [sum[0] + tap * value, sum[1] + tap * weight];
    }
    sum
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn constants_stay_and_holes_stay_holes() {
        let mut grid = Grid::filled(20, 15, 3.0_f32);
        grid[(4, 4)] = f32::NAN;
        let smooth = gaussian(&grid, 1.5);
        assert!(smooth[(4, 4)].is_nan());
        assert!(smooth.data().iter().filter(|v| v.is_finite()).all(|v| (v - 3.0).abs() < 1e-5));
        assert_eq!(gaussian(&grid, 0.0).data()[0], 3.0);
        assert_eq!(gaussian(&Grid::filled(3, 2, 1.0), 1e9).data().len(), 6);
    }

    #[test]
    fn an_impulse_spreads_with_the_variance_asked_for() {
        let mut grid = Grid::filled(41, 41, 0.0_f32);
        grid[(20, 20)] = 1.0;
        let smooth = gaussian(&grid, 2.0);
        let row: f32 = (0..41).map(|c| smooth[(c, 20)]).sum();
        let variance: f32 = (0..41).map(|c| smooth[(c, 20)] * (c as f32 - 20.0).powi(2)).sum::<f32>() / row;
        let total: f32 = smooth.data().iter().sum();
        // Truncation at 3 σ removes about 3 % of the variance.
        assert!((variance - 4.0).abs() < 0.15 && (total - 1.0).abs() < 1e-4, "{variance} {total}");
    }
}
