//! 360° panoramas in the equirectangular projection, and perspective crops of them.
//!
//! The middle column looks along the camera's z axis, columns turn to the right, rows go from
//! straight up to straight down: azimuth = ((c + ½) / W − ½) · 360°, elevation = (½ − (r + ½) / H)
//! · 180°, pixels counted from the centre of the upper left one. Camera axes: x right, y down, z
//! forward.

use camera::{ImagePoint, Lens, LensError, LensModel, Pose};
use raster::Grid;
use rayon::prelude::*;

/// The pixels of a panorama.
#[derive(Debug, Clone, Copy, PartialEq, Eq)]
pub struct Panorama {
    /// Columns over 360°.
    pub width: usize,
    /// Rows, from the zenith to the nadir.
    pub height: usize,
}

impl Panorama {
    /// Returns the unit vector of a pixel in the axes of the camera.
    ///
    /// ```
    /// let panorama = groundview::Panorama { width: 4, height: 2 };
    /// let [x, _, z] = panorama.direction(1.5, 0.5);
    /// assert!(x.abs() < 1e-12 && (z - 1.0).abs() < 1e-12);
    /// ```
    pub fn direction(&self, column: f64, row: f64) -> [f64; 3] {
        let azimuth = ((column + 0.5) / self.width as f64 - 0.5) * std::f64::consts::TAU;
        let elevation = (0.5 - (row + 0.5) / self.height as f64) * std::f64::consts::PI;
        let (up, level) = elevation.sin_cos();
        let (right, forward) = azimuth.sin_cos();
        [level * right, -up, level * forward]
    }

    /// Returns the pixel (column, row) of a direction in the axes of the camera.
    pub fn pixel(&self, [x, y, z]: [f64; 3]) -> [f64; 2] {
        let azimuth = x.atan2(z) / std::f64::consts::TAU;
        let elevation = (-y).atan2(x.hypot(z)) / std::f64::consts::PI;
        [(azimuth + 0.5) * self.width as f64 - 0.5, (0.5 - elevation) * self.height as f64 - 0.5]
    }

    /// Cuts the picture that a lens sees, turned to the right by `turn_deg`, out of a panorama's
    /// picture: bilinear, and closed behind. Pixels that the lens has no ray for are zero.
    pub fn crop(picture: &Grid<[f32; 3]>, lens: &Lens, turn_deg: f64) -> Grid<[f32; 3]> {
        let panorama = Self { width: picture.width(), height: picture.height() };
        let (sin, cos) = turn_deg.to_radians().sin_cos();
        let mut out = Grid::filled(lens.width(), lens.height(), [0.0; 3]);
        let width = lens.width().max(1);
        out.data_mut().par_chunks_mut(width).enumerate().for_each(|(row, pixels)| {
            for (column, pixel) in pixels.iter_mut().enumerate() {
                if let Some([x, y]) = lens.direction(ImagePoint::new(column as f64, row as f64)) {
                    let [c, r] = panorama.pixel([x * cos + sin, y, cos - x * sin]);
                    *pixel = around(picture, c, r);
                }
            }
        });
        out
    }

    /// Makes a pinhole lens of `size` × `size` pixels with a field of view.
    ///
    /// # Errors
    /// [`LensError`] for a field of view that is not between 0 and 180°, or no pixels.
    pub fn crop_lens(size: usize, field_of_view_deg: f64) -> Result<Lens, LensError> {
        let focal = size as f64 / 2.0 / (field_of_view_deg.to_radians() / 2.0).tan();
        let middle = (size as f64 - 1.0) / 2.0;
        Lens::new(size, size, LensModel::Pinhole, &[focal, focal, middle, middle])
    }
}

/// Interpolates bilinearly, with the last column beside the first.
fn around(picture: &Grid<[f32; 3]>, column: f64, row: f64) -> [f32; 3] {
    let (width, height) = (picture.width() as i64, picture.height() as i64);
    let (c, r) = (column.floor(), row.floor());
    let (u, v) = ((column - c) as f32, (row - r) as f32);
    let at = |dc: i64, dr: i64| {
        let column = (c as i64 + dc).rem_euclid(width) as usize;
        picture[(column, (r as i64 + dr).clamp(0, height - 1) as usize)]
    };
    let (a, b, c, d) = (at(0, 0), at(1, 0), at(0, 1), at(1, 1));
    [0, 1, 2].map(|i| (a[i] * (1.0 - u) + b[i] * u) * (1.0 - v) + (c[i] * (1.0 - u) + d[i] * u) * v)
}

/// Returns the pose of a level camera that looks along an azimuth, degrees clockwise from grid
/// north.
pub fn level_pose(centre: [f64; 3], azimuth_deg: f64) -> Pose {
    let (sin, cos) = azimuth_deg.to_radians().sin_cos();
    Pose { rotation: [[cos, -sin, 0.0], [0.0, 0.0, -1.0], [sin, cos, 0.0]], centre }
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn pixels_and_directions_are_inverse_and_turn_to_the_right() {
        let panorama = Panorama { width: 64, height: 32 };
        for (c, r) in [(0.0, 0.0), (31.5, 15.5), (63.0, 31.0), (10.25, 7.75)] {
            let [a, b] = panorama.pixel(panorama.direction(c, r));
            assert!((a - c).abs() < 1e-9 && (b - r).abs() < 1e-9, "{c} {r}: {a} {b}");
        }
        let forward = panorama.direction(31.5, 15.5);
        assert!((forward[2] - 1.0).abs() < 1e-12);
        let right = panorama.direction(47.5, 15.5);
        assert!((right[0] - 1.0).abs() < 1e-12);
        // A camera that looks east has south at its right and the zenith above.
        let pose = level_pose([1.0, 2.0, 3.0], 90.0);
        let south = pose.camera_from_world([1.0, 1.0, 3.0]);
        assert!((south[0] - 1.0).abs() < 1e-12 && south[2].abs() < 1e-12);
        assert!((pose.camera_from_world([1.0, 2.0, 4.0])[1] + 1.0).abs() < 1e-12);
    }

    #[test]
    fn crops_show_what_the_panorama_shows() {
        // A picture whose values are the direction itself.
        let panorama = Panorama { width: 720, height: 360 };
        let value = |k: usize| panorama.direction((k % 720) as f64, (k / 720) as f64).map(|c| c as f32);
        let picture = Grid::from_vec(720, 360, (0..720 * 360).map(value).collect()).unwrap();
        let lens = Panorama::crop_lens(101, 90.0).unwrap();
        for turn in [0.0f64, 90.0, 180.0, -37.5] {
            let crop = Panorama::crop(&picture, &lens, turn);
            let (sin, cos) = turn.to_radians().sin_cos();
            for (column, row) in [(50, 50), (0, 0), (100, 20), (7, 99)] {
                let [x, y] = lens.direction(ImagePoint::new(column as f64, row as f64)).unwrap();
                let length = (1.0 + x * x + y * y).sqrt();
                let expected = [x * cos + sin, y, cos - x * sin].map(|c| c / length);
                let found = crop[(column, row)];
                assert!(
                    (0..3).all(|i| (f64::from(found[i]) - expected[i]).abs() < 1e-4),
                    "{turn}: {found:?} {expected:?}"
                );
            }
        }
        // Half a field of view of 45° is at the edges of the outermost pixels.
        let [x, _] = lens.direction(ImagePoint::new(100.5, 50.0)).unwrap();
        assert!((x - 1.0).abs() < 1e-12);
    }
}
