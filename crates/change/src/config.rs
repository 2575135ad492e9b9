//! Parameters of the search for change, in metres.

use serde::{Deserialize, Serialize};

use crate::error::{ChangeError, Reason};

/// Parameters of the search for change.
#[derive(Debug, Clone, Copy, PartialEq, Serialize, Deserialize)]
#[serde(deny_unknown_fields, default)]
#[non_exhaustive]
pub struct ChangeConfig {
    /// Probability that no region is invented, and of the level of detection of a cell.
    pub confidence: f64,
    /// Smallest mean change of a region, metres.
    pub least_change_m: f64,
    /// Smallest area of a region, square metres. The default is more than a parked lorry covers.
    pub least_area_m2: f64,
    /// Distance within which a height of the other surface explains a height, metres. Walls in
    /// satellite models are ramps of two to three metres, so they may differ by half of it.
    pub position_m: f64,
    /// Distance by which the walls of both surfaces reach too far outwards, metres. It is taken off
    /// the volumes of regions.
    pub overreach_m: f64,
    /// Standard deviation of that distance for one region, metres.
    pub overreach_sigma_m: f64,
}

impl Default for ChangeConfig {
    fn default() -> Self {
        Self {
            confidence: 0.95,
            least_change_m: 1.0,
            least_area_m2: 30.0,
            position_m: 1.5,
            overreach_m: 0.0,
            overreach_sigma_m: 0.1,
        }
    }
}

impl ChangeConfig {
    /// Checks the ranges of the parameters.
    ///
    /// # Errors
    /// [`ChangeError`] for the first that is outside of its range.
    pub fn validate(&self) -> Result<(), ChangeError> {
        let within = |name, found: f64, low: f64, high: f64, expected| {
            let is_good = found >= low && found <= high;
            if is_good { Ok(()) } else { Err(ChangeError(Reason::Parameter { name, found, expected })) }
        };
        within("the confidence", self.confidence, 0.5, 0.999_999, "0.5 to 0.999999")?;
        within("the least change", self.least_change_m, 0.0, 100.0, "0 to 100 m")?;
        within("the least area", self.least_area_m2, 0.0, 1e6, "0 to 1000000 m²")?;
        within("the tolerance of position", self.position_m, 0.0, 20.0, "0 to 20 m")?;
        within("the overreach of walls", self.overreach_m, -10.0, 10.0, "-10 to 10 m")?;
        within("the deviation of the overreach", self.overreach_sigma_m, 0.0, 10.0, "0 to 10 m")
    }
}
