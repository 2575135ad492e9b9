//! Turns a height map back into points.

use raster::{GeoTransform, Grid};

/// Returns the points of a map: x and y of its coordinate reference system, and the value of the
/// pixel times `scale`.
pub fn map_points(heights: &Grid<f32>, geotransform: &GeoTransform, scale: f64) -> Vec<[f64; 3]> {
    collect(heights, scale, |column, row| geotransform.map_from_cell(column, row))
}

/// Returns the points in the frame of the camera, μ = (u / r, v / r, h): right, back (down the
/// picture) and up, metres.
pub fn camera_points(heights: &Grid<f32>, resolution_px_per_m: f64, scale: f64) -> Vec<[f64; 3]> {
    let middle = |pixels: usize| (pixels as f64 - 1.0) / 2.0;
    let (column, row) = (middle(heights.width()), middle(heights.height()));
    collect(heights, scale, |c, r| ((c - column) / resolution_px_per_m, (r - row) / resolution_px_per_m))
}

fn collect(heights: &Grid<f32>, scale: f64, place: impl Fn(f64, f64) -> (f64, f64)) -> Vec<[f64; 3]> {
    let width = heights.width().max(1);
    let known = heights.data().iter().enumerate().filter(|(_, h)| h.is_finite());
    known
        .map(|(i, &height)| {
            let (x, y) = place((i % width) as f64, (i / width) as f64);
            [x, y, f64::from(height) * scale]
        })
        .collect()
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn pixels_without_a_height_give_no_point() {
        let heights = Grid::from_vec(2, 2, vec![1.0, f32::NAN, 3.0, 4.0]).unwrap();
        let at = GeoTransform::north_up(100.0, 200.0, 0.5);
        assert_eq!(
            map_points(&heights, &at, 2.0),
            [[100.25, 199.75, 2.0], [100.25, 199.25, 6.0], [100.75, 199.25, 8.0]]
        );
        assert_eq!(camera_points(&heights, 2.0, 1.0)[0], [-0.25, -0.25, 1.0]);
    }
}
