//! The scale of a scene: s = mean ‖μ‖ over the back-projected pixels, μ = (u / r, v / r, h) from
//! the camera.
//!
//! Heights divided by s are the ĥ of the network, and r̂ = s · r is the resolution that belongs to
//! them.

use raster::Grid;

/// Computes the mean distance of the camera to the pixels that have a height, metres; `None` if no
/// pixel has one.
///
/// Heights are metres relative to the camera. The rows are summed in order, so that the result does
/// not depend on threads.
pub fn mean_distance_m(heights: &Grid<f32>, resolution_px_per_m: f64) -> Option<f64> {
    let middle = |pixels: usize| (pixels as f64 - 1.0) / 2.0;
    let (column, row) = (middle(heights.width()), middle(heights.height()));
    let (mut sum, mut count) = (0.0, 0u64);
    for r in 0..heights.height() {
        let back = (r as f64 - row) / resolution_px_per_m;
        let mut of_row = 0.0;
        for (c, &height) in heights.row(r).iter().enumerate().filter(|(_, h)| h.is_finite()) {
            let right = (c as f64 - column) / resolution_px_per_m;
            let h = f64::from(height);
            of_row += (right * right + back * back + h * h).sqrt();
            count += 1;
        }
        sum += of_row;
    }
    (count > 0).then(|| sum / count as f64)
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn it_is_the_mean_length() {
        let mut heights = Grid::filled(2, 2, 3.0_f32);
        let expected = (0.25_f64 + 0.25 + 9.0).sqrt();
        assert!((mean_distance_m(&heights, 1.0).unwrap() - expected).abs() < 1e-12);
        heights.data_mut()[0] = f32::NAN;
        assert!((mean_distance_m(&heights, 1.0).unwrap() - expected).abs() < 1e-12);
        heights.data_mut().fill(f32::NAN);
        assert_eq!(mean_distance_m(&heights, 1.0), None);
    }
}
