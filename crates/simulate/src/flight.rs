//! Perspective cameras around a scene, as a drone would fly them, for priors and splats of its
//! buildings.
//!
//! Cameras stand on a circle around the middle of the scene and look at it. Every second one is
//! nearer and steeper. Poses are in the map of the scene: easting, northing, metres above the
//! ellipsoid.

use camera::{Lens, LensError, LensModel, Pose};

use crate::Simulation;

/// Columns and rows of an image.
const SIZE: [usize; 2] = [640, 480];
const FOCAL_PX: f64 = 560.0;
/// Distance from the middle and height above the ground, as shares of the side of the scene.
/// Cameras alternate.
const STANDS: [[f64; 2]; 2] = [[0.75, 0.55], [0.35, 0.75]];

impl Simulation {
    /// Makes `count` cameras with one lens around the scene, counter-clockwise from the east.
    ///
    /// # Errors
    /// None occurs for the lens that is used. The type is the one of [`Lens::new`].
    pub fn flight(&self, count: usize) -> Result<(Lens, Vec<Pose>), LensError> {
        let middle = [0, 1].map(|i| (SIZE[i] as f64 - 1.0) / 2.0);
        let lens = Lens::new(SIZE[0], SIZE[1], LensModel::Pinhole, &[FOCAL_PX, FOCAL_PX, middle[0], middle[1]])?;
        let [east, north] = self.frame.origin_m();
        let target = [east, north, self.scene.terrain().height(0.0, 0.0)];
        let pose = |number: usize| {
            let [distance, height] = STANDS[number % 2].map(|part| part * self.config.size_m);
            let (sin, cos) = (std::f64::consts::TAU * number as f64 / count as f64).sin_cos();
            looking(target, [distance * cos, distance * sin, height])
        };
        Ok((lens, (0..count).map(pose).collect()))
    }
}

/// Makes an upright camera at an offset from its target. The offset must not be vertical.
fn looking(target: [f64; 3], offset: [f64; 3]) -> Pose {
    let length = offset.iter().map(|c| c * c).sum::<f64>().sqrt();
    let forward = offset.map(|c| -c / length);
    let level = forward[0].hypot(forward[1]);
    let right = [forward[1] / level, -forward[0] / level, 0.0];
    let down = [-forward[2] * right[1], forward[2] * right[0], -level];
    Pose { rotation: [right, down, forward], centre: [0, 1, 2].map(|i| target[i] + offset[i]) }
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn a_camera_is_upright_and_looks_at_its_target() {
        for offset in [[30.0, 0.0, 40.0], [-3.0, 7.0, 1.0], [1e-3, 0.0, 9.0]] {
            let target = [690_000.0, 5_336_000.0, 510.0];
            let pose = looking(target, offset);
            let [right, down, forward] = pose.rotation;
            let cross = [0, 1, 2].map(|i| {
                let (j, k) = ((i + 1) % 3, (i + 2) % 3);
                right[j] * down[k] - right[k] * down[j]
            });
            assert!((0..3).all(|i| (cross[i] - forward[i]).abs() < 1e-12), "{offset:?}");
            assert!(down[2] < 0.0 && right[2] == 0.0);
            let [x, y, z] = pose.camera_from_world(target);
            assert!(
                x.abs() < 1e-6 && y.abs() < 1e-6 && (z - offset.iter().map(|c| c * c).sum::<f64>().sqrt()).abs() < 1e-6
            );
        }
    }
}
