//! Where cameras stand and look, from the command line, a file or the rows of a list: the options that commands share.
//!
//! A camera's file is JSON: `{"lon_deg": 4.3571, "lat_deg": 52.0116, "heading_deg": 37.0, "height_m": 45.2}`, heading (clockwise
//! from true north) and height (of the camera, above the ellipsoid) where known.

use std::path::{Path, PathBuf};

use anyhow::{Context, ensure};
use io::positions::Position;
use serde::Deserialize;

/// Options that say where cameras stand.
#[derive(Debug, clap::Args)]
pub(crate) struct StandArgs {
    /// Longitude and latitude of the camera, degrees.
    #[arg(long, num_args = 2, value_names = ["LON", "LAT"], allow_negative_numbers = true)]
    center: Option<Vec<f64>>,
    /// The camera: a JSON file with lon_deg and lat_deg, and where wanted heading_deg and height_m.
    #[arg(long, value_name = "FILE", conflicts_with = "center")]
    camera: Option<PathBuf>,
    /// One camera for each row of a list (CSV or GeoJSON: id, lon, lat, heading, height_m).
    #[arg(long, value_name = "FILE", conflicts_with_all = ["center", "camera"])]
    pub(crate) positions: Option<PathBuf>,
    /// Where the camera looks, degrees clockwise from true north [default: the camera's or row's, else 0].
    #[arg(long, value_name = "DEGREES", allow_negative_numbers = true)]
    heading: Option<f64>,
    /// Height of the camera above the ground under it, metres.
    #[arg(long, value_name = "METRES", default_value_t = 2.0, allow_negative_numbers = true)]
    pub(crate) ground_offset: f64,
    /// Height of the camera above the ellipsoid, metres [default: the camera's or row's, else the ground's and --ground-offset].
    #[arg(long, value_name = "METRES", allow_negative_numbers = true)]
    camera_height: Option<f64>,
}

/// Where a camera stands and looks.
#[derive(Debug, Clone, Copy, PartialEq)]
pub(crate) struct Stand {
    pub(crate) lon_deg: f64,
    pub(crate) lat_deg: f64,
    pub(crate) heading_deg: f64,
    /// Height above the ellipsoid, metres, where it is known.
    pub(crate) height_m: Option<f64>,
}

#[derive(Debug, Deserialize)]
#[serde(deny_unknown_fields)]
struct CameraFile {
    lon_deg: f64,
    lat_deg: f64,
    heading_deg: Option<f64>,
    height_m: Option<f64>,
}

impl StandArgs {
    /// Refuses numbers that are none.
    pub(crate) fn check(&self) -> anyhow::Result<()> {
        ensure!(self.ground_offset.is_finite(), "--ground-offset is {}, expected metres", self.ground_offset);
        ensure!(self.camera_height.is_none_or(f64::is_finite), "--camera-height is no number of metres");
        ensure!(self.heading.is_none_or(f64::is_finite), "--heading is no number of degrees");
        Ok(())
    }

    /// The camera that is named by itself; `None` where there is none.
    pub(crate) fn single(&self) -> anyhow::Result<Option<Stand>> {
        let CameraFile { lon_deg, lat_deg, heading_deg, height_m } = match (self.center.as_deref(), &self.camera) {
            (Some(&[lon_deg, lat_deg]), _) => CameraFile { lon_deg, lat_deg, heading_deg: None, height_m: None },
            (_, Some(path)) => read(path)?,
            _ => return Ok(None),
        };
        let heading_deg = self.heading.or(heading_deg).unwrap_or(0.0);
        Ok(Some(Stand { lon_deg, lat_deg, heading_deg, height_m: self.camera_height.or(height_m) }))
    }

    /// The camera of a row: what the row says goes before the options.
    pub(crate) fn of_row(&self, position: &Position) -> Stand {
        Stand {
            lon_deg: position.lon_deg,
            lat_deg: position.lat_deg,
            heading_deg: position.heading_deg.or(self.heading).unwrap_or(0.0),
            height_m: position.height_m.or(self.camera_height),
        }
    }
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
