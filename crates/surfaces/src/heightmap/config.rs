//! The configuration of height maps.

use std::path::PathBuf;
use std::str::FromStr;

use city::Lod;
use crs::VerticalDatum;
use heightmap::Reading;
use serde::{Deserialize, Serialize};

use crate::camera_stand::StandConfig;
use job::error::JobError;

/// Unit of the heights of a map.
///
/// The names of the variants are part of the request number that a map's file holds: see
/// `Settings::fingerprint`.
#[derive(Debug, Clone, Copy, PartialEq, Default, Serialize, Deserialize)]
#[serde(rename_all = "snake_case")]
pub enum Normalization {
    /// Metres.
    #[default]
    None,
    /// Units of the mean distance of the map's points from the camera.
    Auto,
    /// Units of this many metres.
    By(f64),
}

impl FromStr for Normalization {
    type Err = String;

    fn from_str(text: &str) -> Result<Self, String> {
        match text {
            "none" => Ok(Self::None),
            "auto" => Ok(Self::Auto),
            number => match number.parse::<f64>() {
                Ok(s) if s > 0.0 && s.is_finite() => Ok(Self::By(s)),
                _ => Err(format!("expected auto, none or a positive number of metres, found {number:?}")),
            },
        }
    }
}

/// Map projection that a height map is written in.
///
/// The names of the variants are part of the request number that a map's file holds: see
/// `Settings::fingerprint`.
#[derive(Debug, Clone, Copy, PartialEq, Eq, Default, Serialize, Deserialize)]
#[serde(rename_all = "snake_case")]
pub enum MapChoice {
    /// A transverse Mercator at the camera, whose metres are metres on the ground.
    #[default]
    Local,
    /// The UTM zone of the camera.
    Utm,
    /// The projected coordinate reference system of this EPSG code.
    Epsg(u32),
}

impl FromStr for MapChoice {
    type Err = String;

    fn from_str(text: &str) -> Result<Self, String> {
        let lower = text.to_ascii_lowercase();
        match lower.as_str() {
            "local" => Ok(Self::Local),
            "utm" => Ok(Self::Utm),
            other => match other.strip_prefix("epsg:").unwrap_or(other).parse() {
                Ok(code) => Ok(Self::Epsg(code)),
                Err(_) => Err(format!("expected local, utm or EPSG:n, found {text:?}")),
            },
        }
    }
}

/// Where the confidences of a map come from.
#[derive(Debug, Clone, PartialEq, Eq, Default, Serialize, Deserialize)]
#[serde(rename_all = "snake_case")]
#[non_exhaustive]
pub enum ConfidenceSource {
    /// The map has no band of confidences.
    #[default]
    None,
    /// From `confidence.tif` beside a surface model that skysweep made; for other sources 1 where
    /// the source has a height and 0 where the terrain model gave it.
    Automatic,
    /// From this raster.
    Raster(PathBuf),
}

/// Height maps of a source, for one camera or for the rows of a list.
#[derive(Debug, Clone, PartialEq, Serialize, Deserialize)]
#[serde(deny_unknown_fields)]
#[non_exhaustive]
pub struct HeightMapConfig {
    /// Surface model (raster), city model (CityJSON, CityGML, OBJ, PLY) or point cloud (LAS, LAZ,
    /// COPC).
    pub source: PathBuf,
    /// GeoTIFF to write; for a list the folder of the maps.
    pub output: PathBuf,
    /// Positions and headings of the cameras.
    pub stand: StandConfig,
    /// Pixels along each side.
    pub size_px: usize,
    /// Pixels per metre on the ground.
    pub resolution_px_per_m: f64,
    /// Terrain model: the ground under the camera, and the height where the source has none.
    pub terrain: Option<PathBuf>,
    /// Unit of the heights.
    pub normalization: Normalization,
    /// Where the confidences come from.
    pub confidence: ConfidenceSource,
    /// Map projection to write in.
    pub map: MapChoice,
    /// Interpolation between the cells of a raster.
    pub interpolation: Reading,
    /// EPSG code of the source, where the file names none or a wrong one.
    pub source_epsg: Option<u32>,
    /// Vertical datum of the source, where the file names none or a wrong one.
    pub source_vertical: Option<VerticalDatum>,
    /// Level of detail of a city model. `None` takes the highest of each object up to 2.x.
    #[serde(with = "job::as_text", default)]
    pub lod: Option<Lod>,
    /// Whether every object of a city model is used, not only buildings.
    pub all_objects: bool,
    /// Whether a picture is written beside each map.
    pub previews: bool,
    /// Worker threads. `None` uses all cores.
    pub threads: Option<usize>,
    /// Whether existing maps are replaced. Otherwise a list goes on where an earlier run was
    /// stopped.
    pub overwrite: bool,
}

impl HeightMapConfig {
    /// Maps of 518 x 518 pixels at 2 pixels per metre, in metres, without a picture.
    pub fn new(source: PathBuf, output: PathBuf, stand: StandConfig) -> Self {
        Self {
            source,
            output,
            stand,
            size_px: 518,
            resolution_px_per_m: 2.0,
            terrain: None,
            normalization: Normalization::default(),
            confidence: ConfidenceSource::default(),
            map: MapChoice::default(),
            interpolation: Reading::default(),
            source_epsg: None,
            source_vertical: None,
            lod: None,
            all_objects: false,
            previews: false,
            threads: None,
            overwrite: false,
        }
    }

    /// Checks the settings that can be judged without opening a file. Size and resolution are
    /// judged with the first tile.
    ///
    /// # Errors
    /// [`JobError`] for a camera whose numbers are not finite.
    pub fn validate(&self) -> Result<(), JobError> {
        self.stand.validate()
    }
}
