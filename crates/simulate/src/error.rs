//! Why a scene cannot be made.

/// A configuration that makes no scene, or a place where none can be.
#[derive(Debug, Clone, PartialEq, thiserror::Error)]
#[non_exhaustive]
pub enum SimulateError {
    /// A number of the configuration lies outside its range.
    #[error("{name} is {found}, expected {low} to {high}")]
    OutOfRange {
        /// Which number.
        name: &'static str,
        /// Its value.
        found: f64,
        /// Smallest permitted value.
        low: f64,
        /// Largest permitted value.
        high: f64,
    },
    /// A pixel has no line of sight.
    #[error("the simulated camera does not see the ground")]
    Camera(#[from] camera::CameraError),
    /// The scene lies where there is no map.
    #[error("the scene's place cannot be mapped")]
    Geodesy(#[from] geodesy::GeodesyError),
}
