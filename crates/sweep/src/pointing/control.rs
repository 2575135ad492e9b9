//! Control points: ground points with known positions and their places in images.

use camera::RpcCamera;
use geodesy::LonLatHeight;
use nalgebra::Vector3;

use super::intersect::{Known, Track, intersect};

/// A ground point whose position is known, seen in at least one view.
#[derive(Debug, Clone, PartialEq)]
pub struct ControlPoint {
    /// Position.
    pub ground: LonLatHeight,
    /// Standard deviation of the position along each horizontal axis, metres.
    pub horizontal_m: f64,
    /// Standard deviation of the height, metres.
    pub vertical_m: f64,
    /// Standard deviation of a place in an image along each axis, pixels.
    pub pixel_px: f64,
    /// Places in the images.
    pub seen: Track,
}

impl ControlPoint {
    /// Returns the root mean square residual under some cameras, in standard deviations of what was
    /// observed, as [`super::Adjustment::control_residual`]; NaN where the cameras do not see the
    /// point.
    pub fn residual(&self, cameras: &[RpcCamera]) -> f64 {
        let Some(found) = intersect(cameras, &self.seen, Some(&self.known()), None) else { return f64::NAN };
        let seen: f64 = found.seen.iter().map(|(residual, _)| residual.norm_squared()).sum();
        // As many residuals as unknowns belong to the position.
        let freedom = 2.0 * self.seen.len() as f64;
        ((seen + found.known_px.norm_squared()) / freedom).sqrt() / self.pixel_px
    }

    /// Returns the position with weights relative to the noise of the places in the images.
    pub(super) fn known(&self) -> Known {
        let [horizontal, vertical] = [self.horizontal_m, self.vertical_m].map(|m| self.pixel_px / m);
        Known { ground: self.ground, px_per_m: Vector3::new(horizontal, horizontal, vertical) }
    }
}
