//! Pairs of views and their tie points.

use camera::{CameraError, ImagePoint};

use crate::geometry::source_column_row;
use crate::view::SweepView;

/// One correspondence, in full-resolution image coordinates.
#[derive(Debug, Clone, Copy, PartialEq)]
pub struct Tie {
    /// Position in the reference image.
    pub reference: ImagePoint,
    /// Position in the source image.
    pub source: ImagePoint,
    /// Correlation of the two patches at full resolution.
    pub correlation: f32,
}

/// Parameters of the tie-point search.
#[derive(Debug, Clone, Copy, PartialEq)]
pub struct TieConfig {
    /// Corners tried per pair of views.
    pub points: usize,
    /// Half width of the patches, pixels of the level.
    pub radius: i32,
    /// Largest pointing error across the trajectory, full-resolution pixels.
    pub band_px: f64,
    /// Least correlation on the coarse level and at full resolution.
    pub correlation: f32,
    /// By how much the best place on the coarse level must beat every other one.
    pub margin: f32,
    /// The coarse level has at least this many pixels on its shorter side.
    pub coarse_side: usize,
}

impl Default for TieConfig {
    /// `radius` 7 is 15 × 15 pixels, the usual compromise of uniqueness against relief. `band_px` covers what
    /// providers state for pointing (CE90 of several metres) several times over.
    fn default() -> Self {
        Self { points: 600, radius: 7, band_px: 24.0, correlation: 0.7, margin: 0.08, coarse_side: 160 }
    }
}

/// Two views, and the levels on which they are matched.
pub(crate) struct Pair<'a> {
    pub(crate) reference: &'a SweepView,
    pub(crate) source: &'a SweepView,
}

impl Pair<'_> {
    pub(crate) fn chain(&self, at: [f64; 2], level: usize, height_m: f64) -> Result<[f64; 2], CameraError> {
        source_column_row(&self.reference.camera, &self.source.camera, level as u32, at, height_m)
    }
}
