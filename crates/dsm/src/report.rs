//! The report of a run.

use std::path::PathBuf;

use camera::{ImageCorrection, ImagePoint};
use formats::stac::SunPosition;
use numeric::Choice;
use reconstruct::{CellCounts, HeightRange, MapBounds, PairGeometry};
use serde::{Deserialize, Serialize};
use sweep::pointing::{Adjustment, ModelOrder};

use crate::adapters::null_is_nan;

/// The report of a DSM run, written as JSON.
#[derive(Debug, Clone, PartialEq, Serialize, Deserialize)]
#[non_exhaustive]
pub struct DsmReport {
    /// Version of the program.
    pub version: String,
    /// Identity of the plan whose chunks were merged; absent for a run without a plan.
    #[serde(default, skip_serializing_if = "Option::is_none")]
    pub plan: Option<String>,
    /// Images in the order of the configuration.
    pub images: Vec<ImageReport>,
    /// Pairs that were matched.
    pub pairs: Vec<PairReport>,
    /// Correction of the pointing.
    pub pointing: PointingReport,
    /// Heights searched, metres above the ellipsoid.
    pub height_range_m: HeightRange,
    /// Number of pixel-hypothesis pairs evaluated.
    pub hypotheses: u64,
    /// Cells of the DSM.
    pub surface: SurfaceReport,
    /// Division of the scene into chunks; absent when it was computed at once.
    #[serde(skip_serializing_if = "Option::is_none")]
    pub chunks: Option<ChunksReport>,
    /// Use of the city model; absent without one.
    #[serde(skip_serializing_if = "Option::is_none")]
    pub prior: Option<PriorReport>,
    /// All choices with their reasons.
    pub choices: Vec<Choice>,
    /// Warnings.
    pub warnings: Vec<String>,
    /// Wall times of the stages.
    pub stages: Vec<StageTime>,
    /// Largest resident memory, megabytes; absent where the system does not report it.
    pub peak_memory_mb: Option<f64>,
}

/// An image in the report.
#[derive(Debug, Clone, PartialEq, Serialize, Deserialize)]
#[non_exhaustive]
pub struct ImageReport {
    /// File of the image.
    pub path: PathBuf,
    /// Format in which the RPC was found.
    pub rpc: String,
    /// Columns and rows.
    pub size: (usize, usize),
    /// When the image was taken, in the form of ISO 8601; `None` where the file does not say.
    #[serde(default, skip_serializing_if = "Option::is_none")]
    pub acquired: Option<String>,
    /// Name of the satellite; absent where neither the file nor its STAC item says.
    #[serde(default, skip_serializing_if = "Option::is_none")]
    pub satellite: Option<String>,
    /// Where the sun stood; absent where neither the file nor its STAC item says.
    #[serde(default, skip_serializing_if = "Option::is_none")]
    pub sun: Option<SunPosition>,
    /// Side of a pixel on the ground at the centre of the scene, metres.
    pub gsd_m: Option<f64>,
    /// Angle of the line of sight to the vertical, degrees.
    pub incidence_deg: Option<f64>,
    /// Correction found, in the frame of the part that was read.
    pub correction: Option<ImageCorrection>,
    /// Correction applied, in the frame of the whole image.
    pub applied_correction: ImageCorrection,
}

/// A pair of images in the report.
#[derive(Debug, Clone, PartialEq, Serialize, Deserialize)]
#[non_exhaustive]
pub struct PairReport {
    /// Positions of the images, counted from 1.
    pub images: (usize, usize),
    /// Angle, overlap and parallax.
    #[serde(flatten)]
    pub geometry: PairGeometry,
    /// Number of tie points found.
    pub ties: usize,
}

/// The correction of the pointing.
#[derive(Debug, Clone, PartialEq, Serialize, Deserialize)]
#[non_exhaustive]
pub struct PointingReport {
    /// Whether it was applied.
    pub applied: bool,
    /// Kind of the correction.
    pub order: CorrectionOrder,
    /// Number of ground points seen in two or more images.
    pub tracks: usize,
    /// Number of tracks that are no outliers.
    pub inliers: usize,
    /// Number of tie points that contradict better ones and were left out.
    pub contradictory_ties: usize,
    /// Robust standard deviation of the residuals before the correction, pixels.
    #[serde(with = "null_is_nan")]
    pub residual_before_px: f64,
    /// Robust standard deviation of the residuals after the correction, pixels.
    #[serde(with = "null_is_nan")]
    pub residual_after_px: f64,
    /// Root mean square of the inliers' residuals after the correction, pixels.
    #[serde(with = "null_is_nan")]
    pub rms_px: f64,
    /// What the tie points show of each image, in the order of the configuration.
    pub images: Vec<ImagePointing>,
    /// Control points and check points; absent without them.
    #[serde(default, skip_serializing_if = "Option::is_none")]
    pub control: Option<ControlReport>,
    /// Co-registration to a reference; absent without one.
    #[serde(default, skip_serializing_if = "Option::is_none")]
    pub reference: Option<ReferenceReport>,
}

