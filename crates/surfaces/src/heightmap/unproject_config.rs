//! Configuration and report of the way back from a height map to points or splats.

use std::path::PathBuf;

use serde::{Deserialize, Serialize};

use super::error::HeightMapJobError;
use super::tags::HeightMapTags;
use job::error::JobError;

/// Axes of the points of a PLY file.
#[derive(Debug, Clone, Copy, PartialEq, Eq, Default, Serialize, Deserialize)]
#[serde(rename_all = "snake_case")]
pub enum PointAxes {
    /// East, north, up of the camera.
    #[default]
    World,
    /// (u / r, v / r, h): right of the camera, behind it, up.
    Camera,
}

impl PointAxes {
    /// All values with the names that people give them, and their meanings.
    pub const CHOICES: [(&'static str, Self, &'static str); 2] = [
        ("world", Self::World, "East, north, up of the camera"),
        ("camera", Self::Camera, "(u / r, v / r, h): right of the camera, behind it, up"),
    ];
}

/// A height map to be turned back into points or splats.
#[derive(Debug, Clone, PartialEq, Serialize, Deserialize)]
#[serde(deny_unknown_fields)]
#[non_exhaustive]
pub struct UnprojectConfig {
    /// Height map that skysweep made.
    pub map: PathBuf,
    /// File to write: `.ply` (metres from the camera), or `.las` or `.laz` (UTM, heights above the
    /// ellipsoid).
    pub output: PathBuf,
    /// Axes of the points of a PLY.
    pub axes: PointAxes,
    /// Whether Gaussian splats are written instead of points (PLY, with its origin beside it), one
    /// for each pixel.
    pub splats: bool,
    /// Picture of the map's own pixels that gives the splats their colours. Without it they are
    /// grey.
    pub picture: Option<PathBuf>,
    /// Splats whose heights are within this distance of one plane, and whose colours are alike, are
    /// merged, metres.
    pub merge_m: Option<f64>,
    /// Whether an existing file may be replaced.
    pub overwrite: bool,
}

/// Points or splats that were written.
#[derive(Debug, Clone, Serialize)]
#[non_exhaustive]
pub struct UnprojectReport {
    /// File that was written.
    pub path: PathBuf,
    /// Number of points, if points were written.
    #[serde(skip_serializing_if = "Option::is_none")]
    pub points: Option<usize>,
    /// Number of splats, if splats were written.
    #[serde(skip_serializing_if = "Option::is_none")]
    pub splats: Option<usize>,
    /// Metadata of the map.
    pub camera: HeightMapTags,
}

impl UnprojectConfig {
    /// Points on the axes of the world.
    pub fn new(map: PathBuf, output: PathBuf) -> Self {
        Self { map, output, axes: PointAxes::default(), splats: false, picture: None, merge_m: None, overwrite: false }
    }

    /// Checks that the output can hold what is asked for.
    ///
    /// # Errors
    /// [`JobError`] for an unknown ending of the output, and for splats on mirrored axes.
    pub fn validate(&self) -> Result<(), JobError> {
        let unknown = |expected| Err(HeightMapJobError::UnknownEnding { path: self.output.clone(), expected });
        Ok(match self.ending().as_str() {
            "ply" if self.splats && self.axes == PointAxes::Camera => Err(HeightMapJobError::MirroredAxes),
            "ply" => Ok(()),
            _ if self.splats => unknown(".ply for splats"),
            "las" | "laz" => Ok(()),
            _ => unknown(".ply, .las or .laz"),
        }?)
    }

    /// Returns the ending of the output in lower case.
    pub(super) fn ending(&self) -> String {
        self.output.extension().map(|e| e.to_string_lossy().to_lowercase()).unwrap_or_default()
    }
}

impl UnprojectReport {
    /// Returns the report as text, which ends in a line break.
    pub fn text(&self) -> String {
        let (what, count) = self.splats.map_or(("points", self.points), |count| ("splats", Some(count)));
        format!("{what}  {}\nfile    {}\n", count.unwrap_or(0), self.path.display())
    }
}
