//! Positions and headings of cameras: one position, a camera file, or the rows of a list.
//!
//! A camera file is JSON: `{"lon_deg": 4.3571, "lat_deg": 52.0116, "heading_deg": 37.0, "height_m":
//! 45.2}`. The heading is clockwise from true north and the height is above the ellipsoid; both are
//! optional.

use std::path::{Path, PathBuf};

use formats::positions::Position;
use numeric::failures;
use serde::{Deserialize, Serialize};

use job::error::{JobError, SettingError};

/// Where the positions of cameras come from.
#[derive(Debug, Clone, PartialEq, Serialize, Deserialize)]
#[serde(rename_all = "snake_case")]
#[non_exhaustive]
pub enum StandSource {
    /// One position.
    Position {
        /// Longitude, degrees.
        lon_deg: f64,
        /// Latitude, degrees.
        lat_deg: f64,
    },
    /// One camera from a JSON file.
    CameraFile(PathBuf),
    /// One camera for each row of a list (CSV or GeoJSON: id, lon, lat, heading, height_m).
    List(PathBuf),
}

/// Positions and headings of cameras.
#[derive(Debug, Clone, PartialEq, Serialize, Deserialize)]
#[serde(deny_unknown_fields)]
#[non_exhaustive]
pub struct StandConfig {
    /// Where the positions come from.
    pub source: StandSource,
    /// Heading in degrees clockwise from true north. It overrides the camera file; the rows of a
    /// list override it.
    pub heading_deg: Option<f64>,
    /// Height of the camera above the ground, metres, where its height is not known otherwise.
    pub ground_offset_m: f64,
    /// Height of the camera above the ellipsoid, metres. It overrides the camera file; the rows of
    /// a list override it.
    pub height_m: Option<f64>,
}

/// Position and heading of one camera.
#[derive(Debug, Clone, Copy, PartialEq)]
pub(crate) struct CameraStand {
    /// Longitude, degrees.
    pub(crate) lon_deg: f64,
    /// Latitude, degrees.
    pub(crate) lat_deg: f64,
    /// Heading, degrees clockwise from true north.
    pub(crate) heading_deg: f64,
    /// Height above the ellipsoid, metres, if it is known.
    pub(crate) height_m: Option<f64>,
}

/// One camera, or the list that names the cameras.
pub(crate) enum Cameras<'a> {
    /// One camera.
    One(CameraStand),
    /// The cameras of this list.
    List(&'a Path),
}

/// A camera file that cannot be used.
#[derive(Debug, thiserror::Error)]
pub(crate) enum StandError {
    /// The camera file cannot be read.
    #[error("cannot read the camera file ({source}): {}", path.display())]
    Unreadable {
        /// The file.
        path: PathBuf,
        /// The system's answer.
        source: std::io::Error,
    },
    /// The camera file does not hold a camera.
    #[error(
        "not a camera file ({source}): expected JSON with lon_deg and lat_deg, and if known heading_deg and height_m: {}",
        path.display()
    )]
    NotACamera {
        /// The file.
        path: PathBuf,
        /// What the JSON reader found.
        source: serde_json::Error,
    },
}

failures!(StandError: File);

#[derive(Debug, Deserialize)]
#[serde(deny_unknown_fields)]
struct CameraFile {
    lon_deg: f64,
    lat_deg: f64,
    heading_deg: Option<f64>,
    height_m: Option<f64>,
}

impl StandConfig {
    /// Cameras 2 m above the ground that look north, unless the source says otherwise.
    pub fn new(source: StandSource) -> Self {
        Self { source, heading_deg: None, ground_offset_m: 2.0, height_m: None }
    }

    /// Checks that all numbers are finite.
    ///
    /// # Errors
    /// [`JobError`] that names the setting.
    pub fn validate(&self) -> Result<(), JobError> {
        let numbers = [
            ("the height of the camera above the ground", Some(self.ground_offset_m), "metres"),
            ("the height of the camera", self.height_m, "metres"),
            ("the heading", self.heading_deg, "degrees"),
        ];
        for (name, found, expected) in numbers {
            if let Some(found) = found.filter(|found| !found.is_finite()) {
                return Err(SettingError::new(name, found, expected).into());
            }
        }
        Ok(())
    }

    /// Returns whether the cameras are the rows of a list.
    pub(crate) fn is_list(&self) -> bool {
        matches!(self.source, StandSource::List(_))
    }

    /// Returns the single camera, or the list of cameras.
    pub(crate) fn cameras(&self) -> Result<Cameras<'_>, StandError> {
        let camera = match &self.source {
            &StandSource::Position { lon_deg, lat_deg } => {
                CameraFile { lon_deg, lat_deg, heading_deg: None, height_m: None }
            }
            StandSource::CameraFile(path) => read(path)?,
            StandSource::List(path) => return Ok(Cameras::List(path)),
        };
        Ok(Cameras::One(CameraStand {
            lon_deg: camera.lon_deg,
            lat_deg: camera.lat_deg,
            heading_deg: self.heading_deg.or(camera.heading_deg).unwrap_or(0.0),
            height_m: self.height_m.or(camera.height_m),
        }))
    }

    /// Returns the camera of a row. Its own heading and height override the configuration.
    pub(crate) fn of_row(&self, position: &Position) -> CameraStand {
        CameraStand {
            lon_deg: position.lon_deg,
            lat_deg: position.lat_deg,
            heading_deg: position.heading_deg.or(self.heading_deg).unwrap_or(0.0),
            height_m: position.height_m.or(self.height_m),
        }
    }
}

fn read(path: &Path) -> Result<CameraFile, StandError> {
    let text = formats::read_regular_text(path, job::files::TEXT_LIMIT)
        .map_err(|source| StandError::Unreadable { path: path.to_owned(), source })?;
    serde_json::from_str(&text).map_err(|source| StandError::NotACamera { path: path.to_owned(), source })
}
