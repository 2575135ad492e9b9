//! A perspective camera in the frame of the mesh.

use bvh::Eye;
use camera::{ImagePoint, Lens, Pose};
use rayon::prelude::*;

use crate::PriorsError;

/// Maps are made for images of up to this many pixels.
pub const MAX_PIXELS: usize = 1 << 28;

/// A lens, and where it is in the frame of the mesh (metres from its origin).
#[derive(Debug, Clone, PartialEq)]
pub struct View {
    /// The inside.
    pub lens: Lens,
    /// Where it is and looks.
    pub pose: Pose,
}

/// How far the direction of a pixel may be from the point that was projected to it, image plane at
/// distance 1. Beyond, the point is not the one that the lens sees there: a distortion folds what
/// is far outside back into the image.
const FOLD: f64 = 1e-6;

impl View {
    /// Centre and axes.
    pub fn eye(&self) -> Eye {
        Eye::new(self.pose.centre, self.pose.rotation)
    }

    /// The pixel in which the lens sees a point (x, y) of the image plane at distance 1, where it
    /// lies at least `margin_px` inside the borders of the image (outside for a negative margin).
    pub fn pixel(&self, x: f64, y: f64, margin_px: f64) -> Option<ImagePoint> {
        let lens = &self.lens;
        let pixel = lens.project(x, y)?;
        // The border of the image is half a pixel before the centre of its first.
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

/// The directions of a lens's pixels; those of a distorted one are found once and kept.
#[derive(Debug, Clone)]
pub struct Rays {
    lens: Lens,
    /// Row by row; NaN where the lens sees nothing. Empty for pinholes.
    directions: Vec<[f64; 2]>,
}

impl Rays {
    /// The rays of a lens.
    ///
    /// # Errors
    /// An image of more than [`MAX_PIXELS`] pixels.
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

    /// Number of columns.
    pub fn width(&self) -> usize {
        self.lens.width()
    }

    /// Number of rows.
    pub fn height(&self) -> usize {
        self.lens.height()
    }

    /// The point of the image plane at distance 1 that a pixel's ray goes through; `None` where the
    /// lens sees nothing, and outside the image.
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

    /// A camera at `centre` that looks straight down, north up.
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
        // r (1 − r²/4) grows up to r = 1.15 and comes back to 0 at r = 2.
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
