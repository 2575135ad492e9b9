//! Quality of splats: PSNR and SSIM against an image, height errors against a surface.
//!
//! PSNR = −10 log₁₀ (mean squared error) for images in [0, 1]. SSIM (Wang et al. 2004) uses
//! Gaussian windows of 11 px, σ 1.5 px, and the constants 0.01² and 0.03², on the mean of the
//! channels. Pixels that do not count have no weight in any window.

use numeric::upper_median;
use raster::Grid;
use serde::{Deserialize, Serialize};

const WINDOW_RADIUS: i64 = 5;
const WINDOW_SIGMA: f64 = 1.5;
const C1: f64 = 1e-4;
const C2: f64 = 9e-4;

/// Errors of rendered heights, metres.
#[derive(Debug, Clone, Copy, PartialEq, Serialize, Deserialize)]
pub struct HeightErrors {
    /// Number of cells compared.
    pub cells: usize,
    /// Root mean square error.
    pub rmse_m: f64,
    /// Mean absolute error.
    pub mae_m: f64,
    /// Median absolute error.
    pub median_m: f64,
    /// Share of the surface's cells that have a rendered height.
    pub share: f64,
}

/// Compares rendered heights with the heights of a surface, both with NaN for voids. Returns `None`
/// without a common cell.
pub fn height_errors(found: &Grid<f32>, truth: &Grid<f32>, truth_minus_found_m: f64) -> Option<HeightErrors> {
    let there = truth.data().iter().filter(|z| z.is_finite()).count();
    let pairs = found.data().iter().zip(truth.data());
    let mut sizes: Vec<f64> = pairs
        .map(|(&f, &t)| (f64::from(f) + truth_minus_found_m - f64::from(t)).abs())
        .filter(|e| e.is_finite())
        .collect();
    let count = sizes.len() as f64;
    let rmse_m = (sizes.iter().map(|e| e * e).sum::<f64>() / count).sqrt();
    let mae_m = sizes.iter().sum::<f64>() / count;
    let median_m = upper_median(&mut sizes)?;
    Some(HeightErrors { cells: sizes.len(), rmse_m, mae_m, median_m, share: count / there as f64 })
}

/// Returns the peak signal-to-noise ratio of two images in [0, 1] over the pixels that count,
/// decibels; `None` when no pixel counts.
///
/// ```
/// use raster::Grid;
/// let (a, b) = (Grid::filled(4, 4, [0.5_f32; 3]), Grid::filled(4, 4, [0.6_f32; 3]));
/// let psnr = splats::psnr_db(&a, &b, &Grid::filled(4, 4, true)).expect("all pixels count");
/// assert!((psnr - 20.0).abs() < 1e-4);
/// ```
pub fn psnr_db(a: &Grid<[f32; 3]>, b: &Grid<[f32; 3]>, counts: &Grid<bool>) -> Option<f64> {
    let (mut sum, mut count) = (0.0, 0usize);
    for ((a, b), _) in a.data().iter().zip(b.data()).zip(counts.data()).filter(|(_, counts)| **counts) {
        for (a, b) in a.iter().zip(b).filter(|(a, b)| a.is_finite() && b.is_finite()) {
            sum += f64::from(a.clamp(0.0, 1.0) - b.clamp(0.0, 1.0)).powi(2);
            count += 1;
        }
    }
    // Equal images have no noise, so the error is limited to the resolution of f32.
    (count > 0).then(|| -10.0 * (sum / count as f64).max(1e-14).log10())
}

/// Returns the structural similarity of two images in [0, 1], averaged over the pixels that count;
/// `None` when none counts.
pub fn ssim(a: &Grid<[f32; 3]>, b: &Grid<[f32; 3]>, counts: &Grid<bool>) -> Option<f64> {
    similarity(a, b, counts).map(|(whole, _)| whole)
}

