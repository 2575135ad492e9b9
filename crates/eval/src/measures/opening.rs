//! Grey-scale opening with a square window: the maximum of the local minima. It removes structures
//! narrower than the window.
//!
//! Each pass along rows or columns takes three comparisons per cell for any window size (van Herk
//! 1992, Pattern Recognition Letters 13, 517-521). Voids neither lower nor raise a neighbour.

use crate::alignment::transpose::transposed;
use raster::Grid;
use rayon::prelude::*;

/// Opens the surface with a window of `2 · radius + 1` cells. The result is void where the window
/// holds no height.
pub(crate) fn opened(heights: &Grid<f32>, radius: usize) -> Grid<f32> {
    let lowest = both_ways(&heights.map(|&h| if h.is_finite() { h } else { f32::INFINITY }), radius, f32::min);
    // A cell whose window holds no height must not raise its neighbours.
    let lowest = lowest.map(|&h| if h.is_finite() { h } else { f32::NEG_INFINITY });
    both_ways(&lowest, radius, f32::max).map(|&h| if h.is_finite() { h } else { f32::NAN })
}

fn both_ways(grid: &Grid<f32>, radius: usize, pick: fn(f32, f32) -> f32) -> Grid<f32> {
    let rows = along_rows(grid, radius, pick);
    transposed(&along_rows(&transposed(&rows), radius, pick))
}

fn along_rows(grid: &Grid<f32>, radius: usize, pick: fn(f32, f32) -> f32) -> Grid<f32> {
    let width = grid.width().max(1);
    let mut picked = Grid::filled(grid.width(), grid.height(), 0.0);
    picked
        .data_mut()
        .par_chunks_mut(width)
        .zip(grid.data().par_chunks(width))
        .for_each(|(out, row)| running(row, radius, pick, out));
    picked
}

/// Computes the extreme of every window from the running extremes of blocks of the window's length,
/// from the start and from the end of each block.
fn running(row: &[f32], radius: usize, pick: fn(f32, f32) -> f32, out: &mut [f32]) {
    let block = 2 * radius + 1;
    let mut from_start = row.to_vec();
    let mut from_end = row.to_vec();
    for (start, end) in from_start.chunks_mut(block).zip(from_end.chunks_mut(block)) {
        (1..start.len()).for_each(|i| start[i] = pick(start[i], start[i - 1]));
        (0..end.len() - 1).rev().for_each(|i| end[i] = pick(end[i], end[i + 1]));
    }
    let last = row.len() - 1;
    for (i, out) in out.iter_mut().enumerate() {
        let (first, end) = (i.saturating_sub(radius), (i + radius).min(last));
        // A window cut off at the start of the row lies within the first block. One cut off at its
        // end may lie within one block too.
        *out = if first / block == end / block {
            row[first..=end].iter().copied().fold(row[i], pick)
        } else {
            pick(from_end[first], from_start[end])
        };
    }
}

#[cfg(test)]
mod tests {
    use super::*;
    use proptest::prelude::*;

    proptest! {
        #[test]
        fn the_running_extreme_is_that_of_every_window(
            row in prop::collection::vec(-9.0f32..9.0, 1..40), radius in 0usize..12,
        ) {
            let mut found = vec![0.0; row.len()];
            running(&row, radius, f32::min, &mut found);
            for (i, &value) in found.iter().enumerate() {
                let window = &row[i.saturating_sub(radius)..(i + radius + 1).min(row.len())];
                prop_assert_eq!(value, window.iter().copied().fold(f32::INFINITY, f32::min));
            }
        }
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
