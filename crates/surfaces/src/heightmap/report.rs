//! What became of height maps.

use std::path::PathBuf;

use serde::Serialize;

use super::tags::HeightMapTags;

/// Result of a height map job. It serializes as the one map, or as the list.
#[derive(Debug, Clone, Serialize)]
#[serde(untagged)]
#[non_exhaustive]
pub enum HeightMapReport {
    /// The map of one camera.
    One(Box<HeightMapMade>),
    /// The maps of a list.
    List(HeightMapList),
}

/// A height map that was written.
#[derive(Debug, Clone, Serialize)]
#[non_exhaustive]
pub struct HeightMapMade {
    /// File of the map.
    pub path: PathBuf,
    /// Metadata of the map.
    #[serde(flatten)]
    pub tags: HeightMapTags,
    /// Share of the pixels without a height.
    pub void_share: f64,
    /// Lowest and highest height relative to the camera, metres.
    pub height_range_m: (f32, f32),
}

/// Height maps for the rows of a list.
#[derive(Debug, Clone, Serialize)]
#[non_exhaustive]
pub struct HeightMapList {
    /// Rows of the list.
    pub rows: usize,
    /// Maps that were made now.
    pub made: usize,
    /// Maps that an earlier run had made.
    pub kept: usize,
    /// Rows without a map.
    pub failed: usize,
    /// Duration of the job, seconds.
    pub seconds: f64,
    /// The rows, in the order of the list.
    pub maps: Vec<HeightMapRecord>,
    /// File of this report.
    #[serde(skip)]
    pub written: PathBuf,
}

/// A row of a list.
#[derive(Debug, Clone, Serialize)]
#[non_exhaustive]
pub struct HeightMapRecord {
    /// Identifier of the row.
    pub id: String,
    /// What became of its map.
    #[serde(flatten)]
    pub fate: HeightMapFate,
}

/// What became of a map of a list.
#[derive(Debug, Clone, Serialize)]
#[serde(tag = "status", rename_all = "lowercase")]
#[non_exhaustive]
pub enum HeightMapFate {
    /// Written now.
    Made(Box<HeightMapMade>),
    /// Written by an earlier run.
    Kept,
    /// Not written.
    Failed {
        /// Why not.
        reason: String,
    },
}

impl HeightMapReport {
    /// Returns the report as text, which ends in a line break.
    pub fn text(&self) -> String {
        match self {
            Self::One(made) => made.text(),
            Self::List(list) => list.text(),
        }
    }

    /// Returns the cameras of a list whose maps could not be made, each with the reason.
    pub fn failures(&self) -> Vec<(&str, &str)> {
        let Self::List(list) = self else { return Vec::new() };
        let failures = list.maps.iter().filter_map(|record| match &record.fate {
            HeightMapFate::Failed { reason } => Some((record.id.as_str(), reason.as_str())),
            _ => None,
        });
        failures.collect()
    }
}

impl HeightMapMade {
    fn text(&self) -> String {
        let t = &self.tags;
        let (low, high) = self.height_range_m;
        format!(
            "height map  {}\ncamera      {:.7} {:.7}, {:.3} m above the ellipsoid, heading {}°\nheights     {low:.2} to {high:.2} m, \
             {:.1} % void\nscale       s = {:.4} m{}\n",
            self.path.display(),
            t.camera_lon_deg,
            t.camera_lat_deg,
            t.camera_height_m,
            t.heading_deg,
            100.0 * self.void_share,
            t.scene_scale_m,
            if t.normalized { ", heights are divided by it" } else { "" },
        )
    }
}

impl HeightMapList {
    fn text(&self) -> String {
        let Self { made, kept, failed, seconds, written, .. } = self;
        format!("maps    {made} made, {kept} kept, {failed} failed in {seconds:.1} s\nreport  {}\n", written.display())
    }
}
