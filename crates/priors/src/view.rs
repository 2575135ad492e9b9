//! A perspective camera in the frame of the mesh.

use bvh::Eye;
use camera::{ImagePoint, Lens, Pose};
use rayon::prelude::*;

use crate::PriorsError;

/// Largest number of pixels of an image.
pub const MAX_PIXELS: usize = 1 << 28;

/// A perspective camera in the frame of the mesh (metres from its origin).
#[derive(Debug, Clone, PartialEq)]
pub struct View {
    /// Lens.
    pub lens: Lens,
    /// Position and orientation in the frame of the mesh.
    pub pose: Pose,
}

/// Largest distance between a point of the image plane at distance 1 and the direction of its
/// pixel.
///
/// A larger distance means that the lens does not see the point there: a distortion may fold points
/// far outside back into the image.
const FOLD: f64 = 1e-6;

impl View {
    /// Returns the centre and the axes.
    pub fn eye(&self) -> Eye {
        Eye::new(self.pose.centre, self.pose.rotation)
    }

    /// Returns the pixel in which the lens sees a point (x, y) of the image plane at distance 1.
    ///
    /// Returns `None` unless the pixel is at least `margin_px` inside the borders of the image.
    /// With a negative margin it may be outside by that much.
    pub fn pixel(&self, x: f64, y: f64, margin_px: f64) -> Option<ImagePoint> {
        let lens = &self.lens;
        let pixel = lens.project(x, y)?;
        // The border of the image is half a pixel before the centre of the first pixel.
        let inside = |at: f64, size: usize| (margin_px - 0.5..size as f64 - 0.5 - margin_px).contains(&at);
        if !inside(pixel.sample, lens.width()) || !inside(pixel.line, lens.height()) {
            return None;
        }
        if !lens.model().is_pinhole() {
            let [u, v] = lens.direction(pixel)?;
            if (u - x).abs().max((v - y).abs()) > FOLD * (1.0 + x.abs() + y.abs()) {
                return None;
            }
        }
        Some(pixel)
    }
}

/// Directions of the pixels of a lens. They are computed once and stored if the lens has
/// distortion.
#[derive(Debug, Clone)]
pub struct Rays {
    lens: Lens,
    /// Directions in row order; NaN where the lens sees nothing. Empty for a pinhole.
    directions: Vec<[f64; 2]>,
}

impl Rays {
    /// Computes the directions of a lens.
    ///
    /// # Errors
    /// [`PriorsError::ImageSize`] when the image has more than [`MAX_PIXELS`] pixels.
    pub fn new(lens: &Lens) -> Result<Self, PriorsError> {
        if lens.width().saturating_mul(lens.height()) > MAX_PIXELS {
            return Err(PriorsError::ImageSize { width: lens.width(), height: lens.height(), limit: MAX_PIXELS });
        }
        let pixel = |i: usize| ImagePoint { sample: (i % lens.width()) as f64, line: (i / lens.width()) as f64 };
        let directions = if lens.model().is_pinhole() {
            Vec::new()
        } else {
            let pixels = (0..lens.width() * lens.height()).into_par_iter();
            pixels.map(|i| lens.direction(pixel(i)).unwrap_or([f64::NAN; 2])).collect()
        };
        Ok(Self { lens: lens.clone(), directions })
    }

    /// Returns the number of columns.
    pub fn width(&self) -> usize {
        self.lens.width()
    }

    /// Returns the number of rows.
    pub fn height(&self) -> usize {
        self.lens.height()
    }

    /// Returns the point of the image plane at distance 1 on the ray of a pixel.
    ///
    /// Returns `None` outside the image and where the lens sees nothing.
    pub fn direction(&self, column: usize, row: usize) -> Option<[f64; 2]> {
        if column >= self.width() || row >= self.height() {
            return None;
        }
        if self.lens.model().is_pinhole() {
            return self.lens.direction(ImagePoint { sample: column as f64, line: row as f64 });
        }
        self.directions.get(row * self.width() + column).copied().filter(|d| d[0].is_finite())
    }
}

#[cfg(test)]
pub(crate) mod tests {
    use camera::LensModel;

    use super::*;

    /// Makes a camera at `centre` that faces straight down, with north at the top of the image.
    pub(crate) fn nadir(centre: [f64; 3], lens: Lens) -> View {
        View { lens, pose: Pose { rotation: [[1.0, 0.0, 0.0], [0.0, -1.0, 0.0], [0.0, 0.0, -1.0]], centre } }
    }

    pub(crate) fn pinhole(width: usize, height: usize, focal: f64) -> Lens {
        let centre = [(width as f64 - 1.0) / 2.0, (height as f64 - 1.0) / 2.0];
        Lens::new(width, height, LensModel::Pinhole, &[focal, focal, centre[0], centre[1]]).unwrap()
    }

    #[test]
    fn the_margin_is_counted_from_the_borders() {
        let view = nadir([0.0; 3], pinhole(100, 80, 50.0));
        let at = |sample: f64, line: f64| [(sample - 49.5) / 50.0, (line - 39.5) / 50.0];
        let inside = |[x, y]: [f64; 2], margin| view.pixel(x, y, margin).is_some();
        assert!(inside(at(-0.45, 10.0), 0.0) && !inside(at(-0.55, 10.0), 0.0));
        assert!(inside(at(99.45, 79.45), 0.0) && !inside(at(50.0, 79.55), 0.0));
        assert!(!inside(at(4.4, 40.0), 5.0) && inside(at(4.6, 40.0), 5.0));
        assert!(inside(at(-3.0, 40.0), -3.0));
    }

    #[test]
    fn what_a_distortion_folds_back_is_not_seen() {
        let lens = Lens::new(100, 80, LensModel::SimpleRadial, &[50.0, 49.5, 39.5, -0.25]).unwrap();
        let view = nadir([0.0; 3], lens);
        // r (1 − r²/4) grows up to r = 1.15 and returns to 0 at r = 2.
        assert!(view.pixel(0.8, 0.0, 0.0).is_some());
        assert!(view.lens.project(1.9, 0.0).is_some() && view.pixel(1.9, 0.0, 0.0).is_none());
    }

    #[test]
    fn kept_directions_are_those_of_the_lens() {
        let lens = Lens::new(33, 21, LensModel::SimpleRadial, &[40.0, 15.0, 11.0, -0.1]).unwrap();
        let rays = Rays::new(&lens).unwrap();
        for (column, row) in [(0, 0), (32, 20), (15, 11), (7, 18)] {
            let expected = lens.direction(ImagePoint { sample: column as f64, line: row as f64 });
            assert_eq!(rays.direction(column, row), expected);
        }
        assert_eq!(rays.direction(33, 0), None);
        let huge = Lens::new(1 << 24, 1 << 24, LensModel::SimplePinhole, &[1.0, 0.0, 0.0]).unwrap();
        assert!(matches!(Rays::new(&huge), Err(PriorsError::ImageSize { .. })));
    }
}
