//! The configuration of a comparison of meshes, city models and point clouds.

use std::path::PathBuf;

use city::Lod;
use crs::VerticalDatum;
use eval::SurfaceComparisonConfig;
use serde::{Deserialize, Serialize};

use super::requirements::EvalRequirements;
use job::error::JobError;

/// A comparison of two surfaces, each a mesh, a city model or a point cloud. Nothing is aligned.
#[derive(Debug, Clone, PartialEq, Serialize, Deserialize)]
#[serde(deny_unknown_fields)]
#[non_exhaustive]
pub struct SurfaceEvalConfig {
    /// Surface to evaluate: OBJ, PLY, CityJSON, CityGML, LAS or LAZ.
    pub test: PathBuf,
    /// Surface that is believed.
    pub reference: PathBuf,
    /// Thresholds of precision, recall and F-score, metres.
    pub thresholds_m: Vec<f64>,
    /// Samples per square metre of a mesh, up to a million in all.
    pub samples_per_m2: f64,
    /// Seed of the samples.
    pub sample_seed: u64,
    /// D of M3C2: diameter in which normals are estimated, metres.
    pub normal_scale_m: f64,
    /// d of M3C2: diameter of its cylinders, metres.
    pub cylinder_m: f64,
    /// Length of the cylinders on either side, metres.
    pub cylinder_reach_m: f64,
    /// Registration error, which is part of the level of detection of M3C2, metres.
    pub registration_m: f64,
    /// Edge of the voxels of the volumetric overlap, metres.
    pub voxel_m: f64,
    /// Level of detail of city models. `None` takes the highest of each object up to 2.x.
    #[serde(with = "job::as_text", default)]
    pub lod: Option<Lod>,
    /// Whether every object of a city model that has surfaces is used, not only buildings.
    pub all_objects: bool,
    /// Vertical datum of the test, where the file names none or a wrong one.
    pub test_vertical: Option<VerticalDatum>,
    /// Vertical datum of the reference, where the file names none or a wrong one.
    pub reference_vertical: Option<VerticalDatum>,
    /// Folder for `report.json`.
    pub output: Option<PathBuf>,
    /// Whether a file may be replaced that no evaluation wrote.
    pub overwrite: bool,
    /// Requirements on the result.
    pub requirements: EvalRequirements,
    /// Worker threads. `None` uses all cores.
    pub threads: Option<usize>,
}

impl SurfaceEvalConfig {
    /// A comparison with default settings that writes no file.
    pub fn new(test: PathBuf, reference: PathBuf) -> Self {
        let defaults = SurfaceComparisonConfig::default();
        Self {
            test,
            reference,
            thresholds_m: defaults.thresholds_m,
            samples_per_m2: defaults.samples_per_m2,
            sample_seed: defaults.seed,
            normal_scale_m: defaults.normal_scale_m,
            cylinder_m: defaults.cylinder_m,
            cylinder_reach_m: defaults.cylinder_reach_m,
            registration_m: defaults.registration_m,
            voxel_m: defaults.voxel_m,
            lod: None,
            all_objects: false,
            test_vertical: None,
            reference_vertical: None,
            output: None,
            overwrite: false,
            requirements: EvalRequirements::default(),
            threads: None,
        }
    }

    /// Checks the settings that can be judged without opening a file.
    ///
    /// # Errors
    /// [`JobError`] for a number outside of its range.
    pub fn validate(&self) -> Result<(), JobError> {
        Ok(self.requirements.validate()?)
    }

    /// Returns the settings of the comparison itself.
    pub(super) fn surface_config(&self) -> SurfaceComparisonConfig {
        SurfaceComparisonConfig {
            thresholds_m: self.requirements.with_thresholds(self.thresholds_m.clone()),
            samples_per_m2: self.samples_per_m2,
            seed: self.sample_seed,
            normal_scale_m: self.normal_scale_m,
            cylinder_m: self.cylinder_m,
            cylinder_reach_m: self.cylinder_reach_m,
            registration_m: self.registration_m,
            voxel_m: self.voxel_m,
            ..SurfaceComparisonConfig::default()
        }
    }
}
