//! Why a scene cannot be made.

use crate::preset_names::PRESETS;

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
    /// No preset has this name.
    #[error("no preset is called {found}: the presets are {}", names())]
    UnknownPreset {
        /// The name.
        found: String,
    },
    /// A parameter file that cannot be read.
    #[error("the parameters cannot be read: {text}")]
    Parameters {
        /// What is wrong, and where.
        text: String,
    },
    /// A pixel has no line of sight.
    #[error("the simulated camera does not see the ground")]
    Camera(#[from] camera::CameraError),
    /// The camera has no RPC.
    #[error("the simulated camera cannot be written as an RPC")]
    Fit(#[from] camera::FitError),
    /// The scene lies where there is no map.
    #[error("the scene's place cannot be mapped")]
    Geodesy(#[from] crs::CrsError),
}

fn names() -> String {
    PRESETS.map(|(name, _)| name).join(", ")
}