/// Returns the mean of the structural similarity, and of its part without the brightness.
pub(super) fn similarity(a: &Grid<[f32; 3]>, b: &Grid<[f32; 3]>, counts: &Grid<bool>) -> Option<(f64, f64)> {
    let grey = |p: &[f32; 3]| p.iter().map(|c| f64::from(c.clamp(0.0, 1.0))).sum::<f64>() / 3.0;
    let zip = a.data().iter().zip(b.data()).zip(counts.data());
    let moments: Vec<[f64; 6]> = zip
        .map(|((a, b), &counts)| {
            let usable = counts && a.iter().chain(b).all(|c| c.is_finite());
            let (x, y) = (grey(a), grey(b));
            if usable { [1.0, x, y, x * x, y * y, x * y] } else { [0.0; 6] }
        })
        .collect();
    let blurred = blur(&moments, a.width(), a.height());
    let (mut sum, mut structure, mut count) = (0.0, 0.0, 0usize);
    for (m, _) in blurred.iter().zip(&moments).filter(|(_, own)| own[0] > 0.0) {
        let [x, y, xx, yy, xy] = [1, 2, 3, 4, 5].map(|i| m[i] / m[0]);
        let (vx, vy, cov) = (xx - x * x, yy - y * y, xy - x * y);
        sum += (2.0 * x * y + C1) * (2.0 * cov + C2) / ((x * x + y * y + C1) * (vx + vy + C2));
        structure += (2.0 * cov + C2) / (vx + vy + C2);
        count += 1;
    }
    (count > 0).then(|| (sum / count as f64, structure / count as f64))
}

fn blur(values: &[[f64; 6]], width: usize, height: usize) -> Vec<[f64; 6]> {
    let weight = |d: i64| (-0.5 * (d as f64 / WINDOW_SIGMA).powi(2)).exp();
    let window: Vec<(i64, f64)> = (-WINDOW_RADIUS..=WINDOW_RADIUS).map(|d| (d, weight(d))).collect();
    let along = |values: &[[f64; 6]], step: usize, length: usize, place: &dyn Fn(usize) -> usize| -> Vec<[f64; 6]> {
        (0..values.len())
            .map(|at| {
                let here = place(at) as i64;
                let mut sum = [0.0; 6];
                for (d, w) in window.iter().filter(|(d, _)| (0..length as i64).contains(&(here + d))) {
                    let other = &values[(at as i64 + d * step as i64) as usize];
                    (0..6).for_each(|i| sum[i] += w * other[i]);
                }
                sum
            })
            .collect()
    };
    let rows = along(values, 1, width, &|at| at % width);
    along(&rows, width, height, &|at| at / width)
}

#[cfg(test)]
mod tests {
    use super::*;

    fn image(f: impl Fn(usize, usize) -> f32) -> Grid<[f32; 3]> {
        Grid::from_vec(24, 20, (0..480).map(|i| [f(i % 24, i / 24); 3]).collect()).unwrap()
    }

    #[test]
    fn known_differences_have_known_numbers() {
        let all = Grid::filled(24, 20, true);
        let a = image(|c, r| 0.4 + 0.01 * (c as f32) - 0.005 * (r as f32));
        let b = image(|c, r| 0.5 + 0.01 * (c as f32) - 0.005 * (r as f32));
        assert!((psnr_db(&a, &b, &all).unwrap() - 20.0).abs() < 1e-4);
        assert!((ssim(&a, &a, &all).unwrap() - 1.0).abs() < 1e-12);
        assert!(ssim(&a, &b, &all).unwrap() < 0.99);
        assert_eq!(psnr_db(&a, &b, &Grid::filled(24, 20, false)), None);
        // Pixels that do not count have no influence on those that do.
        let mut counts = all.clone();
        let mut c = a.clone();
        for row in 0..20 {
            for column in 0..6 {
                counts[(column, row)] = false;
                c[(column, row)] = [f32::NAN; 3];
            }
        }
        assert!((ssim(&a, &c, &counts).unwrap() - 1.0).abs() < 1e-12);
        assert!(psnr_db(&a, &c, &counts).unwrap() > 100.0);
    }

    #[test]
    fn heights_are_compared_where_both_are() {
        let truth = Grid::from_vec(4, 1, vec![1.0, 2.0, f32::NAN, 4.0]).unwrap();
        let found = Grid::from_vec(4, 1, vec![1.0, 5.0, 1.0, f32::NAN]).unwrap();
        let errors = height_errors(&found, &truth, 0.0).unwrap();
        assert_eq!((errors.cells, errors.mae_m), (2, 1.5));
        assert!((errors.rmse_m - 4.5f64.sqrt()).abs() < 1e-12 && (errors.share - 2.0 / 3.0).abs() < 1e-12);
        assert_eq!(height_errors(&Grid::filled(4, 1, f32::NAN), &truth, 0.0), None);
    }
}
