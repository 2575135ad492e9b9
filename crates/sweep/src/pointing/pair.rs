//! Pairs of views, their tie points, and the parameters of the search.

use camera::{CameraError, ImagePoint};

use crate::geometry::source_column_row;
use crate::view::SweepView;

/// A tie point: one ground point seen in two images, in full-resolution pixels.
#[derive(Debug, Clone, Copy, PartialEq)]
pub struct Tie {
    /// Position in the reference image.
    pub reference: ImagePoint,
    /// Position in the source image.
    pub source: ImagePoint,
    /// Correlation of the two patches at full resolution, −1 to 1.
    pub correlation: f32,
}

/// Parameters of the tie-point search.
#[derive(Debug, Clone, Copy, PartialEq)]
pub struct TieConfig {
    /// Number of corners tried per pair of views.
    pub points: usize,
    /// Half width of the patches, pixels of the level.
    pub radius: i32,
    /// Largest pointing error across the height trajectory, full-resolution pixels.
    pub band_px: f64,
    /// Least correlation on the coarse level and at full resolution.
    pub correlation: f32,
    /// Smallest lead in correlation of the best place on the coarse level over every other one.
    pub margin: f32,
    /// Smallest number of pixels on the shorter side of the coarse level.
    pub coarse_side: usize,
}

impl Default for TieConfig {
    /// Returns the usual parameters. A radius of 7 gives 15 × 15 pixels, the usual compromise
    /// between uniqueness and relief. `band_px` is several times the pointing error that providers
    /// state (a CE90 of several metres).
    fn default() -> Self {
        Self { points: 600, radius: 7, band_px: 24.0, correlation: 0.7, margin: 0.08, coarse_side: 160 }
    }
}

/// Two views that are matched.
pub(crate) struct Pair<'a> {
    pub(crate) reference: &'a SweepView,
    pub(crate) source: &'a SweepView,
}

impl Pair<'_> {
    /// Projects a reference position on a level, at a height, into the source.
    pub(crate) fn chain(&self, at: [f64; 2], level: usize, height_m: f64) -> Result<[f64; 2], CameraError> {
        source_column_row(&self.reference.camera, &self.source.camera, level as u32, at, height_m)
    }
}
