//! Surface heights from RPC images by sweeping height hypotheses (the method of SkySplat, arXiv 2508.09479, without
//! its trained network): tie points and pointing → cost volume → semi-global aggregation → soft-argmin →
//! cross-view consistency → fusion on a grid.
//!
//! Nothing here touches a file. Heights are metres above the ellipsoid on an absolute lattice `k · step`, so that a
//! result does not depend on how the work is divided.

pub mod consistency;
pub mod cost;
pub mod fusion;

mod geometry;
pub mod level;
pub mod pointing;
mod prior;
pub mod ranges;
mod readout;
pub mod semiglobal;
mod simd;
mod support;
#[cfg(test)]
mod testing;
pub mod view;
mod volume;

pub use geometry::{TileMap, source_from_reference};
pub use level::{HeightMap, LevelConfig, sweep_level};
pub use prior::Prior;
pub use view::View;
pub use volume::CostVolume;

/// Why a stage could not give a result.
#[derive(Debug, Clone, PartialEq, thiserror::Error)]
#[non_exhaustive]
pub enum SweepError {
    /// The camera model failed inside the scene.
    #[error("the camera model of view {view} fails inside the scene: {source}")]
    Camera {
        /// Which view, by its place in the input.
        view: usize,
        /// What the camera said.
        source: camera::CameraError,
    },
    /// The range of heights is too wide for the memory of one block.
    #[error("a block of the image has more than {limit} height hypotheses; give a narrower --height-range")]
    TooManyHypotheses {
        /// The most that a block may have.
        limit: u32,
    },
    /// The local map between two images could not be brought under its error bound.
    #[error(
        "the map from view {reference} to view {source_view} is off by {error_px:.3} px on the smallest tile; \
         expected at most {bound_px} px: the RPC is not smooth here"
    )]
    NotSmooth {
        /// The reference view.
        reference: usize,
        /// The source view.
        source_view: usize,
        /// The error found, pixels.
        error_px: f64,
        /// The bound, pixels.
        bound_px: f64,
    },
}
