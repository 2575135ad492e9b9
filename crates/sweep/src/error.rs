//! Why a stage of the sweep could not give a result.

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
    /// Heights that no surface has.
    #[error(
        "the height range begins {farthest} hypotheses from the ellipsoid, at most {limit} are expected; give a --height-range on Earth"
    )]
    HeightsTooFar {
        /// How far, in hypotheses.
        farthest: u32,
        /// The most that it may be.
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
