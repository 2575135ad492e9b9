//! Options for positions and headings of cameras, which several commands share.

use std::path::PathBuf;

use jobs::camera_stand::{StandConfig, StandSource};

/// Options for positions and headings of cameras.
#[derive(Debug, clap::Args)]
pub(crate) struct StandArgs {
    /// Longitude and latitude of the camera, degrees.
    #[arg(long, num_args = 2, value_names = ["LON", "LAT"], allow_negative_numbers = true)]
    center: Option<Vec<f64>>,
    /// The camera: a JSON file with lon_deg and lat_deg, and optionally heading_deg and height_m.
    #[arg(long, value_name = "FILE", conflicts_with = "center")]
    camera: Option<PathBuf>,
    /// One camera for each row of a list (CSV or GeoJSON: id, lon, lat, heading, height_m).
    #[arg(long, value_name = "FILE", conflicts_with_all = ["center", "camera"])]
    pub(crate) positions: Option<PathBuf>,
    /// Heading of the camera, degrees clockwise from true north [default: the camera's or row's,
    /// else 0].
    #[arg(long, value_name = "DEGREES", allow_negative_numbers = true)]
    heading: Option<f64>,
    /// Height of the camera above the ground under it, metres.
    #[arg(long, value_name = "METRES", default_value_t = 2.0, allow_negative_numbers = true)]
    ground_offset: f64,
    /// Height of the camera above the ellipsoid, metres [default: the camera's or row's, else the
    /// ground's and --ground-offset].
    #[arg(long, value_name = "METRES", allow_negative_numbers = true)]
    camera_height: Option<f64>,
}

impl StandArgs {
    /// Returns the configuration; `None` if no position is given.
    pub(crate) fn config(&self) -> Option<StandConfig> {
        let source = match (self.center.as_deref(), &self.camera, &self.positions) {
            (Some(&[lon_deg, lat_deg]), ..) => StandSource::Position { lon_deg, lat_deg },
            (_, Some(path), _) => StandSource::CameraFile(path.clone()),
            (_, _, Some(list)) => StandSource::List(list.clone()),
            _ => return None,
        };
        let mut config = StandConfig::new(source);
        config.heading_deg = self.heading;
        config.ground_offset_m = self.ground_offset;
        config.height_m = self.camera_height;
        Some(config)
    }
}
