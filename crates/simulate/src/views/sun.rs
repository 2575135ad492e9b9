//! Direction of the sunlight.

use nalgebra::Vector3;
use serde::{Deserialize, Serialize};

/// Direction of the sunlight.
#[derive(Debug, Clone, Copy, PartialEq, Serialize, Deserialize)]
#[serde(deny_unknown_fields)]
pub struct Sun {
    /// Elevation above the horizon, degrees, at least [`Sun::LOWEST_DEG`].
    pub elevation_deg: f64,
    /// Azimuth of the direction towards the sun, degrees clockwise from north.
    pub azimuth_deg: f64,
}

impl Sun {
    /// Lowest permitted elevation, degrees. Below it shadows are longer than the simulated
    /// surroundings are wide.
    pub const LOWEST_DEG: f64 = 15.0;

    /// Returns the unit vector towards the sun (east, north, up).
    pub fn direction(&self) -> Vector3<f64> {
        let (up, level) = self.elevation_deg.to_radians().sin_cos();
        let (east, north) = self.azimuth_deg.to_radians().sin_cos();
        Vector3::new(level * east, level * north, up)
    }
}
