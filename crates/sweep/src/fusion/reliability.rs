//! Reliability of each height of a fused surface, from its surroundings.
//!
//! Agreement of the views in a cell means little where they disagree beside it, or where heights
//! vary as in trees and at walls. The reliability is the mean agreement over a window, with 0 for
//! unobserved cells, divided by one plus the standard deviation of the window's heights in units of
//! `same_surface_m`. Chosen by it, the best cells of JAX_068 have a smaller error than chosen by
//! the agreement of the cell alone (`benches/results/scenes.md`).

use raster::Grid;

use crate::window_sums::window_sums;

/// Share that is added to the agreement, so that the deviation still ranks cells whose surroundings
/// were interpolated: without any agreement a cell counts this much of one with full agreement.
const INTERPOLATED: f64 = 0.1;

/// Computes the reliability of every height, 0 to 1; NaN in voids.
///
/// `agreement` is 0 to 1 where a height was observed and 0 elsewhere. The window reaches `reach`
/// cells to each side. A standard deviation of `same_surface_m` halves the reliability.
pub fn reliability(height_m: &Grid<f32>, agreement: &Grid<f32>, reach: usize, same_surface_m: f64) -> Grid<f32> {
    let value = |h: f32| if h.is_nan() { 0.0 } else { f64::from(h) };
    let (width, height) = (height_m.width(), height_m.height());
    let heights = height_m.data();
    let count = window_sums(heights.len(), width, reach, |i| f64::from(u8::from(!heights[i].is_nan())));
    let sum = window_sums(heights.len(), width, reach, |i| value(heights[i]));
    let squares = window_sums(heights.len(), width, reach, |i| value(heights[i]).powi(2));
    let agreed = window_sums(heights.len(), width, reach, |i| value(agreement.data()[i]));
    let mut out = height_m.clone();
    for (i, out) in out.data_mut().iter_mut().enumerate().filter(|(_, h)| !h.is_nan()) {
        let n = count[i];
        let mean = sum[i] / n;
        let deviation_m = (squares[i] / n - mean * mean).max(0.0).sqrt();
        let cells = span(i % width, reach, width).len() * span(i / width, reach, height).len();
        let share = (INTERPOLATED + agreed[i] / cells as f64) / (INTERPOLATED + 1.0);
        *out = (share / (1.0 + deviation_m / same_surface_m)) as f32;
    }
    out
}

/// Returns the part of `0..n` within `reach` of `i`.
fn span(i: usize, reach: usize, n: usize) -> std::ops::Range<usize> {
    i.saturating_sub(reach)..(i + reach + 1).min(n)
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn what_stands_alone_or_tumbles_is_believed_less() {
        let mut height_m = Grid::filled(40, 20, 5.0f32);
        let mut agreement = Grid::filled(40, 20, 0.9f32);
        (0..20).for_each(|y| (30..40).for_each(|x| height_m[(x, y)] = 5.0 + 3.0 * ((x + y) % 2) as f32));
        (0..20).for_each(|y| (0..10).for_each(|x| agreement[(x, y)] = 0.0));
        height_m[(20, 10)] = f32::NAN;
        let all = reliability(&height_m, &agreement, 3, 1.0);
        assert!(all[(20, 10)].is_nan());
        assert!((all[(16, 3)] - 1.0 / 1.1).abs() < 1e-6, "{}", all[(16, 3)]);
        assert!((all[(2, 10)] - 0.1 / 1.1).abs() < 1e-6, "{}", all[(2, 10)]);
        assert!((all[(36, 10)] - 1.0 / 1.1 / 2.5).abs() < 0.01, "{}", all[(36, 10)]);
        assert!(all[(2, 10)] < all[(9, 10)] && all[(9, 10)] < all[(16, 10)]);
    }
}
