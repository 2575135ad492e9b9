//! Black top-hat of an image: how much darker a pixel is than what surrounds it.
//!
//! The closing of an image by a square fills everything dark that is narrower than the square. What
//! the closing adds is the black top-hat: large in shadows, 0 on what is bright or wide.

use raster::Grid;
use rayon::prelude::*;

/// Returns the closing of an image minus the image, for a square of `2 reach + 1` pixels. Pixels
/// without a value take no part and stay without one.
pub(crate) fn black_top_hat(image: &Grid<f32>, reach: usize) -> Grid<f32> {
    let wide = |grid: &Grid<f32>, pick: fn(f32, f32) -> f32, least: f32| {
        turned(&along_rows(&turned(&along_rows(grid, reach, pick, least)), reach, pick, least))
    };
    let known = |grid: &Grid<f32>, void: f32| grid.map(|v| if v.is_finite() { *v } else { void });
    let highest = wide(&known(image, f32::NEG_INFINITY), f32::max, f32::NEG_INFINITY);
    let mut closing = wide(&known(&highest, f32::INFINITY), f32::min, f32::INFINITY);
    closing
        .data_mut()
        .iter_mut()
        .zip(image.data())
        .for_each(|(value, pixel)| *value = (*value - pixel).max(0.0 * pixel));
    closing
}

/// Returns the extreme of each window of `2 reach + 1` pixels along rows (van Herk 1992): extremes
/// from the start and from the end of blocks of the window's length are met in the middle.
fn along_rows(grid: &Grid<f32>, reach: usize, pick: fn(f32, f32) -> f32, neutral: f32) -> Grid<f32> {
    let (width, side) = (grid.width(), 2 * reach + 1);
    let mut out = Grid::filled(width, grid.height(), neutral);
    out.data_mut().par_chunks_mut(width.max(1)).enumerate().for_each(|(y, row)| {
        let mut padded = vec![neutral; width + 2 * reach];
        padded[reach..reach + width].copy_from_slice(grid.row(y));
        let (mut forward, mut backward) = (padded.clone(), padded);
        for at in 1..forward.len() {
            if at % side != 0 {
                forward[at] = pick(forward[at], forward[at - 1]);
            }
        }
        for at in (0..backward.len() - 1).rev() {
            if (at + 1) % side != 0 {
                backward[at] = pick(backward[at], backward[at + 1]);
            }
        }
        for (x, value) in row.iter_mut().enumerate() {
            *value = pick(backward[x], forward[x + side - 1]);
        }
    });
    out
}

/// Swaps rows and columns.
fn turned(grid: &Grid<f32>) -> Grid<f32> {
    let (width, height) = (grid.width(), grid.height());
    let mut out = Grid::filled(height, width, 0.0f32);
    out.data_mut().par_chunks_mut(height.max(1)).enumerate().for_each(|(x, row)| {
        row.iter_mut().enumerate().for_each(|(y, value)| *value = grid[(x, y)]);
    });
    out
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn a_narrow_dark_strip_stands_out_and_a_wide_one_does_not() {
        let mut image = Grid::filled(60, 40, 10.0f32);
        for row in 0..40 {
            image.row_mut(row)[5..9].fill(4.0);
            image.row_mut(row)[20..45].fill(4.0);
        }
        image[(50, 20)] = f32::NAN;
        image[(52, 20)] = 90.0;
        let found = black_top_hat(&image, 4);
        assert_eq!([found[(6, 20)], found[(30, 20)], found[(15, 3)], found[(52, 20)]], [6.0, 0.0, 0.0, 0.0]);
        assert!(found[(50, 20)].is_nan());
    }

    #[test]
    fn windows_equal_a_plain_search() {
        let values: Vec<f32> = (0..23 * 17).map(|i| (i * 7919 % 101) as f32).collect();
        let grid = Grid::from_vec(23, 17, values).unwrap();
        for reach in [0, 1, 3, 30] {
            let found = along_rows(&grid, reach, f32::max, f32::NEG_INFINITY);
            for (x, y) in [(0usize, 0usize), (11, 5), (22, 16), (4, 9)] {
                let window = &grid.row(y)[x.saturating_sub(reach)..(x + reach + 1).min(23)];
                assert_eq!(found[(x, y)], window.iter().copied().fold(f32::NEG_INFINITY, f32::max));
            }
        }
    }
}
