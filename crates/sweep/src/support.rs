//! Support of a height by the images: the share of the contrast around a pixel that the views agree
//! on.
//!
//! The aggregation carries heights into places without texture (a saturated roof, an undeclared
//! void) or with different texture in every view (water). Costs there are no better than chance.
//! The cost of a single pixel does not show that, but the mean over a window does. Unrelated
//! images differ by as much as the contrast of one of them, so that `1 − Σ cost / Σ contrast` is
//! 0 there. The contrast is the mean of the absolute graded census of the reference.

use multiversion::multiversion;
use raster::Window;

use crate::cost::{COST_MAX, census_scale};
use crate::view::ViewLevel;
use crate::window_sums::window_sums;

/// Half width of the window, pixels. Over its 81 pixels the mean cost of unrelated images
/// scatters by a few percent only.
const REACH: usize = 4;

/// Returns the share of contrast that is agreed on for each pixel of the window, 0 to 1. `best` are
/// the costs of its pixels at the hypotheses with the least aggregated cost.
pub(crate) fn agreed_share(best: &[u8], view: &ViewLevel<'_>, window: Window) -> Vec<f32> {
    share(best, &census_contrast(view, window), window.width)
}

/// Computes the mean absolute graded census of every pixel, 0 to 1; NaN where the image is invalid.
fn census_contrast(view: &ViewLevel<'_>, window: Window) -> Vec<f32> {
    let scale = census_scale(view);
    let padded = view.image.window(window.grown(1), f32::NAN);
    let mut out = vec![0.0; window.width * window.height];
    for (y, out) in out.chunks_exact_mut(window.width).enumerate() {
        contrast_of_row([padded.row(y), padded.row(y + 1), padded.row(y + 2)], scale, out);
    }
    out
}

/// Computes the contrast of the middle one of three rows, which have one pixel more at either end.
#[multiversion(targets("x86_64+avx2"))]
fn contrast_of_row(rows: [&[f32]; 3], scale: f32, out: &mut [f32]) {
    let own = &rows[1][1..][..out.len()];
    out.fill(0.0);
    for (row, first) in rows.into_iter().flat_map(|row| (0..3).map(move |first| (row, first))) {
        for ((total, v), here) in out.iter_mut().zip(&row[first..]).zip(own) {
            *total += if v.is_nan() { 0.0 } else { ((v - here) * scale).abs().min(1.0) };
        }
    }
    out.iter_mut().zip(own).for_each(|(total, here)| *total = *total / 8.0 + 0.0 * here);
}

fn share(best: &[u8], contrast: &[f32], width: usize) -> Vec<f32> {
    // In integer units of the cost the sums over the window are exact; 81 costs fit 16 bits.
    let cost = |i: usize| if contrast[i].is_nan() { 0 } else { u16::from(best[i]) };
    let held = |i: usize| if contrast[i].is_nan() { 0 } else { (contrast[i] * f32::from(COST_MAX)).round() as u16 };
    let (costs, held) = (window_sums(best.len(), width, REACH, cost), window_sums(best.len(), width, REACH, held));
    let share = |(cost, held): (&u16, &u16)| match held {
        0 => 0.0,
        _ => (1.0 - f32::from(*cost) / f32::from(*held)).max(0.0),
    };
    costs.iter().zip(&held).map(share).collect()
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn a_pixel_has_the_share_that_the_best_hypotheses_around_it_agree_on() {
        // Half of the contrast is agreed on at the right, none at the left; the lower rows have no
        // contrast.
        let (width, height) = (40, 30);
        let n = width * height;
        let best: Vec<u8> = (0..n).map(|p| if p % width < 20 { 64 } else { 32 }).collect();
        let contrast: Vec<f32> =
            (0..n).map(|p| if p / width < 15 { 64.0 / f32::from(COST_MAX) } else { 0.0 }).collect();
        let all = share(&best, &contrast, width);
        assert!(all[10 * width + 5] == 0.0 && (all[10 * width + 35] - 0.5).abs() < 1e-6);
        assert!((all[10 * width + 20] - 0.5 * 5.0 / 9.0).abs() < 1e-6);
        assert_eq!(all[25 * width + 35], 0.0);
        let invalid: Vec<f32> =
            (0..n).map(|p| if p % width < 20 { f32::NAN } else { 64.0 / f32::from(COST_MAX) }).collect();
        let right = share(&best, &invalid, width);
        assert!((right[10 * width + 20] - 0.5).abs() < 1e-6 && right[0] == 0.0);
    }
}
