//! The errors of the stages of a reconstruction.

use crs::CrsError;
use numeric::{Kind, failures};
use sweep::SweepError;

use crate::values::{CELLS_MAX, HeightRange};

/// Reason why views give no heights or no surface.
#[derive(Debug, Clone, PartialEq, thiserror::Error)]
#[non_exhaustive]
pub enum ReconstructError {
    /// There are fewer than two views.
    #[error("found {found} image(s), expected at least 2: heights come from the parallax between views")]
    TooFewViews {
        /// Number of views given.
        found: usize,
    },
    /// The height range is none of the Earth's surface.
    #[error(
        "the height range is {} {}, expected two heights of the Earth's surface in metres above the ellipsoid, the \
         lower first", range.low_m, range.high_m
    )]
    Range {
        /// Range that was given.
        range: HeightRange,
    },
    /// A camera has no ground under its image.
    #[error("the RPC of view {view} has no ground under the image; is it the RPC of this image? {source}")]
    Camera {
        /// Position of the view, counted from 0.
        view: usize,
        /// Failure of the camera model.
        source: camera::CameraError,
    },
    /// No two images share ground.
    #[error(
        "the images share no ground (largest overlap {share_percent:.1} % of an image); \
         check that the RPCs belong to the images"
    )]
    NoOverlap {
        /// Largest overlap found, percent of the smaller footprint.
        share_percent: f64,
    },
    /// No two overlapping images look from different directions.
    #[error(
        "no parallax: the overlapping images look along the same line \
         (largest angle {angle_deg:.2}°, needed {needed_deg}°); add an image from another direction"
    )]
    NoParallax {
        /// Largest intersection angle found, degrees.
        angle_deg: f64,
        /// Least angle that gives heights, degrees.
        needed_deg: f64,
    },
    /// A grid has no cells, or more than a surface can have.
    #[error(
        "the bounds and the cell size give a grid of {columns:.0} × {rows:.0} cells of {} × {} map units, expected 1 to \
         {CELLS_MAX:.0} cells; bounds are x_min y_min x_max y_max in the CRS of the grid",
        cell.0, cell.1
    )]
    Cells {
        /// Columns.
        columns: f64,
        /// Rows.
        rows: f64,
        /// Width and height of a cell, units of the map.
        cell: (f64, f64),
    },
    /// The coordinate reference system of the grid cannot be used.
    #[error("cannot use the coordinate reference system")]
    Crs(#[from] CrsError),
    /// The height sweep failed.
    #[error("the height sweep failed")]
    Sweep(#[from] SweepError),
    /// The caller asked to stop.
    #[error("the run was cancelled")]
    Cancelled,
}

failures!(ReconstructError: Other {
    Self::TooFewViews { .. } | Self::Range { .. } | Self::Cells { .. } => Kind::Input,
    Self::Crs(error) => error.kind(),
    Self::Cancelled => Kind::Cancelled,
});

impl From<numeric::Cancelled> for ReconstructError {
    fn from(_: numeric::Cancelled) -> Self {
        Self::Cancelled
    }
}
