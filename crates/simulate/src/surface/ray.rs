//! Lines of sight in the scene frame.

use nalgebra::Vector3;

/// A half-line `origin + t · direction` with t ≥ 0, in the scene frame, metres. The direction may
/// have any length.
#[derive(Debug, Clone, Copy, PartialEq)]
pub struct SceneRay {
    /// Start.
    pub origin: Vector3<f64>,
    /// Direction: the displacement per unit of t.
    pub direction: Vector3<f64>,
}

impl SceneRay {
    /// Returns the point at a parameter.
    pub fn at(&self, t: f64) -> Vector3<f64> {
        self.origin + self.direction * t
    }
}
