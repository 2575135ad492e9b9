//! What a run did, for people and programs.

use std::path::PathBuf;

use camera::ImageCorrection;
use serde::Serialize;
use sweep::pointing::{Adjustment, ModelOrder};

use crate::dsm::geometry::PairGeometry;
use numeric::Choice;

/// The JSON report of a DSM run.
#[derive(Debug, Clone, Serialize)]
pub struct DsmReport {
    /// Version of the program.
    pub version: String,
    /// The images.
    pub images: Vec<ImageReport>,
    /// The pairs matched.
    pub pairs: Vec<PairReport>,
    /// The correction of the RPCs.
    pub pointing: PointingReport,
    /// Heights searched, metres above the ellipsoid.
    pub height_range_m: (f64, f64),
    /// Pixel × hypothesis pairs evaluated.
    pub hypotheses: u64,
    /// The surface.
    pub surface: SurfaceReport,
    /// How the scene was divided; absent when it was computed at once.
    #[serde(skip_serializing_if = "Option::is_none")]
    pub chunks: Option<ChunksReport>,
    /// What became of the city model; absent without one.
    #[serde(skip_serializing_if = "Option::is_none")]
    pub prior: Option<PriorReport>,
    /// All choices with their reasons.
    pub choices: Vec<Choice>,
    /// What the user should know.
    pub warnings: Vec<String>,
    /// Wall time per stage.
    pub stages: Vec<StageTime>,
    /// Largest resident memory, megabytes.
    pub peak_memory_mb: Option<f64>,
}

/// One image.
#[derive(Debug, Clone, Serialize)]
pub struct ImageReport {
    /// Its file.
    pub path: PathBuf,
    /// Where its RPC was found.
    pub rpc: String,
    /// Columns and rows.
    pub size: (usize, usize),
    /// Side of a pixel on the ground, metres.
    pub gsd_m: Option<f64>,
    /// Angle of the line of sight to the vertical, degrees.
    pub incidence_deg: Option<f64>,
    /// The correction found, in the frame of the part that was read.
    pub correction: Option<ImageCorrection>,
    /// The correction that was applied, in the frame of the whole image.
    pub applied_correction: ImageCorrection,
}

/// One pair of images.
#[derive(Debug, Clone, Serialize)]
pub struct PairReport {
    /// Positions of the images, from 1.
    pub images: (usize, usize),
    /// Angle, overlap, parallax.
    #[serde(flatten)]
    pub geometry: PairGeometry,
    /// Tie points found.
    pub ties: usize,
}

/// The pointing correction.
#[derive(Debug, Clone, Serialize)]
pub struct PointingReport {
    /// Whether it was applied.
    pub applied: bool,
    /// `none`, `translation` or `affine`.
    pub order: &'static str,
    /// Ground points seen in two or more images.
    pub tracks: usize,
    /// Those of them that fit.
    pub inliers: usize,
    /// Robust deviation of the residuals before, pixels.
    pub residual_before_px: f64,
    /// … and after.
    pub residual_after_px: f64,
    /// Root mean square of the inliers after, pixels.
    pub rms_px: f64,
}

impl PointingReport {
    pub(crate) fn new(a: &Adjustment, tracks: usize, applied: bool) -> Self {
        let order = match a.order {
            ModelOrder::None => "none",
            ModelOrder::Translation => "translation",
            ModelOrder::Affine => "affine",
        };
        Self {
            applied,
            order,
            tracks,
            inliers: a.ground.iter().flatten().count(),
            residual_before_px: a.residual_px.0,
            residual_after_px: a.residual_px.1,
            rms_px: a.rms_px,
        }
    }
}

/// What the grid holds.
#[derive(Debug, Clone, Serialize)]
pub struct SurfaceReport {
    /// All cells.
    pub cells: usize,
    /// Cells with an observed height.
    pub observed: usize,
    /// Cells filled from their surroundings.
    pub filled: usize,
    /// Cells without a height.
    pub void: usize,
    /// Cells removed as speckle.
    pub speckle_removed: usize,
    /// Share of each view's pixels that another view agrees with.
    pub kept_by_view: Vec<f64>,
}

/// A city model held against the heights that a coarser level found.
#[derive(Debug, Clone, Serialize)]
pub struct PriorReport {
    /// Its file.
    pub model: PathBuf,
    /// Buildings that at least one view sees.
    pub buildings_seen: usize,
    /// Views (of chunks, each counts) that see the model and agree with hardly any of it: they do without.
    pub disagreeing_views: usize,
    /// A building is left out in a view where a smaller share of its pixels agrees.
    pub least_agreeing: f64,
    /// Pixels agree whose heights differ by at most this, metres.
    pub tolerance_m: f64,
    /// Buildings that are taken to be gone.
    pub left_out: Vec<LeftOut>,
}

/// A building that is not where the model has it.
#[derive(Debug, Clone, Serialize)]
pub struct LeftOut {
    /// Its identifier in the model.
    pub id: String,
    /// Views that leave it out.
    pub views: usize,
    /// Views that see it.
    pub of_views: usize,
    /// Its pixels in the views that leave it out whose heights agree.
    pub agreeing_pixels: u64,
    /// Its pixels there that have a height to be compared with.
    pub compared_pixels: u64,
}

/// How a large scene was divided.
#[derive(Debug, Clone, Default, Serialize)]
pub struct ChunksReport {
    /// Side of the largest chunk, cells.
    pub side: usize,
    /// Chunks with a surface.
    pub done: usize,
    /// Chunks that no two images see.
    pub unseen: usize,
    /// Chunks that could not be computed; their cells are void.
    pub failed: Vec<FailedChunk>,
}

/// A chunk without a result.
#[derive(Debug, Clone, Serialize)]
pub struct FailedChunk {
    /// x_min, y_min, x_max, y_max in the DSM's CRS.
    pub bounds: [f64; 4],
    /// Why.
    pub reason: String,
}

/// Wall time of one stage.
#[derive(Debug, Clone, Serialize)]
pub struct StageTime {
    /// Its name.
    pub stage: String,
    /// Seconds.
    pub seconds: f64,
}
