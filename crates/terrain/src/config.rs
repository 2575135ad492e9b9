//! Parameters of the search for the ground, in metres and slopes.

use serde::{Deserialize, Serialize};

use crate::error::TerrainError;

/// Deviations that a cell must stand out by to be no noise.
pub(crate) const NOISE_DEVIATIONS: f64 = 3.0;

/// Parameters of the search for the ground.
#[derive(Debug, Clone, Copy, PartialEq, Serialize, Deserialize)]
#[serde(deny_unknown_fields, default)]
#[non_exhaustive]
pub struct GroundConfig {
    /// Width of the widest object, metres: the largest window. Large halls and closed city blocks
    /// are about 150 m wide.
    pub widest_object_m: f64,
    /// Height of the lowest object, metres, in the smallest window. It must exceed twice the noise
    /// of the surface, which is up to 0.5 m in satellite models.
    pub lowest_object_m: f64,
    /// Slope of the ground that an opening may cut off without making a candidate: what a window
    /// may remove grows by this much per metre of its half-width. 0.15 is the value of Pingel et
    /// al. (2013, <https://doi.org/10.1016/j.isprsjprs.2012.12.002>) for mixed ground.
    pub slope: f64,
    /// Largest height that counts as ground in any window, metres: the lowest storey. Without this
    /// limit a wide hall would need to be higher than a narrow house.
    pub storey_m: f64,
}

impl Default for GroundConfig {
    fn default() -> Self {
        Self { widest_object_m: 150.0, lowest_object_m: 1.0, slope: 0.15, storey_m: 2.5 }
    }
}

impl GroundConfig {
    /// Checks the ranges of the parameters.
    ///
    /// # Errors
    /// [`TerrainError::Parameter`] for the first that is outside of its range.
    pub fn validate(&self) -> Result<(), TerrainError> {
        let within = |name, found: f64, low: f64, high: f64, expected| {
            let is_good = found >= low && found <= high;
            if is_good { Ok(()) } else { Err(TerrainError::Parameter { name, found, expected }) }
        };
        within("the width of the widest object", self.widest_object_m, 1.0, 1000.0, "1 to 1000 m")?;
        within("the height of the lowest object", self.lowest_object_m, 0.05, 50.0, "0.05 to 50 m")?;
        within("the slope of the ground", self.slope, 0.0, 5.0, "0 to 5")?;
        within("the height of a storey", self.storey_m, self.lowest_object_m, 100.0, "the lowest object to 100 m")
    }

    /// Height above the opened surface from which a cell is a candidate, for a window of this
    /// half-width. Noise above a third of the lowest object raises it.
    pub(crate) fn threshold_m(&self, half_width_m: f64, noise_m: f64) -> f32 {
        let excess_m = (NOISE_DEVIATIONS * noise_m - self.lowest_object_m).max(0.0);
        ((self.lowest_object_m + self.slope * half_width_m).min(self.storey_m) + excess_m) as f32
    }
}
