//! What several unit tests use: a camera, and rays that are followed in small steps.

use geodesy::LonLatHeight;
use nalgebra::Vector3;

use crate::views::camera_model::Look;

/// Centre of the scenes.
pub(crate) const CENTRE: LonLatHeight = LonLatHeight::new(5.4, 43.5, 200.0);

/// Step of [`march`], in lengths of the direction of a ray.
pub(crate) const MARCH_STEP: f64 = 1e-3;

/// Returns whether a point is below a height function, which has no height beside its body.
pub(crate) fn is_below(p: Vector3<f64>, height: impl Fn(f64, f64) -> Option<f64>) -> bool {
    height(p.x, p.y).is_some_and(|z| p.z < z)
}

/// Returns the first step along a ray, up to `end`, at which it is inside a body.
pub(crate) fn march(inside: impl Fn(f64) -> bool, end: f64) -> Option<f64> {
    let steps = (end / MARCH_STEP).round() as u32;
    (0..steps).map(|i| f64::from(i) * MARCH_STEP).find(|&t| inside(t))
}

/// Returns a look with pixels of half a metre from a flight almost southwards.
pub(crate) fn look(incidence_deg: f64, azimuth_deg: f64) -> Look {
    Look { incidence_deg, azimuth_deg, heading_deg: 190.0, gsd_m: 0.5 }
}
