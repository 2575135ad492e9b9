//! The camera that a map is made for: from the command line, or from a file.
//!
//! The file is JSON: `{"lon_deg": 4.3571, "lat_deg": 52.0116, "heading_deg": 37.0, "height_m": 45.2}`, heading (clockwise from true
//! north) and height (of the camera, above the ellipsoid) where known.

use std::path::Path;

use anyhow::{Context, bail};
use serde::Deserialize;

use super::MakeArgs;
use super::settings::Stand;

#[derive(Debug, Deserialize)]
#[serde(deny_unknown_fields)]
struct CameraFile {
    lon_deg: f64,
    lat_deg: f64,
    heading_deg: Option<f64>,
    height_m: Option<f64>,
}

/// Where the camera of a single map stands.
pub(super) fn stand(args: &MakeArgs) -> anyhow::Result<Stand> {
    let (lon_deg, lat_deg, heading_deg, height_m) = match (args.center.as_deref(), &args.camera) {
        (Some(&[lon_deg, lat_deg]), _) => (lon_deg, lat_deg, None, None),
        (_, Some(path)) => {
            let CameraFile { lon_deg, lat_deg, heading_deg, height_m } = read(path)?;
            (lon_deg, lat_deg, heading_deg, height_m)
        }
        _ => bail!("no position: give --center LON LAT, --camera FILE or --positions FILE"),
    };
    let heading_deg = args.heading.or(heading_deg).unwrap_or(0.0);
    Ok(Stand { lon_deg, lat_deg, heading_deg, height_m: args.camera_height.or(height_m) })
}

fn read(path: &Path) -> anyhow::Result<CameraFile> {
    let text =
        std::fs::read_to_string(path).with_context(|| format!("cannot read the camera file: {}", path.display()))?;
    serde_json::from_str(&text).with_context(|| {
        format!(
            "no camera: expected JSON with lon_deg, lat_deg and where known heading_deg, height_m: {}",
            path.display()
        )
    })
}
