//! Unit gradients of a smoothed image.

use raster::{Grid, gaussian};
use rayon::prelude::*;

/// Directions of the gradient and what a corner needs of it.
#[derive(Debug)]
pub(crate) struct Gradients {
    /// Unit gradient of each pixel (along columns, along rows); zero where the image is flat or has
    /// no value.
    pub(crate) unit: Grid<[f32; 2]>,
    /// Smaller eigenvalue of the structure tensor.
    pub(crate) corner: Grid<f32>,
}

/// Computes the gradients of an image after smoothing by `sigma_px`.
pub(crate) fn gradients(image: &Grid<f32>, sigma_px: f32) -> Gradients {
    let smooth = gaussian(image, sigma_px);
    let (width, height) = (smooth.width(), smooth.height());
    let mut slopes = Grid::filled(width, height, [0.0f32; 2]);
    slopes.data_mut().par_chunks_mut(width.max(1)).enumerate().for_each(|(y, row)| {
        for (x, slope) in row.iter_mut().enumerate() {
            if x == 0 || y == 0 || x + 1 == width || y + 1 == height {
                continue;
            }
            let found = [smooth[(x + 1, y)] - smooth[(x - 1, y)], smooth[(x, y + 1)] - smooth[(x, y - 1)]];
            if found.iter().all(|d| d.is_finite()) {
                *slope = found;
            }
        }
    });
    let product = |pick: fn(&[f32; 2]) -> f32| gaussian(&slopes.map(pick), 1.5 * sigma_px);
    let (xx, xy, yy) = (product(|d| d[0] * d[0]), product(|d| d[0] * d[1]), product(|d| d[1] * d[1]));
    let mut corner = Grid::filled(width, height, 0.0f32);
    corner.data_mut().par_iter_mut().enumerate().for_each(|(at, least)| {
        let (a, b, c) = (xx.data()[at], xy.data()[at], yy.data()[at]);
        *least = 0.5 * (a + c - ((a - c) * (a - c) + 4.0 * b * b).sqrt());
    });
    let unit = slopes.map(|d| {
        let length = d[0].hypot(d[1]);
        if length > 0.0 { [d[0] / length, d[1] / length] } else { [0.0; 2] }
    });
    Gradients { unit, corner }
}
