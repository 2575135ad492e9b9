//! Exposures of images: gains and offsets of their channels.

use raster::Grid;
use splats::psnr_db;

/// Returns the gain and offset that bring values closest to others over the pixels that count
/// (least squares).
pub(super) fn line(values: &[f32], others: impl Fn(usize) -> f32, counts: impl Fn(usize) -> bool) -> (f32, f32) {
    let (mut n, mut x, mut y, mut xx, mut xy) = (0.0, 0.0, 0.0, 0.0, 0.0);
    for (pixel, value) in values.iter().enumerate().filter(|(pixel, value)| value.is_finite() && counts(*pixel)) {
        let (p, r) = (f64::from(*value), f64::from(others(pixel)));
        if r.is_finite() {
            (n, x, y, xx, xy) = (n + 1.0, x + p, y + r, xx + p * p, xy + p * r);
        }
    }
    let variance = n * xx - x * x;
    let gain = if variance > 0.0 { (n * xy - x * y) / variance } else { 0.0 };
    (gain as f32, if n > 0.0 { ((y - gain * x) / n) as f32 } else { 0.0 })
}

/// Returns the signal-to-noise ratio (dB) over the right half of a picture: as it is shown, and
/// after the gain and the offset of each channel that bring its left half to the truth.
///
/// A photograph that was not trained on has an exposure of its own, which no training can know.
/// NeRF in the Wild (Martin-Brualla et al. 2021) fits it on the left half and judges the right one.
pub(super) fn right_half(
    shown: &Grid<[f32; 3]>,
    truth: &Grid<[f32; 3]>,
    counts: &Grid<bool>,
) -> (Option<f64>, Option<f64>) {
    let (width, middle) = (shown.width(), shown.width() / 2);
    let is_left = |pixel: usize| pixel % width < middle;
    let mut judged = counts.clone();
    let pixels = judged.data_mut().iter_mut().enumerate();
    pixels.filter(|(pixel, _)| is_left(*pixel)).for_each(|(_, counts)| *counts = false);
    let plain = psnr_db(shown, truth, &judged);
    let lines = [0, 1, 2].map(|k| {
        let channel: Vec<f32> = shown.data().iter().map(|p| p[k]).collect();
        line(&channel, |pixel| truth.data()[pixel][k], |pixel| is_left(pixel) && counts.data()[pixel])
    });
    let exposed = shown.map(|p| [0, 1, 2].map(|k| lines[k].0 * p[k] + lines[k].1));
    (plain, psnr_db(&exposed, truth, &judged))
}

#[cfg(test)]
mod tests {
    use super::*;

    fn picture(value: &dyn Fn(usize, usize) -> [f32; 3]) -> Grid<[f32; 3]> {
        Grid::from_vec(40, 6, (0..240).map(|pixel| value(pixel % 40, pixel / 40)).collect()).unwrap()
    }

    #[test]
    fn exposures_are_fitted_on_the_left_and_judged_on_the_right() {
        let truth = picture(&|x, y| [0, 1, 2].map(|k| 0.2 + 0.013 * ((x * 7 + y * 3 + k) % 41) as f32));
        // Darker everywhere, and noisy on the right.
        let shown = picture(&|x, y| {
            let noise = if x < 20 { 0.0 } else { 0.01 * if (x + y) % 2 == 0 { 1.0 } else { -1.0 } };
            truth[(x, y)].map(|c| 0.5 * c + 0.1 + noise)
        });
        let (plain, exposed) = right_half(&shown, &truth, &Grid::filled(40, 6, true));
        assert!((exposed.unwrap() - 33.98).abs() < 0.01, "{exposed:?}");
        assert!(plain.unwrap() < 20.0, "{plain:?}");
    }
}
