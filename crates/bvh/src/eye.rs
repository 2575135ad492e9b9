//! A centre of projection with its axes: where a bundle of rays starts and how their directions are counted.

/// A centre that rays leave, with a frame: right, down, forward.
///
/// The ray of a point (x, y) of the image plane at distance 1 has the direction `forward + x · right + y · down`, and the
/// position on it at t is at depth t along `forward`.
#[derive(Debug, Clone, Copy, PartialEq)]
pub struct Eye {
    /// Position, metres from the local origin.
    pub centre: [f64; 3],
    /// Unit vector along which x grows.
    pub right: [f64; 3],
    /// Unit vector along which y grows.
    pub down: [f64; 3],
    /// Unit vector of the viewing direction.
    pub forward: [f64; 3],
}

/// A point to look at: where it is in the image plane, and how far a ray to it may go.
#[derive(Debug, Clone, Copy, PartialEq)]
pub struct Target {
    /// Coordinate in the image plane at distance 1, along [`Eye::right`].
    pub x: f64,
    /// Coordinate in the image plane at distance 1, along [`Eye::down`].
    pub y: f64,
    /// Depth along [`Eye::forward`] in metres before which the ray must meet nothing.
    pub depth: f64,
}

impl Eye {
    /// An eye from the rotation of a pinhole camera: `rotation` takes directions of the world to the camera, whose axes
    /// are right, down, forward.
    pub fn new(centre: [f64; 3], rotation: [[f64; 3]; 3]) -> Self {
        let [right, down, forward] = rotation;
        Self { centre, right, down, forward }
    }

    /// A position in the frame of the eye.
    #[inline(always)]
    pub fn eye_from_world(&self, position: [f64; 3]) -> [f64; 3] {
        let p = [position[0] - self.centre[0], position[1] - self.centre[1], position[2] - self.centre[2]];
        [self.right, self.down, self.forward].map(|axis| axis[0] * p[0] + axis[1] * p[1] + axis[2] * p[2])
    }

    /// Whether all numbers are finite.
    pub(crate) fn is_finite(&self) -> bool {
        [self.centre, self.right, self.down, self.forward].as_flattened().iter().all(|c| c.is_finite())
    }
}
