//! Cameras as the rasteriser needs them: the pixel of a centre, with the derivatives there.
//!
//! The splat's plane is mapped into the image by a homography that follows from these derivatives.
//! It is exact for pinhole cameras. For satellite images the centre goes through the exact RPC, and
//! the RPC is affine over the few metres of a splat.

/// A centre seen by a camera.
#[derive(Debug, Clone, Copy, PartialEq)]
pub struct LocalView {
    /// Column and row; the centre of the upper-left pixel is (0, 0).
    pub pixel: [f64; 2],
    /// Derivatives of column and row by the local position, pixels per metre.
    pub jacobian: [[f64; 3]; 2],
    /// Depth, metres; smaller is in front. Distance along the optical axis for a perspective
    /// camera, where it is positive.
    pub depth_m: f64,
    /// Derivative of the depth by the local position.
    pub depth_axis: [f64; 3],
}

/// A camera that surfels are drawn through.
pub trait SurfelCamera: Sync {
    /// Whether sizes in the image are inversely proportional to the depth; affine otherwise.
    const PERSPECTIVE: bool;

    /// Columns and rows of the image.
    fn size(&self) -> [usize; 2];

    /// Returns the view of a surfel's centre; `None` where the camera cannot see it.
    fn local(&self, surfel: usize, position: [f64; 3]) -> Option<LocalView>;

    /// Returns where the rays of a perspective camera meet; `None` where they are parallel, along
    /// the depth.
    fn centre(&self) -> Option<[f64; 3]> {
        None
    }

    /// Returns the local position at a depth on the ray of a pixel; `None` where that is not known.
    fn point(&self, pixel: [f64; 2], depth_m: f64) -> Option<[f64; 3]>;
}

/// Depth below which a pinhole camera draws nothing, metres.
const NEAR_M: f64 = 0.1;

/// A pinhole camera in the local frame.
#[derive(Debug, Clone, Copy, PartialEq)]
pub struct PinholeView {
    /// Rows: the camera's axes to the right, down and forward, in the local frame.
    pub rotation: [[f64; 3]; 3],
    /// Position of the camera, metres from the local origin.
    pub centre: [f64; 3],
    /// Focal lengths, pixels.
    pub focal_px: [f64; 2],
    /// Column and row of the principal point; the centre of the upper-left pixel is (0, 0).
    pub principal_px: [f64; 2],
    /// Columns and rows.
    pub size: [usize; 2],
}

impl SurfelCamera for PinholeView {
    const PERSPECTIVE: bool = true;

    fn size(&self) -> [usize; 2] {
        self.size
    }

    fn centre(&self) -> Option<[f64; 3]> {
        Some(self.centre)
    }

    fn local(&self, _: usize, position: [f64; 3]) -> Option<LocalView> {
        let d = [0, 1, 2].map(|i| position[i] - self.centre[i]);
        let [right, down, forward] = self.rotation;
        let along = |axis: [f64; 3]| axis[0] * d[0] + axis[1] * d[1] + axis[2] * d[2];
        let z = along(forward);
        if !(z > NEAR_M && z.is_finite()) {
            return None;
        }
        let slope = [along(right) / z, along(down) / z];
        let row =
            |i: usize, axis: [f64; 3]| [0, 1, 2].map(|k| self.focal_px[i] / z * (axis[k] - slope[i] * forward[k]));
        Some(LocalView {
            pixel: [0, 1].map(|i| self.focal_px[i] * slope[i] + self.principal_px[i]),
            jacobian: [row(0, right), row(1, down)],
            depth_m: z,
            depth_axis: forward,
        })
    }

    fn point(&self, pixel: [f64; 2], depth_m: f64) -> Option<[f64; 3]> {
        let [right, down, forward] = self.rotation;
        let slope = [0, 1].map(|i| (pixel[i] - self.principal_px[i]) / self.focal_px[i]);
        let along = |i: usize| slope[0] * right[i] + slope[1] * down[i] + forward[i];
        Some([0, 1, 2].map(|i| self.centre[i] + depth_m * along(i)))
    }
}

/// The surfels of a scene as a satellite image sees them: each is linearised at an anchor close to
/// its centre.
#[derive(Debug, Clone, PartialEq)]
pub struct AffineView {
    /// Columns and rows.
    pub size: [usize; 2],
    /// Anchor of each surfel, metres from the local origin.
    pub anchors: Vec<[f64; 3]>,
    /// The anchors as the camera sees them; `None` where it does not.
    pub views: Vec<Option<LocalView>>,
}

impl SurfelCamera for AffineView {
    const PERSPECTIVE: bool = false;

    fn size(&self) -> [usize; 2] {
        self.size
    }

    fn local(&self, surfel: usize, position: [f64; 3]) -> Option<LocalView> {
        let (anchor, view) = (self.anchors.get(surfel)?, (*self.views.get(surfel)?)?);
        let d = [0, 1, 2].map(|i| position[i] - anchor[i]);
        let along = |axis: [f64; 3]| axis[0] * d[0] + axis[1] * d[1] + axis[2] * d[2];
        let pixel = [0, 1].map(|i| view.pixel[i] + along(view.jacobian[i]));
        Some(LocalView { pixel, depth_m: view.depth_m + along(view.depth_axis), ..view })
    }

    /// Surfels are linearised one by one, so that there is no ray of the whole image.
    fn point(&self, _: [f64; 2], _: f64) -> Option<[f64; 3]> {
        None
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn the_derivatives_of_a_pinhole_camera_are_those_of_its_projection() {
        let camera = PinholeView {
            rotation: [[0.8, 0.6, 0.0], [0.0, 0.0, -1.0], [-0.6, 0.8, 0.0]],
            centre: [1.0, -2.0, 3.0],
            focal_px: [500.0, 480.0],
            principal_px: [320.0, 240.0],
            size: [640, 480],
        };
        let at = [-3.0, 6.0, 2.0];
        let here = camera.local(0, at).unwrap();
        for axis in 0..3 {
            let moved = |by: f64| {
                let mut p = at;
                p[axis] += by;
                camera.local(0, p).unwrap()
            };
            let (ahead, behind) = (moved(1e-5), moved(-1e-5));
            for i in 0..2 {
                let slope = (ahead.pixel[i] - behind.pixel[i]) / 2e-5;
                assert!((slope - here.jacobian[i][axis]).abs() < 1e-5, "{slope} {here:?}");
            }
            assert!(((ahead.depth_m - behind.depth_m) / 2e-5 - here.depth_axis[axis]).abs() < 1e-6);
        }
        assert_eq!(camera.local(0, [1.0, -2.0, 3.0]), None);
        let back = camera.point(here.pixel, here.depth_m).unwrap();
        assert!((0..3).all(|i| (back[i] - at[i]).abs() < 1e-9), "{back:?}");
    }
}
