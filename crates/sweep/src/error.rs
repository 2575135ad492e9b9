//! Errors of the stages of the sweep.

/// Reason why a stage has no result.
#[derive(Debug, Clone, PartialEq, thiserror::Error)]
#[non_exhaustive]
pub enum SweepError {
    /// A camera model failed inside the scene.
    #[error("the camera model of view {view} fails inside the scene: {source}")]
    Camera {
        /// Index of the view in the input.
        view: usize,
        /// Error of the camera.
        source: camera::CameraError,
    },
    /// The height range is too wide for the memory of one block.
    #[error("a block of the image has more than {limit} height hypotheses: give a narrower height range")]
    TooManyHypotheses {
        /// Largest number of hypotheses of a block.
        limit: u32,
    },
    /// The height range lies farther from the ellipsoid than any surface.
    #[error(
        "the height range begins {farthest} hypotheses from the ellipsoid, at most {limit} are expected: \
         give a height range on Earth"
    )]
    HeightsTooFar {
        /// Distance from the ellipsoid, hypotheses.
        farthest: u32,
        /// Largest distance allowed, hypotheses.
        limit: u32,
    },
    /// The local map between two images exceeds its error bound even on the smallest tile.
    #[error(
        "the map from view {reference} to view {source_view} is off by {error_px:.3} px on the smallest tile; \
         expected at most {bound_px} px: the RPC is not smooth here"
    )]
    NotSmooth {
        /// Index of the reference view.
        reference: usize,
        /// Index of the source view.
        source_view: usize,
        /// Error of the map, pixels.
        error_px: f64,
        /// Error bound, pixels.
        bound_px: f64,
    },
}
