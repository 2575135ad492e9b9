//! The lines of sight of an image's pixels in the scene frame.
//!
//! The ray of a pixel runs through its positions at two heights, above and below the whole scene.
//! On the map it is straight to 2 mm over 300 m of height. The deviation comes from the curvature
//! of the Earth and falls with the square of the height. Positions are computed on a lattice of
//! pixels and interpolated: over 16 pixels the camera and the map projection deviate from linear by
//! micrometres.

use camera::ImagePoint;
use nalgebra::{Vector2, Vector3};

use crate::surface::frame::SceneFrame;
use crate::views::camera_model::PhysicalCamera;
use crate::{SceneRay, SimulateError};

/// Distance between lattice nodes, pixels.
const STEP_PX: f64 = 16.0;

/// The rays of all positions of an image.
#[derive(Debug, Clone)]
pub struct SightLines {
    columns: usize,
    rows: usize,
    high_m: f64,
    low_m: f64,
    /// Positions at the two heights for every node.
    nodes: Vec<[Vector2<f64>; 2]>,
}

impl SightLines {
    /// Makes the rays of an image of `width × height` pixels between two heights (low, high),
    /// metres above the ellipsoid.
    ///
    /// # Errors
    /// A position outside the map.
    pub(crate) fn new(
        camera: &PhysicalCamera,
        frame: &SceneFrame,
        (width, height): (usize, usize),
        (low_m, high_m): (f64, f64),
    ) -> Result<Self, SimulateError> {
        // Sub-pixel positions reach beyond the centre of the last pixel, which needs one more node.
        let count = |pixels: usize| (pixels as f64 / STEP_PX).ceil() as usize + 2;
        let (columns, rows) = (count(width), count(height));
        let node = |index: usize| {
            let at =
                ImagePoint::new(((index % columns) as f64 - 0.5) * STEP_PX, ((index / columns) as f64 - 0.5) * STEP_PX);
            let position = |height_m| -> Result<_, SimulateError> {
                Ok(frame.scene_from_ground(camera.localize(at, height_m))?.xy())
            };
            Ok([position(high_m)?, position(low_m)?])
        };
        let nodes = (0..columns * rows).map(node).collect::<Result<_, SimulateError>>()?;
        Ok(Self { columns, rows, high_m, low_m, nodes })
    }

    /// Returns the ray of an image position. It starts at the upper height (t = 0) and reaches the
    /// lower one at t = 1.
    pub fn ray(&self, at: ImagePoint) -> SceneRay {
        let (column, s) = cell(at.sample, self.columns);
        let (row, t) = cell(at.line, self.rows);
        let node = |level: usize| {
            let at = |c: usize, r: usize| self.nodes[r * self.columns + c][level];
            let upper = at(column, row).lerp(&at(column + 1, row), s);
            let lower = at(column, row + 1).lerp(&at(column + 1, row + 1), s);
            upper.lerp(&lower, t)
        };
        let (high, low) = (node(0), node(1));
        let origin = Vector3::new(high.x, high.y, self.high_m);
        SceneRay { origin, direction: Vector3::new(low.x, low.y, self.low_m) - origin }
    }
}

/// Returns the lattice cell of a coordinate and the position in it. Beyond the lattice the
/// outermost cell is continued.
fn cell(coordinate: f64, nodes: usize) -> (usize, f64) {
    let u = coordinate / STEP_PX + 0.5;
    let index = (u.floor().max(0.0) as usize).min(nodes - 2);
    (index, u - index as f64)
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::config::CameraModel;
    use crate::views::camera_model::Look;

    #[test]
    fn rays_pass_through_what_the_camera_sees_and_the_rpc_localises() {
        for camera in [CameraModel::Pushbroom, CameraModel::Frame] {
            let frame = SceneFrame::new(5.4, 43.5, 0.5).unwrap();
            let look = Look { incidence_deg: 24.0, azimuth_deg: 300.0, heading_deg: 190.0, gsd_m: 0.5 };
            let centre = frame.ground_from_scene(Vector3::new(0.0, 0.0, 200.0)).unwrap();
            let camera = PhysicalCamera::new(camera, &look, centre, (900, 700));
            let sight = SightLines::new(&camera, &frame, (900, 700), (190.0, 490.0)).unwrap();
            let rpc = camera.fitted((140.0, 540.0)).unwrap().rpc;
            for (sample, line) in [(-0.5, -0.5), (899.5, 699.5), (7.3, 692.1), (451.9, 350.2), (888.8, 3.0)] {
                let at = ImagePoint::new(sample, line);
                let ray = sight.ray(at);
                for height_m in [190.0, 240.0, 340.0, 490.0] {
                    let p = ray.at((height_m - ray.origin.z) / ray.direction.z);
                    let exact = frame.scene_from_ground(camera.localize(at, height_m)).unwrap();
                    assert!((p - exact).norm() < 2e-3, "{:?}", p - exact);
                    let by_rpc = frame.scene_from_ground(rpc.localize(at, height_m).unwrap()).unwrap();
                    assert!((p - by_rpc).norm() < 3e-3, "{:?}", p - by_rpc);
                }
            }
        }
    }
}
