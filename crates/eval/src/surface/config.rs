//! Settings of the comparison of two surfaces.

use super::error::{Reason, SurfaceError};

/// Settings of the comparison of two surfaces.
#[derive(Debug, Clone, PartialEq, serde::Serialize)]
pub struct SurfaceComparisonConfig {
    /// Thresholds of precision, recall and F, metres.
    pub thresholds_m: Vec<f64>,
    /// Samples per square metre of a mesh.
    pub samples_per_m2: f64,
    /// Highest number of samples of a mesh. A larger mesh is sampled more thinly.
    pub max_samples: usize,
    /// Seed of the positions of the samples.
    pub seed: u64,
    /// D of M3C2: diameter of the ball in which normals are estimated, metres.
    pub normal_scale_m: f64,
    /// d of M3C2: diameter of the cylinder, metres.
    pub cylinder_m: f64,
    /// Reach of the cylinder on either side, metres.
    pub cylinder_reach_m: f64,
    /// Highest number of core points of M3C2. Of more samples, every n-th is a core point.
    pub max_core_points: usize,
    /// Registration error that is added to the level of detection, metres.
    pub registration_m: f64,
    /// Edge length of the voxels of VOC, metres.
    pub voxel_m: f64,
}

impl Default for SurfaceComparisonConfig {
    fn default() -> Self {
        Self {
            thresholds_m: vec![0.1, 0.2, 0.5, 1.0],
            samples_per_m2: 25.0,
            max_samples: 1_000_000,
            seed: 0,
            normal_scale_m: 1.0,
            cylinder_m: 1.0,
            cylinder_reach_m: 3.0,
            max_core_points: 100_000,
            registration_m: 0.0,
            voxel_m: 0.5,
        }
    }
}

impl SurfaceComparisonConfig {
    pub(super) fn check(&self) -> Result<(), SurfaceError> {
        let settings = [
            ("the density of samples", self.samples_per_m2),
            ("the scale of the normals", self.normal_scale_m),
            ("the diameter of the cylinder", self.cylinder_m),
            ("the reach of the cylinder", self.cylinder_reach_m),
            ("the edge of the voxels", self.voxel_m),
        ];
        let thresholds = self.thresholds_m.iter().map(|&t| ("a threshold", t));
        let bad = |(_, value): &(&str, f64)| !(*value > 0.0 && value.is_finite());
        if let Some((name, value)) = settings.into_iter().chain(thresholds).find(bad) {
            return Err(Reason::Setting { name, value }.into());
        }
        if !(self.registration_m >= 0.0 && self.registration_m.is_finite()) {
            return Err(Reason::Setting { name: "the error of the registration", value: self.registration_m }.into());
        }
        Ok(())
    }
}