/// How the scene was moved onto a reference elevation model. The corrections that were applied to
/// the images hold it.
#[derive(Debug, Clone, PartialEq, Serialize, Deserialize)]
#[non_exhaustive]
pub struct ReferenceReport {
    /// The reference.
    pub path: PathBuf,
    /// Shift east, north and up that the surface was given, metres.
    pub shift_m: [f64; 3],
    /// Standard errors of the shift, metres, from the shifts that the parts of the scene find.
    #[serde(default)]
    pub deviation_m: [f64; 3],
    /// Tilt that the heights were given, metres per kilometre east and north; `None` unless asked
    /// for.
    pub plane_m_per_km: Option<[f64; 2]>,
    /// Number of cells of the trial surface that were compared.
    pub cells: usize,
    /// NMAD of the differences before the shift, metres.
    #[serde(with = "null_is_nan")]
    pub nmad_before_m: f64,
    /// NMAD of the differences after the shift, metres.
    #[serde(with = "null_is_nan")]
    pub nmad_after_m: f64,
    /// NMAD that a typical shift leaves, divided by that of the best one: near 1 there is no relief
    /// that both surfaces share.
    #[serde(default = "no_contrast")]
    pub contrast: f64,
    /// Length of the last shift, metres, which tells how well the first one was
    /// followed.
    pub last_shift_m: f64,
}

fn no_contrast() -> f64 {
    1.0
}

/// What became of the search for the chip of a ground point in an image.
#[derive(Debug, Clone, PartialEq, Serialize, Deserialize)]
#[non_exhaustive]
pub struct ChipReport {
    /// Name of the point.
    pub name: String,
    /// Name of the image's file.
    pub image: String,
    /// Place at which it was found.
    pub place: Option<ImagePoint>,
    /// Correlation there.
    pub score: Option<f64>,
    /// Why it was not found.
    pub reason: Option<String>,
}

/// What ground points with known positions show of the pointing.
#[derive(Debug, Clone, PartialEq, Serialize, Deserialize)]
#[non_exhaustive]
pub struct ControlReport {
    /// Points that were given for the adjustment.
    pub control: Vec<ControlPointReport>,
    /// Points that only measure.
    pub checks: Vec<CheckPointReport>,
    /// Searches for image chips.
    pub chips: Vec<ChipReport>,
    /// Number of check points that fewer than two images show.
    pub unmeasured: usize,
    /// Horizontal error that nine of ten check points do not exceed, metres; `None` without check
    /// points.
    pub ce90_m: Option<f64>,
    /// Vertical error that nine of ten check points do not exceed, metres; `None` without check
    /// points.
    pub le90_m: Option<f64>,
}

/// A control point after the adjustment.
#[derive(Debug, Clone, PartialEq, Serialize, Deserialize)]
#[non_exhaustive]
pub struct ControlPointReport {
    /// Name of the point.
    pub name: String,
    /// Whether it took part in the adjustment.
    #[serde(default = "is_used")]
    pub used: bool,
    /// Root mean square residual, in standard deviations of its position and places; NaN when no
    /// camera sees it.
    #[serde(with = "null_is_nan")]
    pub residual: f64,
    /// Name of the image in which the point is furthest from its place.
    #[serde(default)]
    pub image: String,
    /// Its place in that image minus where the corrected camera sees its position, along samples
    /// and lines, pixels; `None` when no camera sees it.
    #[serde(default)]
    pub off_px: Option<[f64; 2]>,
    /// Height at which the corrected cameras see its places, minus its height, metres; `None` for a
    /// point with a place in one image.
    #[serde(default)]
    pub off_height_m: Option<f64>,
    /// Why it did not take part.
    #[serde(default, skip_serializing_if = "Option::is_none")]
    pub reason: Option<String>,
}

fn is_used() -> bool {
    true
}

/// A check point after the adjustment.
#[derive(Debug, Clone, PartialEq, Serialize, Deserialize)]
#[non_exhaustive]
pub struct CheckPointReport {
    /// Name of the point.
    pub name: String,
    /// Found position minus known position east, north and up, metres.
    pub error_m: [f64; 3],
}

