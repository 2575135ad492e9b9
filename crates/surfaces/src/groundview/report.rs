//! What ground views were made.

use std::path::PathBuf;

use serde::Serialize;

/// Name of the report in the folder.
pub(super) const REPORT: &str = "report.json";

/// Ground views that were made.
#[derive(Debug, Clone, Serialize)]
#[non_exhaustive]
pub struct GroundViewReport {
    /// The views, in the order of the cameras.
    pub views: Vec<GroundViewRow>,
    /// Views that were asked for and could not be made.
    pub failed: Vec<GroundViewFailure>,
    /// Points of the COLMAP model.
    pub points: usize,
    /// Cells of a raster that some view sees, and all cells with a height.
    pub cells_seen: Option<[usize; 2]>,
    /// Folder of the views.
    #[serde(skip)]
    pub folder: PathBuf,
}

/// A ground view.
#[derive(Debug, Clone, Serialize)]
#[non_exhaustive]
pub struct GroundViewRow {
    /// Name of its files, without folder and ending.
    pub name: String,
    /// `perspective` or `panorama`.
    pub kind: &'static str,
    /// Columns and rows.
    pub size: (usize, usize),
    /// Position of the camera, metres from the origin.
    pub centre: [f64; 3],
    /// Share of the pixels that show the surface.
    pub ground_share: f64,
    /// Share of the pixels that show the sky.
    pub sky_share: f64,
    /// Least and greatest depth, metres.
    pub depth_range_m: Option<[f32; 2]>,
}

/// A view that was asked for and could not be made.
#[derive(Debug, Clone, Serialize)]
#[non_exhaustive]
pub struct GroundViewFailure {
    /// Identifier of the row, or name of the view.
    pub id: String,
    /// Why it could not be made.
    pub reason: String,
}

impl GroundViewReport {
    /// Returns whether every view was made.
    pub fn is_complete(&self) -> bool {
        self.failed.is_empty()
    }

    /// Returns the report as text, which ends in a line break.
    pub fn text(&self) -> String {
        let mut text = String::new();
        for view in &self.views {
            let (ground, sky) = (100.0 * view.ground_share, 100.0 * view.sky_share);
            let [low, high] = view.depth_range_m.unwrap_or([f32::NAN; 2]);
            text += &format!(
                "{:11} {:20} {ground:.1} % surface, {sky:.1} % sky, {low:.1} to {high:.1} m\n",
                view.kind, view.name
            );
        }
        if let Some([seen, all]) = self.cells_seen {
            text += &format!("cells       {seen} of {all} seen\n");
        }
        if !self.failed.is_empty() {
            text += &format!("failed      {}, see {}\n", self.failed.len(), self.folder.join(REPORT).display());
        }
        text + &format!("points      {}\nwritten     {}\n", self.points, self.folder.display())
    }
}
