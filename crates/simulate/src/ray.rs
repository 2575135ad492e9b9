//! Lines of sight in the scene frame.

use nalgebra::Vector3;

/// A half-line `origin + t · direction`, t ≥ 0, in the scene frame (metres); the direction need not be of unit length.
#[derive(Debug, Clone, Copy, PartialEq)]
pub struct SceneRay {
    /// Where it starts.
    pub origin: Vector3<f64>,
    /// Where it goes per unit of t.
    pub direction: Vector3<f64>,
}

impl SceneRay {
    /// The point at a parameter.
    pub fn at(&self, t: f64) -> Vector3<f64> {
        self.origin + self.direction * t
    }
}