/// What the tie points show of the pointing of an image.
#[derive(Debug, Clone, PartialEq, Serialize, Deserialize)]
#[non_exhaustive]
pub struct ImagePointing {
    /// File of the image.
    pub path: PathBuf,
    /// Number of ground points that were found in this image and in others.
    pub tracks: usize,
    /// Number of them that are no outliers.
    pub inliers: usize,
    /// Share of the ground shared with other images that has inliers nearby, 0 to 1; NaN when no
    /// ground is known to be shared.
    #[serde(with = "null_is_nan")]
    pub covered: f64,
    /// Robust standard deviation of the residuals in this image after the correction, outliers
    /// included, pixels; NaN without tracks.
    #[serde(with = "null_is_nan")]
    pub residual_px: f64,
    /// Inliers, evenly chosen where there are many: sample, line, and residual along both after the
    /// correction, pixels.
    #[serde(default)]
    pub tie_residuals_px: Vec<[f64; 4]>,
}

/// The kind of a correction of the pointing.
#[derive(Debug, Clone, Copy, PartialEq, Eq, Serialize, Deserialize)]
#[serde(rename_all = "lowercase")]
pub enum CorrectionOrder {
    /// The RPCs are used as they are.
    None,
    /// One shift per image.
    Translation,
    /// One shift per image that grows with the line.
    Drift,
    /// One affine map per image.
    Affine,
}

impl From<ModelOrder> for CorrectionOrder {
    fn from(order: ModelOrder) -> Self {
        match order {
            ModelOrder::None => Self::None,
            ModelOrder::Translation => Self::Translation,
            ModelOrder::Drift => Self::Drift,
            ModelOrder::Affine => Self::Affine,
        }
    }
}

impl PointingReport {
    pub(crate) fn new(
        found: &Adjustment,
        (tracks, contradictory_ties): (usize, usize),
        applied: bool,
        images: Vec<ImagePointing>,
    ) -> Self {
        Self {
            applied,
            order: found.order.into(),
            tracks,
            inliers: found.ground.iter().flatten().count(),
            contradictory_ties,
            residual_before_px: found.residual_px.0,
            residual_after_px: found.residual_px.1,
            rms_px: found.rms_px,
            images,
            control: None,
            reference: None,
        }
    }
}

/// The cells of a DSM.
#[derive(Debug, Clone, PartialEq, Serialize, Deserialize)]
#[non_exhaustive]
pub struct SurfaceReport {
    /// Number of cells.
    pub cells: usize,
    /// Counts of them by what is known of their heights.
    #[serde(flatten)]
    pub counts: CellCounts,
    /// Error below which a height counts as right, metres: in `expected_right` and in
    /// `confidence.tif`.
    pub right_within_m: f64,
    /// Share of each view's pixels with which another view agrees.
    pub kept_by_view: Vec<f64>,
    /// The same for each image in the order of the configuration; `None` for one that is no view.
    #[serde(default)]
    pub kept_by_image: Vec<Option<f64>>,
}

/// A city model compared with the heights that a coarser level found.
#[derive(Debug, Clone, PartialEq, Serialize, Deserialize)]
#[non_exhaustive]
pub struct PriorReport {
    /// File of the model.
    pub model: PathBuf,
    /// Number of buildings that at least one view sees.
    pub buildings_seen: usize,
    /// Number of views that see the model, agree with hardly any of it, and do without it. A view
    /// counts once per chunk.
    pub disagreeing_views: usize,
    /// Largest difference of heights that agree, metres.
    pub tolerance_m: f64,
    /// Buildings that some view leaves out.
    pub left_out: Vec<LeftOut>,
}

/// A building that is not where the model places it.
#[derive(Debug, Clone, PartialEq, Serialize, Deserialize)]
#[non_exhaustive]
pub struct LeftOut {
    /// Identifier in the model.
    pub id: String,
    /// Number of views that leave it out.
    pub views: usize,
    /// Number of views that see it.
    pub of_views: usize,
    /// Pixels with agreeing heights, in the views that leave it out.
    pub agreeing_pixels: u64,
    /// Pixels with a height to compare with, in the views that leave it out.
    pub compared_pixels: u64,
}

/// The division of a large scene into chunks.
#[derive(Debug, Clone, Default, PartialEq, Serialize, Deserialize)]
#[non_exhaustive]
pub struct ChunksReport {
    /// Side of the largest chunk, cells.
    pub side: usize,
    /// Number of chunks with a surface.
    pub done: usize,
    /// Number of chunks that no two images see.
    pub unseen: usize,
    /// Chunks that could not be computed; their cells are void.
    pub failed: Vec<FailedChunk>,
}

/// A chunk without a result.
#[derive(Debug, Clone, PartialEq, Serialize, Deserialize)]
#[non_exhaustive]
pub struct FailedChunk {
    /// Area of the chunk in the CRS of the DSM.
    pub bounds: MapBounds,
    /// Cause.
    pub reason: String,
}

/// The wall time of one stage.
#[derive(Debug, Clone, PartialEq, Serialize, Deserialize)]
#[non_exhaustive]
pub struct StageTime {
    /// Name of the stage.
    pub stage: String,
    /// Wall time, seconds.
    pub seconds: f64,
}
