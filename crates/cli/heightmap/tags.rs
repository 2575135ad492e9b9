//! What a height map's file says about itself, in GDAL's default metadata domain.

use std::path::Path;

use anyhow::{Context, bail};
use io::raster::ImageSource;
use serde::Serialize;

/// The items of a map.
#[derive(Debug, Clone, PartialEq, Serialize)]
pub(super) struct Tags {
    pub(super) camera_lon_deg: f64,
    pub(super) camera_lat_deg: f64,
    /// Height of the camera above the ellipsoid: the zero of the map's heights.
    pub(super) camera_height_m: f64,
    /// Height above the ellipsoid of the ground under it, where it was looked for.
    pub(super) ground_height_m: Option<f64>,
    pub(super) heading_deg: f64,
    pub(super) resolution_px_per_m: f64,
    /// s: what the heights are divided by in a normalised map, and would be in a metric one.
    pub(super) scene_scale_m: f64,
    pub(super) normalized: bool,
    pub(super) source: String,
    pub(super) source_kind: String,
    pub(super) interpolation: String,
    /// A number for what was asked for, to know the map again.
    #[serde(skip)]
    pub(super) request: String,
}

const PRODUCT: (&str, &str) = ("SKYSWEEP_PRODUCT", "heightmap");
pub(super) const REQUEST: &str = "HEIGHTMAP_REQUEST";

impl Tags {
    /// As items of metadata; numbers read back to the same bits.
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
    pub(super) fn read(path: &Path) -> anyhow::Result<Self> {
        let items = ImageSource::open(path)?.metadata("");
        let find = |key: &str| items.iter().find(|(k, _)| k == key).map(|(_, v)| v.clone());
        if find(PRODUCT.0).as_deref() != Some(PRODUCT.1) {
            bail!("no height map of skysweep (its metadata says no {}={}): {}", PRODUCT.0, PRODUCT.1, path.display());
        }
        let text =
            |key: &str| find(key).with_context(|| format!("the metadata item {key} is missing: {}", path.display()));
        let number = |key: &str| -> anyhow::Result<f64> {
            let found = text(key)?;
            let value: f64 = found.parse().with_context(|| format!("{key} is {found:?}: {}", path.display()))?;
            anyhow::ensure!(value.is_finite(), "{key} is {found:?}, expected a number: {}", path.display());
            Ok(value)
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
