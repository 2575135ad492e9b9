//! Parameters of the building index, in metres.

use serde::{Deserialize, Serialize};

use crate::error::{BuildingIndexError, Reason};

/// Parameters of the building index. Lengths are those of buildings and follow no scene.
#[derive(Debug, Clone, Copy, PartialEq, Serialize, Deserialize)]
#[serde(deny_unknown_fields, default)]
#[non_exhaustive]
pub struct BuildingIndexConfig {
    /// Standard deviation of the smoothing before gradients, metres; at least 0.8 pixels.
    pub smoothing_m: f64,
    /// Shortest side of a building, metres.
    pub least_side_m: f64,
    /// Longest side of a building that is followed, metres.
    pub most_side_m: f64,
    /// Longest part of a side that may show no edge, metres.
    pub gap_m: f64,
    /// Smallest area of a building, square metres.
    pub least_area_m2: f64,
    /// Largest area of a building, square metres.
    pub most_area_m2: f64,
    /// Area at which a shape counts half as much as a small one, square metres. What is between
    /// streets is larger than most buildings.
    pub half_area_m2: f64,
    /// Standard deviation of the angles of buildings from a right angle, degrees.
    pub angle_spread_deg: f64,
    /// Logarithm (base 10) of the number of branches that may be found in an image without any. A
    /// few do no harm: they close no shape.
    pub log_false_alarms: f64,
    /// How far a corner or a far side may lie from where a junction says, metres.
    pub tolerance_m: f64,
    /// Width of the widest shadow, metres.
    pub shadow_m: f64,
    /// Distance within which a building has a shadow behind it, metres.
    pub cast_m: f64,
    /// How much more salient a lit pixel is with a shadow behind it, as a share.
    pub cast_gain: f64,
    /// Standard deviation of the smoothing of the index, metres.
    pub blur_m: f64,
    /// Saliency at which the index is a half.
    pub half_saliency: f64,
}

impl Default for BuildingIndexConfig {
    fn default() -> Self {
        Self {
            smoothing_m: 0.4,
            least_side_m: 4.0,
            most_side_m: 60.0,
            gap_m: 16.0,
            least_area_m2: 25.0,
            most_area_m2: 2500.0,
            half_area_m2: 300.0,
            angle_spread_deg: 12.0,
            log_false_alarms: 1.5,
            tolerance_m: 1.0,
            shadow_m: 30.0,
            cast_m: 9.0,
            cast_gain: 1.0,
            blur_m: 1.0,
            half_saliency: 0.3,
        }
    }
}

impl BuildingIndexConfig {
    /// Checks the ranges of the parameters.
    ///
    /// # Errors
    /// [`BuildingIndexError`] for the first that is outside of its range.
    pub fn validate(&self) -> Result<(), BuildingIndexError> {
        let within = |name, found: f64, low: f64, high: f64, expected| {
            let is_good = found >= low && found <= high;
            if is_good { Ok(()) } else { Err(BuildingIndexError(Reason::Parameter { name, found, expected })) }
        };
        within("the smoothing", self.smoothing_m, 0.0, 10.0, "0 to 10 m")?;
        within("the shortest side of a building", self.least_side_m, 0.5, 100.0, "0.5 to 100 m")?;
        within("the longest side of a building", self.most_side_m, self.least_side_m, 1000.0, "up to 1000 m")?;
        within("the longest gap of a side", self.gap_m, 0.0, 1000.0, "0 to 1000 m")?;
        within("the smallest area of a building", self.least_area_m2, 0.0, 1e6, "0 to 1000000 m²")?;
        within("the largest area of a building", self.most_area_m2, self.least_area_m2, 1e6, "up to 1000000 m²")?;
        within("the area that counts half", self.half_area_m2, 1.0, 1e6, "1 to 1000000 m²")?;
        within("the spread of angles", self.angle_spread_deg, 0.5, 60.0, "0.5 to 60 degrees")?;
        within("the logarithm of false alarms", self.log_false_alarms, -100.0, 10.0, "-100 to 10")?;
        within("the tolerance", self.tolerance_m, 0.0, 20.0, "0 to 20 m")?;
        within("the width of shadows", self.shadow_m, 0.0, 500.0, "0 to 500 m")?;
        within("the reach of cast shadows", self.cast_m, 0.0, 500.0, "0 to 500 m")?;
        within("the gain of cast shadows", self.cast_gain, 0.0, 100.0, "0 to 100")?;
        within("the smoothing of the index", self.blur_m, 0.0, 100.0, "0 to 100 m")?;
        within("the saliency of a half", self.half_saliency, 1e-6, 1e6, "0.000001 to 1000000")
    }
}
