//! The configuration of a mesh.

use std::path::PathBuf;

use serde::{Deserialize, Serialize};

use job::error::SettingError;

/// Where the depth maps of a mesh come from.
#[derive(Debug, Clone, PartialEq, Eq, Serialize, Deserialize)]
#[serde(rename_all = "kebab-case")]
pub enum DepthSource {
    /// Splats (PLY of 2DGS), seen by the cameras of the dataset.
    Splats(PathBuf),
    /// A folder of maps as `.npy`, named as the images: depths along the optical axis, metres.
    Maps(PathBuf),
}

/// A dataset whose depth maps become a mesh.
#[derive(Debug, Clone, PartialEq, Serialize, Deserialize)]
#[serde(deny_unknown_fields)]
#[non_exhaustive]
pub struct MeshJobConfig {
    /// Folder with a COLMAP model in `sparse/0`.
    pub dataset: PathBuf,
    /// The depth maps.
    pub depths: DepthSource,
    /// Folder of the images that give the colours, where splats do not; grey when `None`.
    pub images: Option<PathBuf>,
    /// File of the mesh: `.ply` or `.glb`.
    pub output: PathBuf,
    /// Edge of a voxel, metres.
    pub voxel_m: f64,
    /// Distance from a surface beyond which a map says nothing, metres; four voxels when `None`.
    pub truncation_m: Option<f64>,
    /// Number of views that must have seen a place.
    pub least_views: u32,
    /// Connected parts of a smaller area are left out, square metres.
    pub least_part_m2: f64,
    /// Pixels of an image that become one, in each direction, where splats are drawn.
    pub shrink: usize,
    /// Whether only what the masks of the dataset show becomes a mesh.
    pub masked: bool,
    /// Surface to compare the mesh with: a mesh, a city model or a cloud.
    pub reference: Option<PathBuf>,
    /// Greatest memory of the volume, gibibytes.
    pub memory_gib: f64,
    /// Worker threads; one per core when `None`.
    pub threads: Option<usize>,
    /// Whether existing files may be replaced.
    pub overwrite: bool,
}

impl MeshJobConfig {
    /// A mesh with the default settings.
    pub fn new(dataset: PathBuf, depths: DepthSource, output: PathBuf) -> Self {
        Self {
            dataset,
            depths,
            images: None,
            output,
            voxel_m: 0.1,
            truncation_m: None,
            least_views: 1,
            least_part_m2: 1.0,
            shrink: 1,
            masked: false,
            reference: None,
            memory_gib: 4.0,
            threads: None,
            overwrite: false,
        }
    }

    /// Checks the settings that can be judged without opening a file.
    ///
    /// # Errors
    /// [`SettingError`] for a number outside of its range, or a file that is neither PLY nor GLB.
    pub fn validate(&self) -> Result<(), SettingError> {
        let truncation = self.truncation_m.unwrap_or(4.0 * self.voxel_m);
        for (name, value) in [("the edge of a voxel", self.voxel_m), ("the truncation", truncation)] {
            if !(value > 0.0 && value.is_finite()) {
                return Err(SettingError::new(name, value, "a number of metres above 0"));
            }
        }
        if !(self.least_part_m2 >= 0.0 && self.least_part_m2.is_finite()) {
            return Err(SettingError::new("the least area of a part", self.least_part_m2, "0 or more square metres"));
        }
        if !(self.memory_gib > 0.0 && self.memory_gib <= 1024.0) {
            return Err(SettingError::new("the memory of the volume", self.memory_gib, "0 to 1024 GiB"));
        }
        if !(1..=64).contains(&self.shrink) {
            return Err(SettingError::new("the factor that images shrink by", self.shrink, "1 to 64"));
        }
        let ending = self.output.extension().unwrap_or_default().to_string_lossy().to_ascii_lowercase();
        if !["ply", "glb"].contains(&ending.as_str()) {
            return Err(SettingError::new("the ending of the mesh", format!(".{ending}"), ".ply or .glb"));
        }
        Ok(())
    }

    pub(super) fn is_glb(&self) -> bool {
        self.output.extension().is_some_and(|ending| ending.eq_ignore_ascii_case("glb"))
    }
}
