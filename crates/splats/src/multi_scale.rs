//! Structural similarity over five scales (Wang, Simoncelli and Bovik, "Multiscale structural
//! similarity", Asilomar 2003).
//!
//! MS-SSIM = l₅^w₅ ∏ cᵢ^wᵢ, with c the mean of contrast and structure at a scale, l the mean of the
//! whole similarity at the coarsest one, and the weights of the paper. Each scale is the mean of
//! squares of 2 × 2 pixels of the finer one. Windows and constants are those of [`crate::ssim`].

use raster::Grid;

use super::quality::similarity;

/// Weights of the scales, the finest first.
const WEIGHTS: [f64; 5] = [0.0448, 0.2856, 0.3001, 0.2363, 0.1333];
/// Least side of the coarsest scale, pixels: the window.
const LEAST_SIDE: usize = 11;

/// Returns the structural similarity over five scales of two images in [0, 1], over the pixels that
/// count; `None` when none counts, and for images with a side below 176 pixels, whose coarsest
/// scale would be smaller than the window. Means below 0 count as 0, as usual.
pub fn ms_ssim(a: &Grid<[f32; 3]>, b: &Grid<[f32; 3]>, counts: &Grid<bool>) -> Option<f64> {
    if a.width().min(a.height()) < LEAST_SIDE << (WEIGHTS.len() - 1) {
        return None;
    }
    let (mut a, mut b, mut counts) = (a.clone(), b.clone(), counts.clone());
    let mut product = 1.0;
    for (scale, weight) in WEIGHTS.into_iter().enumerate() {
        let is_last = scale + 1 == WEIGHTS.len();
        let (whole, structure) = similarity(&a, &b, &counts)?;
        product *= (if is_last { whole } else { structure }).max(0.0).powf(weight);
        if !is_last {
            let fine = counts.clone();
            let all = |x: usize, y: usize| (0..4).all(|i| fine[(2 * x + i % 2, 2 * y + i / 2)]);
            counts = halved(&fine, &|x, y| all(x, y));
            [&mut a, &mut b].into_iter().for_each(|image| {
                let from = image.clone();
                *image = halved(&from, &|x, y| {
                    let four = [0, 1, 2, 3].map(|i| from[(2 * x + i % 2, 2 * y + i / 2)]);
                    [0, 1, 2].map(|c| four.iter().map(|pixel| pixel[c].clamp(0.0, 1.0)).sum::<f32>() / 4.0)
                });
            });
        }
    }
    Some(product)
}

/// Returns a grid of half the size of another one.
fn halved<T: Clone, U>(from: &Grid<T>, value: &dyn Fn(usize, usize) -> U) -> Grid<U> {
    let (width, height) = (from.width() / 2, from.height() / 2);
    let values = (0..width * height).map(|i| value(i % width, i / width)).collect();
    Grid::from_vec(width, height, values).expect("as many values as pixels")
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn equal_images_are_similar_and_noise_counts_less_at_coarse_scales() {
        let side = 192;
        let image = |noise: f32| {
            let value = |i: usize| {
                let (x, y) = ((i % side) as f32, (i / side) as f32);
                let sign = if (i % side + i / side).is_multiple_of(2) { 1.0 } else { -1.0 };
                [0.5 + 0.3 * (x / 9.0).sin() * (y / 13.0).cos() + noise * sign; 3]
            };
            Grid::from_vec(side, side, (0..side * side).map(value).collect()).unwrap()
        };
        let all = Grid::filled(side, side, true);
        assert!((ms_ssim(&image(0.0), &image(0.0), &all).unwrap() - 1.0).abs() < 1e-9);
        let (clean, noisy) = (image(0.0), image(0.1));
        let (many, one) = (ms_ssim(&clean, &noisy, &all).unwrap(), crate::ssim(&clean, &noisy, &all).unwrap());
        // A chequerboard is gone at half the size: only the finest scale counts it.
        let (_, structure) = similarity(&clean, &noisy, &all).unwrap();
        assert!(one < many && (many - structure.powf(WEIGHTS[0])).abs() < 1e-3, "{one} {many} {structure}");
        assert_eq!(ms_ssim(&image(0.0), &image(0.0), &Grid::filled(side, side, false)), None);
        let small = Grid::filled(175, 400, [0.5f32; 3]);
        assert_eq!(ms_ssim(&small, &small, &Grid::filled(175, 400, true)), None);
    }
}
