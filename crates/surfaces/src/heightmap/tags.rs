//! The metadata of a height map's file, in GDAL's default metadata domain.

use std::path::Path;

use formats::raster::ImageSource;
use serde::Serialize;

use super::error::HeightMapJobError;

/// Metadata of a height map.
#[derive(Debug, Clone, PartialEq, Serialize)]
#[non_exhaustive]
pub struct HeightMapTags {
    /// Longitude of the camera, degrees.
    pub camera_lon_deg: f64,
    /// Latitude of the camera, degrees.
    pub camera_lat_deg: f64,
    /// Height of the camera above the ellipsoid, metres: the zero of the heights of the map.
    pub camera_height_m: f64,
    /// Height of the ground under the camera above the ellipsoid, metres, if it was looked for.
    pub ground_height_m: Option<f64>,
    /// Heading, degrees clockwise from true north.
    pub heading_deg: f64,
    /// Pixels per metre on the ground.
    pub resolution_px_per_m: f64,
    /// Scale of the scene, metres: the divisor of the heights of a normalised map.
    pub scene_scale_m: f64,
    /// Whether the heights are divided by the scale of the scene.
    pub normalized: bool,
    /// File name of the source.
    pub source: String,
    /// `raster`, `city model` or `point cloud`.
    pub source_kind: String,
    /// Interpolation between the cells of a raster.
    pub interpolation: String,
    /// Number for what was asked for, to recognise the map.
    #[serde(skip)]
    pub(super) request: String,
}

const PRODUCT: (&str, &str) = ("SKYSWEEP_PRODUCT", "heightmap");
const REQUEST: &str = "HEIGHTMAP_REQUEST";

impl HeightMapTags {
    /// Returns the items of metadata. Numbers read back to the same bits.
    pub(super) fn items(&self) -> Vec<(&'static str, String)> {
        let units = if self.normalized { "scene (metres / SCENE_SCALE_M)" } else { "metre" };
        let mut items = vec![
            (PRODUCT.0, PRODUCT.1.to_owned()),
            ("CAMERA_LON_DEG", self.camera_lon_deg.to_string()),
            ("CAMERA_LAT_DEG", self.camera_lat_deg.to_string()),
            ("CAMERA_HEIGHT_M", self.camera_height_m.to_string()),
            ("HEADING_DEG", self.heading_deg.to_string()),
            ("RESOLUTION_PX_PER_M", self.resolution_px_per_m.to_string()),
            ("RESOLUTION_PX_PER_SCENE_UNIT", (self.resolution_px_per_m * self.scene_scale_m).to_string()),
            ("SCENE_SCALE_M", self.scene_scale_m.to_string()),
            ("NORMALIZED", if self.normalized { "yes" } else { "no" }.to_owned()),
            ("UNITS", units.to_owned()),
            ("SOURCE", self.source.clone()),
            ("SOURCE_KIND", self.source_kind.clone()),
            ("INTERPOLATION", self.interpolation.clone()),
            (REQUEST, self.request.clone()),
        ];
        if let Some(ground) = self.ground_height_m {
            items.push(("GROUND_HEIGHT_M", ground.to_string()));
        }
        items
    }

    /// Reads the items of a file.
    pub(super) fn read(path: &Path) -> Result<Self, HeightMapJobError> {
        let not_one = |found: String| HeightMapJobError::NotAHeightMap { path: path.to_owned(), found };
        let items = ImageSource::open(path)?.metadata("");
        let find = |key: &str| items.iter().find(|(k, _)| k == key).map(|(_, v)| v.clone());
        if find(PRODUCT.0).as_deref() != Some(PRODUCT.1) {
            return Err(not_one(format!("its metadata has no {}={}", PRODUCT.0, PRODUCT.1)));
        }
        let text = |key: &str| find(key).ok_or_else(|| not_one(format!("the metadata item {key} is missing")));
        let number = |key: &str| -> Result<f64, HeightMapJobError> {
            let found = text(key)?;
            let value = found.parse().ok().filter(|value: &f64| value.is_finite());
            value.ok_or_else(|| not_one(format!("{key} is {found:?}, expected a number")))
        };
        Ok(Self {
            camera_lon_deg: number("CAMERA_LON_DEG")?,
            camera_lat_deg: number("CAMERA_LAT_DEG")?,
            camera_height_m: number("CAMERA_HEIGHT_M")?,
            ground_height_m: find("GROUND_HEIGHT_M").and_then(|v| v.parse().ok()),
            heading_deg: number("HEADING_DEG")?,
            resolution_px_per_m: number("RESOLUTION_PX_PER_M")?,
            scene_scale_m: number("SCENE_SCALE_M")?,
            normalized: text("NORMALIZED")? == "yes",
            source: text("SOURCE")?,
            source_kind: text("SOURCE_KIND")?,
            interpolation: text("INTERPOLATION")?,
            request: find(REQUEST).unwrap_or_default(),
        })
    }
}
