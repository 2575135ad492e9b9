//! The configuration of ground views.

use std::path::PathBuf;

use crs::VerticalDatum;
use serde::{Deserialize, Serialize};

use crate::camera_stand::StandConfig;
use job::error::{JobError, SettingError};

/// Most columns of a panorama, and most pixels along a side of a crop.
const SIDE_MAX: usize = 16_384;
/// Most crops of a panorama.
const CROPS_MAX: usize = 360;

/// Cameras that look at the surface.
#[derive(Debug, Clone, PartialEq, Serialize, Deserialize)]
#[serde(rename_all = "snake_case")]
#[non_exhaustive]
pub enum GroundCameras {
    /// Cameras of a COLMAP model on the map of the surface, in a folder with `origin.json`: the
    /// alignment job writes such a folder.
    Model(PathBuf),
    /// Panoramas, each with perspective crops.
    Panoramas(StandConfig),
}

/// Views of a surface from cameras on the ground.
#[derive(Debug, Clone, PartialEq, Serialize, Deserialize)]
#[serde(deny_unknown_fields)]
#[non_exhaustive]
pub struct GroundViewConfig {
    /// Height map or surface model (raster), or city model (CityJSON, CityGML, OBJ, PLY), on a map
    /// in metres.
    pub surface: PathBuf,
    /// Folder to write.
    pub output: PathBuf,
    /// Cameras that look at the surface.
    pub cameras: GroundCameras,
    /// Columns of a panorama; it has half as many rows.
    pub panorama_width_px: usize,
    /// Perspective crops of each panorama, evenly around from its heading on.
    pub crops: usize,
    /// Pixels along each side of a crop.
    pub crop_size_px: usize,
    /// Field of view of a crop, degrees.
    pub crop_fov_deg: f64,
    /// Folder with the pictures of the panoramas (`ID.png`, `ID.jpg` or `ID.tif`; a single panorama
    /// is called `panorama`). Crops are cut from them.
    pub pictures: Option<PathBuf>,
    /// Most points of the surface per perspective camera in the COLMAP model.
    pub points_per_view: usize,
    /// Vertical datum of the surface, where the file names none or a wrong one.
    pub surface_vertical: Option<VerticalDatum>,
    /// Worker threads. `None` uses all cores.
    pub threads: Option<usize>,
    /// Whether existing files may be replaced.
    pub overwrite: bool,
}

impl GroundViewConfig {
    /// Views with panoramas of 1024 x 512 pixels and four crops of 512 x 512 pixels.
    pub fn new(surface: PathBuf, output: PathBuf, cameras: GroundCameras) -> Self {
        Self {
            surface,
            output,
            cameras,
            panorama_width_px: 1024,
            crops: 4,
            crop_size_px: 512,
            crop_fov_deg: 90.0,
            pictures: None,
            points_per_view: 2000,
            surface_vertical: None,
            threads: None,
            overwrite: false,
        }
    }

    /// Checks the settings that can be judged without opening a file.
    ///
    /// # Errors
    /// [`JobError`] for a number outside of its range.
    pub fn validate(&self) -> Result<(), JobError> {
        let value = |name, found: String, expected| Err(SettingError::new(name, found, expected).into());
        if !(2..=SIDE_MAX).contains(&self.panorama_width_px) {
            return value("the width of a panorama", self.panorama_width_px.to_string(), "2 to 16384 pixels");
        }
        let GroundCameras::Panoramas(stand) = &self.cameras else { return Ok(()) };
        stand.validate()?;
        if !(1..=SIDE_MAX).contains(&self.crop_size_px) {
            return value("the size of a crop", self.crop_size_px.to_string(), "1 to 16384 pixels");
        }
        if !(self.crop_fov_deg > 0.0 && self.crop_fov_deg < 180.0) {
            return value("the field of view", self.crop_fov_deg.to_string(), "degrees between 0 and 180");
        }
        if self.crops > CROPS_MAX {
            return value("the number of crops", self.crops.to_string(), "at most 360");
        }
        Ok(())
    }

    /// Returns whether the views are the rows of a list, of which single ones may fail.
    pub(super) fn is_list(&self) -> bool {
        matches!(&self.cameras, GroundCameras::Panoramas(stand) if stand.is_list())
    }
}
