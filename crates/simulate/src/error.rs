//! Errors of the simulation.

use crate::preset_names::PRESETS;

/// A scene that cannot be simulated.
#[derive(Debug, Clone, PartialEq, thiserror::Error)]
#[error(transparent)]
pub struct SimulateError(#[from] pub(crate) Reason);

/// Why a scene cannot be simulated.
#[derive(Debug, Clone, PartialEq, thiserror::Error)]
pub(crate) enum Reason {
    /// A number of the configuration lies outside its range.
    #[error("{name} is {found}, expected {low} to {high}")]
    OutOfRange {
        /// Key of the number.
        name: &'static str,
        /// Its value.
        found: f64,
        /// Smallest permitted value.
        low: f64,
        /// Largest permitted value.
        high: f64,
    },
    /// No preset has this name.
    #[error("no preset is called {found}: {}the presets are {}", meant(found), names())]
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
    /// A pixel does not see the ground.
    #[error("the simulated camera does not see the ground")]
    Camera(#[from] camera::CameraError),
    /// No RPC fits the camera.
    #[error("no RPC could be fitted to the simulated camera")]
    Fit(#[from] camera::FitError),
    /// No map projection is defined at the place of the scene.
    #[error("no map projection is defined at the place of the scene")]
    Geodesy(#[from] crs::CrsError),
}

/// Lets `?` take the errors of other crates in one step.
macro_rules! from_others {
    ($($error:ty),+) => {$(
        impl From<$error> for SimulateError {
            fn from(error: $error) -> Self {
                Self(error.into())
            }
        }
    )+};
}

from_others!(camera::CameraError, camera::FitError, crs::CrsError);

/// Asks for the nearest name, where one is near.
fn meant(found: &str) -> String {
    let nearest = numeric::nearest_name(found, PRESETS.map(|(name, _)| name));
    nearest.map(|name| format!("did you mean {name}? ")).unwrap_or_default()
}

fn names() -> String {
    PRESETS.map(|(name, _)| name).join(", ")
}
