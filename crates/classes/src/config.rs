//! Parameters of the classes, in metres.

use serde::{Deserialize, Serialize};

use crate::error::{ClassifyError, Reason};

/// Parameters of the classes.
#[derive(Debug, Clone, Copy, PartialEq, Serialize, Deserialize)]
#[serde(deny_unknown_fields, default)]
#[non_exhaustive]
pub struct ClassifyConfig {
    /// Least height above the ground of buildings and vegetation, metres. Cars are below it.
    pub least_height_m: f64,
    /// Side of the windows in which planes are fitted on a noisy surface, metres. It must be
    /// narrower than half a house and wider than a few branches.
    pub window_m: f64,
    /// Side below which the windows do not shrink on a surface with little noise, metres.
    pub least_window_m: f64,
    /// Residual of a plane up to which a noisy surface is smooth, metres.
    pub roughness_m: f64,
    /// Residual of a plane up to which an exact surface is smooth, metres: that of small parts of
    /// roofs that are no planes.
    pub least_roughness_m: f64,
    /// Residual up to which a surface is smooth, in residuals of the bare ground; between the two
    /// above.
    pub ground_residuals: f64,
    /// Least radius of curvature of roofs, metres, as the area and the residual of planes around a
    /// cell tell it. Crowns have radii up to that; roofs are flat between their edges.
    pub least_radius_m: f64,
    /// Smallest area of a building, square metres.
    pub least_building_m2: f64,
    /// Smallest area of vegetation, square metres.
    pub least_vegetation_m2: f64,
    /// Width of the ramps at walls of a noisy surface, metres.
    pub ramp_m: f64,
    /// Least vegetation index of vegetation, where one is given.
    pub least_index: f64,
    /// Least share of green cells in vegetation, where an index is given. Coarse pixels hold little
    /// of a small crown.
    pub least_green_share: f64,
    /// Narrowest crown that is found without a height, metres.
    pub least_crown_m: f64,
    /// Largest vegetation index of water, where one is given. Water swallows the near infrared;
    /// asphalt and soil lie about 0.
    pub water_index: f64,
    /// Smallest area of water, square metres: below it lie shadows.
    pub least_water_m2: f64,
    /// Least building index that counts as a building where the heights are weak.
    pub least_building_index: f64,
    /// Factor by which the height of a building may miss the least height, and its residual the
    /// roughness, where the building index speaks for it.
    pub leniency: f64,
}

impl Default for ClassifyConfig {
    fn default() -> Self {
        Self {
            least_height_m: 2.0,
            window_m: 3.5,
            least_window_m: 2.5,
            roughness_m: 0.2,
            least_roughness_m: 0.03,
            ground_residuals: 8.0,
            least_radius_m: 4.5,
            least_building_m2: 15.0,
            least_vegetation_m2: 4.0,
            ramp_m: 1.5,
            least_index: 0.3,
            least_green_share: 0.05,
            least_crown_m: 1.0,
            water_index: -0.1,
            least_water_m2: 100.0,
            least_building_index: 0.5,
            leniency: 2.0,
        }
    }
}

impl ClassifyConfig {
    /// Checks the ranges of the parameters.
    ///
    /// # Errors
    /// [`ClassifyError`] for the first that is outside of its range.
    pub fn validate(&self) -> Result<(), ClassifyError> {
        let within = |name, found: f64, low: f64, high: f64, expected| {
            let is_good = found >= low && found <= high;
            if is_good { Ok(()) } else { Err(ClassifyError(Reason::Parameter { name, found, expected })) }
        };
        within("the least height of objects", self.least_height_m, 0.1, 50.0, "0.1 to 50 m")?;
        within("the side of the windows", self.window_m, 0.1, 50.0, "0.1 to 50 m")?;
        within(
            "the least side of the windows",
            self.least_window_m,
            0.1,
            self.window_m,
            "0.1 m to the side of the windows",
        )?;
        within("the roughness", self.roughness_m, 1e-3, 10.0, "0.001 to 10 m")?;
        within("the least roughness", self.least_roughness_m, 0.0, self.roughness_m, "0 m to the roughness")?;
        within("the number of residuals of the ground", self.ground_residuals, 0.0, 1e3, "0 to 1000")?;
        within("the least radius of roofs", self.least_radius_m, 0.0, 1e3, "0 to 1000 m")?;
        within("the least area of a building", self.least_building_m2, 0.0, 1e6, "0 to 1000000 m²")?;
        within("the least area of vegetation", self.least_vegetation_m2, 0.0, 1e6, "0 to 1000000 m²")?;
        within("the width of ramps", self.ramp_m, 0.0, 20.0, "0 to 20 m")?;
        within("the least vegetation index", self.least_index, -1.0, 1.0, "-1 to 1")?;
        within("the least share of green cells", self.least_green_share, 0.0, 1.0, "0 to 1")?;
        within("the width of the narrowest crown", self.least_crown_m, 0.0, 50.0, "0 to 50 m")?;
        let range = "-1 to that of vegetation";
        within("the largest vegetation index of water", self.water_index, -1.0, self.least_index, range)?;
        within("the least area of water", self.least_water_m2, 0.0, 1e6, "0 to 1000000 m²")?;
        within("the least building index", self.least_building_index, 0.0, 1.0, "0 to 1")?;
        within("the leniency", self.leniency, 1.0, 10.0, "1 to 10")
    }
}
