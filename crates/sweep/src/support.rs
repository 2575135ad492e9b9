//! How much of the picture stands behind a height: the share of its contrast that the views agree on, over a window.
//!
//! The aggregation carries heights into places that have no texture (a saturated roof, an undeclared void) or another
//! one in every view (water). Costs there are no better than chance, which one pixel's cost does not tell and the mean
//! over a window does. Unrelated pictures differ by as much as one of them holds: `1 − Σ cost / Σ contrast` is then 0, with
//! contrast the mean of the absolute graded census of the reference.

use raster::{Grid, Window};

use crate::cost::{COST_MAX, SourceLevel, census_scale};
use crate::semiglobal::Volume;

/// Half width of the window, pixels: 81 patches bring the spread of a mean at chance down to a few percent.
const REACH: usize = 4;

/// For each pixel of the block the share of contrast agreed on, 0 to 1, at the hypotheses with the least `sums` around it.
pub(crate) fn agreed_share(volume: &Volume<'_>, sums: &[u16], view: &SourceLevel<'_>, window: Window) -> Vec<f32> {
    let contrast = census_contrast(view, window);
    share(volume, sums, &contrast)
}

/// Mean absolute graded census of every pixel, 0 to 1; NaN where the image is invalid.
fn census_contrast(view: &SourceLevel<'_>, window: Window) -> Vec<f32> {
    let scale = census_scale(view);
    let image: &Grid<f32> = view.image;
    let at = |x: i64, y: i64| image.get(usize::try_from(x).ok()?, usize::try_from(y).ok()?).copied();
    let mut out = Vec::with_capacity(window.width * window.height);
    for y in window.y..window.y + window.height as i64 {
        for x in window.x..window.x + window.width as i64 {
            let here = at(x, y).unwrap_or(f32::NAN);
            let around = (-1..=1).flat_map(|j| (-1..=1).map(move |i| (i, j)));
            let known = around.filter_map(|(i, j)| at(x + i, y + j)).filter(|v| !v.is_nan());
            let total: f32 = known.map(|v| ((v - here) * scale).abs().min(1.0)).sum();
            out.push(total / 8.0 + 0.0 * here);
        }
    }
    out
}

fn share(volume: &Volume<'_>, sums: &[u16], contrast: &[f32]) -> Vec<f32> {
    let (w, h) = (volume.width, volume.height);
    let mut own = vec![[0.0f32; 2]; w * h];
    for (p, (own, contrast)) in own.iter_mut().zip(contrast).enumerate().filter(|(_, (_, c))| !c.is_nan()) {
        let range = volume.offsets[p] as usize..volume.offsets[p + 1] as usize;
        let least = sums[range.clone()].iter().zip(&volume.costs[range]).min_by_key(|(s, _)| **s);
        *own = least.map_or([0.0; 2], |(_, c)| [f32::from(*c) / f32::from(COST_MAX), *contrast]);
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
            let [cost, held] = around.clone().fold([0.0; 2], |a, v| add(a, rows[v * w + x]));
            out[y * w + x] = if held > 0.0 { (1.0 - cost / held).max(0.0) } else { 0.0 };
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
    fn a_pixel_has_the_share_that_the_best_hypotheses_around_it_agree_on() {
        // Three hypotheses each; the second has the least sum. On the right half of the contrast is agreed on, on the
        // left nothing, and the lowest rows hold no picture.
        let (width, height) = (40, 30);
        let n = width * height;
        let offsets: Vec<u32> = (0..=n as u32).map(|i| 3 * i).collect();
        let sums: Vec<u16> = [900, 100, 800].repeat(n);
        let cost = |p: usize| if p % width < 20 { [0, 64, 0] } else { [0, 32, 0] };
        let costs: Vec<u8> = (0..n).flat_map(cost).collect();
        let contrast: Vec<f32> = (0..n).map(|p| if p / width < 15 { 64.0 / 127.0 } else { 0.0 }).collect();
        let (low, edges) = (vec![0; n], vec![0; n]);
        let volume = Volume { width, height, low: &low, offsets: &offsets, costs: &costs, edges: &edges };
        let all = share(&volume, &sums, &contrast);
        assert!(all[10 * width + 5] == 0.0 && (all[10 * width + 35] - 0.5).abs() < 1e-6);
        assert!((all[10 * width + 20] - 0.5 * 5.0 / 9.0).abs() < 1e-6);
        assert_eq!(all[25 * width + 35], 0.0);
        let invalid: Vec<f32> = (0..n).map(|p| if p % width < 20 { f32::NAN } else { 64.0 / 127.0 }).collect();
        let right = share(&volume, &sums, &invalid);
        assert!((right[10 * width + 20] - 0.5).abs() < 1e-6 && right[0] == 0.0);
    }
}
