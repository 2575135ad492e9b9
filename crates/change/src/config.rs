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
    /// Growth of that distance per metre of a wall's height: high walls hide more beside them.
    pub overreach_growth: f64,
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
            overreach_growth: 0.0,
            overreach_sigma_m: 0.1,
        }
    }
}

impl ChangeConfig {
    /// Returns the distance by which walls of a height reach too far outwards, metres. It grows at
    /// most to the tolerance of position: beyond it the change would have been explained by a moved
    /// wall, and a spike of a hundred metres is no wall.
    pub(crate) fn overreach_of_m(&self, wall_m: f64) -> f64 {
        self.overreach_m + (self.overreach_growth * wall_m).min(self.position_m)
    }

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
        within("the growth of the overreach", self.overreach_growth, -1.0, 1.0, "-1 to 1")?;
        within("the deviation of the overreach", self.overreach_sigma_m, 0.0, 10.0, "0 to 10 m")
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn the_overreach_grows_with_the_wall_but_not_with_a_spike() {
        let config = ChangeConfig { overreach_m: 0.1, overreach_growth: 0.03, ..Default::default() };
        assert!((config.overreach_of_m(10.0) - 0.4).abs() < 1e-12);
        assert!((config.overreach_of_m(130.0) - 1.6).abs() < 1e-12);
        let wrong = ChangeConfig { overreach_growth: f64::NAN, ..config };
        assert!(matches!(wrong.validate(), Err(ChangeError(Reason::Parameter { .. }))));
    }
}
