//! What is written about tiles: the description of one, and the list of all.

use std::path::PathBuf;

use camera::ViewDirection;
use serde::Serialize;

use crate::camera_stand::CameraStand;
use crate::heightmap::HeightMapMade;
use crate::ortho::{OrthoPart, OrthoReport};

/// A tile that was written. Its files lie beside the description.
#[derive(Debug, Clone, Serialize)]
#[non_exhaustive]
pub struct TileManifest {
    /// Identifier of the position; the name of the folder.
    pub id: String,
    /// Pixels along each side.
    pub size_px: usize,
    /// Height map in band 1, confidence in band 2 if it was asked for. Its metadata are here, too.
    pub height_map: HeightMapMade,
    /// Ortho on the pixels of the height map, with the sample type and the bands of the images.
    pub ortho: PathBuf,
    /// State of each cell of the ortho in band 1 (0 seen, 1 hidden, 2 outside, 255 no height),
    /// number of its image in band 2.
    pub ortho_mask: PathBuf,
    /// The ortho as an 8-bit picture, black where nothing is seen.
    pub picture: PathBuf,
    /// Values of the ortho that are black and white in the picture, by its bands.
    pub picture_range: Vec<[f32; 2]>,
    /// Shares of the cells that an image sees, that are hidden in all images, that no image
    /// reaches, and that have no height.
    pub seen_hidden_outside_void: [f64; 4],
    /// Cameras on the ground that stand on the tile; the first is the one that it was made for.
    pub ground_cameras: Vec<GroundCameraInTile>,
    /// The satellite images.
    pub satellites: Vec<SatelliteInTile>,
    /// Number for what was asked for, to recognise the tile.
    pub request: String,
}

/// A camera on the ground, in the frame of a tile.
#[derive(Debug, Clone, Serialize)]
#[non_exhaustive]
pub struct GroundCameraInTile {
    /// Identifier of the position.
    pub id: String,
    /// Longitude, degrees.
    pub lon_deg: f64,
    /// Latitude, degrees.
    pub lat_deg: f64,
    /// Height above the ellipsoid, metres, where it is known.
    pub height_m: Option<f64>,
    /// Heading, degrees clockwise from true north.
    pub heading_deg: f64,
    /// Column and row in the tile, pixels.
    pub pixel: [f64; 2],
    /// Metres to the right of and before the camera that the tile was made for.
    pub right_forward_m: [f64; 2],
    /// Metres above that camera, where the height is known.
    pub up_m: Option<f64>,
    /// Heading relative to that camera, degrees clockwise, in (−180, 180].
    pub relative_heading_deg: f64,
}

/// A satellite image, in the frame of a tile.
#[derive(Debug, Clone, Serialize)]
#[non_exhaustive]
pub struct SatelliteInTile {
    /// Share and grey values of the image in the ortho. Incidences are those of its surface.
    #[serde(flatten)]
    pub part: OrthoPart,
    /// Unit vector from the ground under the camera to the sensor: right, forward, up.
    pub towards_sensor: [f64; 3],
    /// Azimuth of the sensor, degrees clockwise from true north.
    pub azimuth_deg: f64,
}

/// Tiles for the rows of a list, or for one camera.
#[derive(Debug, Clone, Serialize)]
#[non_exhaustive]
pub struct TilesReport {
    /// Tiles that were made now.
    pub made: usize,
    /// Tiles that an earlier run had made.
    pub kept: usize,
    /// Positions without a tile.
    pub failed: usize,
    /// Duration of the job, seconds.
    pub seconds: f64,
    /// The images.
    pub images: Vec<PathBuf>,
    /// The positions, in the order of the list.
    pub tiles: Vec<TileRecord>,
    /// File of this report.
    #[serde(skip)]
    pub written: PathBuf,
}

/// A position and its tile.
#[derive(Debug, Clone, Serialize)]
#[non_exhaustive]
pub struct TileRecord {
    /// Identifier of the position; the name of the folder.
    pub id: String,
    /// What became of the tile.
    #[serde(flatten)]
    pub fate: TileFate,
}

/// What became of a tile.
#[derive(Debug, Clone, Serialize)]
#[serde(tag = "status", rename_all = "lowercase")]
#[non_exhaustive]
pub enum TileFate {
    /// Written now.
    Made,
    /// Written by an earlier run.
    Kept,
    /// Not written.
    Failed {
        /// Why not.
        reason: String,
    },
}

impl TilesReport {
    /// Returns the positions without a tile, each with the reason.
    pub fn failures(&self) -> Vec<(&str, &str)> {
        let failures = self.tiles.iter().filter_map(|record| match &record.fate {
            TileFate::Failed { reason } => Some((record.id.as_str(), reason.as_str())),
            _ => None,
        });
        failures.collect()
    }

    /// Returns the report as text, which ends in a line break.
    pub fn text(&self) -> String {
        let Self { made, kept, failed, seconds, images, written, .. } = self;
        format!(
            "tiles   {made} made, {kept} kept, {failed} failed in {seconds:.1} s\nimages  {}\nlist    {}\n",
            images.len(),
            written.display()
        )
    }
}

/// Returns (east, north) metres as (right, forward) of a heading.
pub(super) fn turned([east, north]: [f64; 2], heading_deg: f64) -> [f64; 2] {
    let (sin, cos) = heading_deg.to_radians().sin_cos();
    [east * cos - north * sin, east * sin + north * cos]
}

impl SatelliteInTile {
    pub(super) fn new(part: OrthoPart, view: ViewDirection, stand: &CameraStand) -> Self {
        let [right, forward] = turned([view.east, view.north], stand.heading_deg);
        Self { part, towards_sensor: [right, forward, view.up], azimuth_deg: view.azimuth_deg() }
    }
}

/// Returns shares of the cells of an ortho: seen, hidden, outside, without a height.
pub(super) fn shares(ortho: &OrthoReport) -> [f64; 4] {
    let cells = (ortho.size.0 * ortho.size.1).max(1) as f64;
    [ortho.cells_seen, ortho.cells_hidden, ortho.cells_outside, ortho.cells_void].map(|n| n as f64 / cells)
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn forward_is_the_heading_and_right_is_clockwise_of_it() {
        let [right, forward] = turned([3.0, 0.0], 90.0);
        assert!(right.abs() < 1e-12 && (forward - 3.0).abs() < 1e-12);
        let [right, forward] = turned([0.0, -2.0], 90.0);
        assert!((right - 2.0).abs() < 1e-12 && forward.abs() < 1e-12);
    }
}
