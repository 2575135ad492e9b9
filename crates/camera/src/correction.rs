//! Image-space correction of the pointing of an RPC.

use serde::{Deserialize, Serialize};

use crate::ImagePoint;

/// An affine map in image space, applied after the RPC: `corrected = p + t + D (p − centre)`.
///
/// The translation holds at `centre`. Otherwise a small linear part would become a huge translation
/// for crops far from the origin of their coordinates.
///
/// ```
/// use camera::{ImageCorrection, ImagePoint};
///
/// let correction = ImageCorrection::translation(2.0, -1.0);
/// let corrected = correction.apply(ImagePoint::new(10.0, 10.0));
/// assert_eq!(corrected, ImagePoint::new(12.0, 9.0));
/// assert_eq!(correction.invert(corrected), Some(ImagePoint::new(10.0, 10.0)));
/// ```
#[derive(Debug, Clone, Copy, PartialEq, Serialize, Deserialize)]
pub struct ImageCorrection {
    /// Shift at `centre`, pixels (sample, line).
    pub translation_px: [f64; 2],
    /// Linear part minus the identity, row-major (sample row, line row), pixels per pixel.
    pub linear: [[f64; 2]; 2],
    /// The point about which the linear part acts.
    pub centre: ImagePoint,
}

impl ImageCorrection {
    /// The correction that changes nothing.
    pub const IDENTITY: Self =
        Self { translation_px: [0.0; 2], linear: [[0.0; 2]; 2], centre: ImagePoint::new(0.0, 0.0) };

    /// Makes a shift of `sample` columns and `line` rows.
    pub const fn translation(sample: f64, line: f64) -> Self {
        Self { translation_px: [sample, line], ..Self::IDENTITY }
    }

    /// Returns the corrected position of a point that the RPC projected.
    #[inline(always)]
    pub fn apply(&self, p: ImagePoint) -> ImagePoint {
        let (ds, dl) = (p.sample - self.centre.sample, p.line - self.centre.line);
        let t = self.translation_px;
        ImagePoint {
            sample: p.sample + t[0] + self.linear[0][0] * ds + self.linear[0][1] * dl,
            line: p.line + t[1] + self.linear[1][0] * ds + self.linear[1][1] * dl,
        }
    }

    /// Returns the uncorrected position of a point observed in the image. `None` if the linear part
    /// is singular.
    pub fn invert(&self, q: ImagePoint) -> Option<ImagePoint> {
        let [[a, b], [c, d]] = self.linear;
        let (m00, m11) = (1.0 + a, 1.0 + d);
        let det = m00 * m11 - b * c;
        if det.abs() < 1e-9 || !det.is_finite() {
            return None;
        }
        let x = q.sample - self.centre.sample - self.translation_px[0];
        let y = q.line - self.centre.line - self.translation_px[1];
        Some(ImagePoint {
            sample: self.centre.sample + (m11 * x - b * y) / det,
            line: self.centre.line + (m00 * y - c * x) / det,
        })
    }

    /// Combines this correction and the following one, `next`, about the centre of this one.
    #[must_use]
    pub fn then(&self, next: &Self) -> Self {
        let ([[a, b], [c, d]], [[e, f], [g, h]]) = (self.linear, next.linear);
        let at_centre = next.apply(self.apply(self.centre));
        Self {
            translation_px: [at_centre.sample - self.centre.sample, at_centre.line - self.centre.line],
            linear: [[e + a + e * a + f * c, f + b + e * b + f * d], [g + c + g * a + h * c, h + d + g * b + h * d]],
            centre: self.centre,
        }
    }

    /// Returns the correction that takes this one back. `None` if the linear part is singular.
    ///
    /// ```
    /// use camera::{ImageCorrection, ImagePoint};
    ///
    /// let correction = ImageCorrection { linear: [[0.25, 0.5], [0.0, -0.5]], ..ImageCorrection::translation(2.0, -1.0) };
    /// let (p, back) = (ImagePoint::new(10.0, 20.0), correction.inverse().unwrap());
    /// assert_eq!(back.apply(correction.apply(p)), p);
    /// ```
    #[must_use]
    pub fn inverse(&self) -> Option<Self> {
        let centre = self.apply(self.centre);
        let at = |sample: f64, line: f64| self.invert(ImagePoint::new(centre.sample + sample, centre.line + line));
        let (own, right, down) = (at(0.0, 0.0)?, at(1.0, 0.0)?, at(0.0, 1.0)?);
        let step = |to: ImagePoint| [to.sample - own.sample, to.line - own.line];
        let ([a, c], [b, d]) = (step(right), step(down));
        Some(Self {
            translation_px: [own.sample - centre.sample, own.line - centre.line],
            linear: [[a - 1.0, b], [c, d - 1.0]],
            centre,
        })
    }

    /// Returns the same correction in the coordinates of the image cut at `origin`.
    #[must_use]
    pub fn cropped(&self, origin: ImagePoint) -> Self {
        let centre = ImagePoint::new(self.centre.sample - origin.sample, self.centre.line - origin.line);
        Self { centre, ..*self }
    }

    /// Returns the same correction in the coordinates of the image resampled by `factor`.
    #[must_use]
    pub fn rescaled(&self, factor: f64) -> Self {
        let at = |x: f64| (x + 0.5) * factor - 0.5;
        Self {
            translation_px: self.translation_px.map(|t| t * factor),
            linear: self.linear,
            centre: ImagePoint::new(at(self.centre.sample), at(self.centre.line)),
        }
    }
}
