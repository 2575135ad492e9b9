//! How much of the picture stands behind a height: the views' correlation at the chosen hypotheses, over a window.
//!
//! The aggregation carries heights into places that have no texture (a saturated roof, an undeclared void) or another
//! one in every view (water). Costs there are no better than chance, which one pixel's cost does not tell and the mean
//! over a window does.

use crate::cost::COST_MAX;
use crate::semiglobal::Volume;

/// Half width of the window, pixels: 81 patches bring the spread of a mean chance correlation down to two percent.
const REACH: usize = 4;

/// For each pixel of the block the mean correlation, 0 to 1, at the hypotheses with the least `sums` around it; pixels
/// for which `valid` is false are left out of the means.
pub(crate) fn mean_correlation(volume: &Volume<'_>, sums: &[u16], valid: impl Fn(usize) -> bool) -> Vec<f32> {
    let (w, h) = (volume.width, volume.height);
    let mut own = vec![[0.0f32; 2]; w * h];
    for (p, own) in own.iter_mut().enumerate().filter(|(p, _)| valid(*p)) {
        let range = volume.offsets[p] as usize..volume.offsets[p + 1] as usize;
        let least = sums[range.clone()].iter().zip(&volume.costs[range]).min_by_key(|(s, _)| **s);
        *own = least.map_or([0.0; 2], |(_, c)| [1.0 - f32::from(*c) / f32::from(COST_MAX), 1.0]);
    }
    let mut rows = vec![[0.0f32; 2]; w * h];
    for (to, from) in rows.chunks_exact_mut(w).zip(own.chunks_exact(w)) {
        for (x, to) in to.iter_mut().enumerate() {
            *to = total(&from[x.saturating_sub(REACH)..(x + REACH + 1).min(w)]);
        }
    }
    let mut out = vec![0.0; w * h];
    for y in 0..h {
        let around = y.saturating_sub(REACH)..(y + REACH + 1).min(h);
        for x in 0..w {
            let [sum, n] = around.clone().fold([0.0; 2], |a, v| add(a, rows[v * w + x]));
            out[y * w + x] = if n > 0.0 { sum / n } else { 0.0 };
        }
    }
    out
}

fn total(values: &[[f32; 2]]) -> [f32; 2] {
    values.iter().fold([0.0; 2], |a, b| add(a, *b))
}

fn add(a: [f32; 2], b: [f32; 2]) -> [f32; 2] {
    [a[0] + b[0], a[1] + b[1]]
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn a_pixel_has_the_mean_of_the_best_hypotheses_around_it() {
        // Three hypotheses each; the second has the least sum. The right half agrees by half, the left not at all.
        let (width, height) = (40, 20);
        let n = width * height;
        let offsets: Vec<u32> = (0..=n as u32).map(|i| 3 * i).collect();
        let sums: Vec<u16> = [900, 100, 800].repeat(n);
        let cost = |p: usize| if p % width < 20 { [0, 127, 0] } else { [0, 64, 0] };
        let costs: Vec<u8> = (0..n).flat_map(cost).collect();
        let (low, edges) = (vec![0; n], vec![0; n]);
        let volume = Volume { width, height, low: &low, offsets: &offsets, costs: &costs, edges: &edges };
        let all = mean_correlation(&volume, &sums, |_| true);
        let half = 1.0 - 64.0 / 127.0;
        assert!(all[10 * width + 5] == 0.0 && (all[10 * width + 35] - half).abs() < 1e-6);
        assert!((all[10 * width + 20] - half * 5.0 / 9.0).abs() < 1e-6);
        let left_out = mean_correlation(&volume, &sums, |p| p % width >= 20);
        assert!((left_out[10 * width + 20] - half).abs() < 1e-6 && left_out[0] == 0.0);
    }
}
