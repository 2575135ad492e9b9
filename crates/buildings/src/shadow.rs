//! Black top-hat of an image: how much darker a pixel is than what surrounds it.
//!
//! The closing of an image by a square fills everything dark that is narrower than the square. What
//! the closing adds is the black top-hat: large in shadows, 0 on what is bright or wide.

use raster::{Grid, highest, lowest};

/// Returns the closing of an image minus the image, for a square of `2 reach + 1` pixels. Pixels
/// without a value take no part and stay without one.
pub(crate) fn black_top_hat(image: &Grid<f32>, reach: usize) -> Grid<f32> {
    let mut closing = lowest(&highest(image, reach), reach);
    closing
        .data_mut()
        .iter_mut()
        .zip(image.data())
        .for_each(|(value, pixel)| *value = (*value - pixel).max(0.0 * pixel));
    closing
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn a_narrow_dark_strip_stands_out_and_a_wide_one_does_not() {
        let mut image = Grid::filled(60, 40, 10.0f32);
        for row in 0..40 {
            image.row_mut(row)[5..9].fill(4.0);
            image.row_mut(row)[20..45].fill(4.0);
        }
        image[(50, 20)] = f32::NAN;
        image[(52, 20)] = 90.0;
        let found = black_top_hat(&image, 4);
        assert_eq!([found[(6, 20)], found[(30, 20)], found[(15, 3)], found[(52, 20)]], [6.0, 0.0, 0.0, 0.0]);
        assert!(found[(50, 20)].is_nan());
    }
}
