//! Where a model is worth comparing: on clear texture in two directions.
//!
//! The smaller eigenvalue of the structure tensor (Shi and Tomasi 1994) is summed over the clear
//! pixels of a window as wide as a chip, so that hidden pixels count as nothing and the window that
//! shows most texture wins.

use raster::Grid;

/// Half width of the window, pixels.
const WINDOW: usize = 12;
/// Distance of the places that are tried, pixels: a quarter of the window.
const STRIDE: usize = 6;

/// Returns the column and row, up to `slack` from the middle of square pictures of one size, around
/// which one of them shows most; `None` where all are flat or hidden.
pub(super) fn best_spot(pictures: &[Grid<f32>], slack: usize) -> Option<[usize; 2]> {
    let mut best: Option<(f64, [usize; 2])> = None;
    for picture in pictures {
        let sums = TensorSums::of(picture);
        let middle = picture.width() / 2;
        let along = || (0..=slack / STRIDE).flat_map(|k| [middle - k * STRIDE, middle + k * STRIDE]);
        for [x, y] in along().flat_map(|y| along().map(move |x| [x, y])) {
            let shown = sums.smaller_eigenvalue([x, y]);
            if shown > best.map_or(0.0, |(most, _)| most) {
                best = Some((shown, [x, y]));
            }
        }
    }
    best.map(|(_, at)| at)
}

/// Sums of the products of gradients from the first pixel on, by column and row.
struct TensorSums {
    width: usize,
    sums: Vec<[f64; 3]>,
}

impl TensorSums {
    fn of(picture: &Grid<f32>) -> Self {
        let (w, h) = (picture.width(), picture.height());
        let width = w + 1;
        let mut sums = vec![[0.0; 3]; width * (h + 1)];
        // Grey values are compared as shares of their spread, so that images of any depth compete.
        // No pixel counts for more than 1: one bright car must not win over a textured roof.
        let known = || picture.data().iter().filter(|v| v.is_finite()).map(|v| f64::from(*v));
        let count = known().count().max(1) as f64;
        let mean = known().sum::<f64>() / count;
        let variance = known().map(|v| (v - mean) * (v - mean)).sum::<f64>() / count;
        for y in 0..h {
            let mut row = [0.0; 3];
            for x in 0..w {
                if x > 0 && y > 0 && x + 1 < w && y + 1 < h {
                    let gx = 0.5 * f64::from(picture[(x + 1, y)] - picture[(x - 1, y)]);
                    let gy = 0.5 * f64::from(picture[(x, y + 1)] - picture[(x, y - 1)]);
                    if (gx + gy).is_finite() && variance > 0.0 {
                        let products = [gx * gx, gx * gy, gy * gy];
                        (0..3).for_each(|k| row[k] += products[k] / (gx * gx + gy * gy + variance));
                    }
                }
                let above = sums[y * width + x + 1];
                sums[(y + 1) * width + x + 1] = std::array::from_fn(|k| above[k] + row[k]);
            }
        }
        Self { width, sums }
    }

    /// Returns the smaller eigenvalue of the sum over the window around a pixel.
    fn smaller_eigenvalue(&self, [x, y]: [usize; 2]) -> f64 {
        let height = self.sums.len() / self.width;
        let ends = |at: usize, size: usize| (at.saturating_sub(WINDOW), (at + WINDOW + 1).min(size - 1));
        let ((left, right), (top, bottom)) = (ends(x, self.width), ends(y, height));
        let at = |x: usize, y: usize| self.sums[y * self.width + x];
        let corners = [at(right, bottom), at(left, bottom), at(right, top), at(left, top)];
        let [a, b, c] = [0, 1, 2].map(|k: usize| corners[0][k] - corners[1][k] - corners[2][k] + corners[3][k]);
        0.5 * (a + c) - (0.25 * (a - c) * (a - c) + b * b).sqrt()
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn clear_texture_wins_over_flat_and_hidden_ground() {
        let texture = |x: usize, y: usize| ((x * x + 3 * y * y + x * y) as f32 * 0.37).sin();
        let cells = |hidden: bool| {
            let one = move |i: usize| match (i % 81, i / 81) {
                (x, _) if x > 44 && hidden => f32::NAN,
                (x, _) if x < 37 || !hidden && x < 44 => 0.0,
                (x, y) => texture(x, y),
            };
            Grid::from_vec(81, 81, (0..81 * 81).map(one).collect()).unwrap()
        };
        let [x, _] = best_spot(&[cells(false)], 24).unwrap();
        assert!(x > 52, "{x}: the texture lies on the right");
        let [x, _] = best_spot(&[cells(true)], 24).unwrap();
        assert!((28..=52).contains(&x), "{x}: the right side is hidden");
        assert_eq!(best_spot(&[Grid::filled(81, 81, 3.0), Grid::filled(81, 81, f32::NAN)], 24), None);
    }
}
