//! A centre of projection with its axes.

/// A centre of projection with the axes right, down and forward.
///
/// The ray through the point (x, y) of the image plane at distance 1 has the direction
/// `forward + x · right + y · down`. The position at parameter t lies at depth t along `forward`.
#[derive(Debug, Clone, Copy, PartialEq)]
pub struct Eye {
    /// Position, metres from the local origin.
    pub centre: [f64; 3],
    /// Unit vector in the direction of growing x.
    pub right: [f64; 3],
    /// Unit vector in the direction of growing y.
    pub down: [f64; 3],
    /// Unit vector of the viewing direction.
    pub forward: [f64; 3],
}

/// A point whose visibility is tested: its place in the image plane and its depth.
#[derive(Debug, Clone, Copy, PartialEq)]
pub struct Target {
    /// Coordinate in the image plane at distance 1, along [`Eye::right`].
    pub x: f64,
    /// Coordinate in the image plane at distance 1, along [`Eye::down`].
    pub y: f64,
    /// Depth along [`Eye::forward`], metres. A triangle at a smaller depth hides the point.
    pub depth: f64,
}

impl Eye {
    /// Makes an eye from the rotation of a pinhole camera.
    ///
    /// `rotation` takes directions of the world to the camera, whose axes are right, down and
    /// forward.
    pub fn new(centre: [f64; 3], rotation: [[f64; 3]; 3]) -> Self {
        let [right, down, forward] = rotation;
        Self { centre, right, down, forward }
    }

    /// Returns a position in the frame of the eye.
    #[inline(always)]
    pub fn eye_from_world(&self, position: [f64; 3]) -> [f64; 3] {
        let p = [position[0] - self.centre[0], position[1] - self.centre[1], position[2] - self.centre[2]];
        [self.right, self.down, self.forward].map(|axis| axis[0] * p[0] + axis[1] * p[1] + axis[2] * p[2])
    }

    /// Returns whether all numbers are finite.
    pub(crate) fn is_finite(&self) -> bool {
        [self.centre, self.right, self.down, self.forward].as_flattened().iter().all(|c| c.is_finite())
    }
}
