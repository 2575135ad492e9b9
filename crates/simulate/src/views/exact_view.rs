//! What a perspective camera anywhere in a scene sees exactly: the depth and the part of the scene
//! of each pixel, by a ray through its centre.
//!
//! The scene is the permanent one, without vehicles. Cameras stand on the map of the scene.

use camera::{ImagePoint, Lens, Pose};
use nalgebra::Vector3;
use raster::Grid;
use rayon::prelude::*;

use crate::surface::scene::{Hit, Material, Part, Scene};
use crate::{SceneRay, Simulation};

/// Depth at which rays end, metres: beyond every scene.
const FAR_M: f64 = 1e5;
/// Vertical component of the normal below which a face of a building is a wall.
const WALL_NORMAL: f64 = 0.5;

/// What the pixels of a camera show.
#[derive(Debug, Clone, PartialEq)]
pub struct ExactView {
    /// Depths along the optical axis, metres; NaN where the scene is not met.
    pub depth_m: Grid<f32>,
    /// [`ExactPart`] of each pixel, as its number.
    pub part: Grid<u8>,
}

/// A part of a scene.
#[derive(Debug, Clone, Copy, PartialEq, Eq)]
#[repr(u8)]
#[non_exhaustive]
pub enum ExactPart {
    /// Nothing: the ray rises and leaves the scene.
    Sky = 0,
    /// The ground.
    Ground = 1,
    /// A roof.
    Roof = 2,
    /// A wall of a building.
    Wall = 3,
    /// A tree.
    Tree = 4,
    /// Nothing: the ray falls and leaves the scene, or the lens has no ray.
    Beyond = 5,
}

impl Simulation {
    /// Returns what the pixels of a camera show.
    pub fn exact_view(&self, lens: &Lens, pose: &Pose) -> ExactView {
        let (width, height) = (lens.width(), lens.height());
        let [east, north] = self.frame.origin_m();
        let [x, y, z] = pose.centre;
        let origin = Vector3::new(x - east, y - north, z);
        let [right, down, forward] = pose.rotation.map(Vector3::from);
        let pixel = |k: usize| {
            let at = ImagePoint::new((k % width) as f64, (k / width) as f64);
            let Some([u, v]) = lens.direction(at) else { return (f32::NAN, ExactPart::Beyond) };
            let direction = right * u + down * v + forward;
            match self.scene.first_hit(&SceneRay { origin, direction }, FAR_M) {
                Some(hit) => ((hit.point - origin).dot(&forward) as f32, part_of(&self.scene, &hit)),
                None => (f32::NAN, if direction.z >= 0.0 { ExactPart::Sky } else { ExactPart::Beyond }),
            }
        };
        let pixels: Vec<(f32, ExactPart)> = (0..width * height).into_par_iter().map(pixel).collect();
        let mut view =
            ExactView { depth_m: Grid::filled(width, height, f32::NAN), part: Grid::filled(width, height, 0) };
        for (k, (depth, part)) in pixels.into_iter().enumerate() {
            (view.depth_m.data_mut()[k], view.part.data_mut()[k]) = (depth, part as u8);
        }
        view
    }
}

fn part_of(scene: &Scene, hit: &Hit) -> ExactPart {
    let index = match hit.part {
        Part::Ground => return ExactPart::Ground,
        Part::Crown(_) => return ExactPart::Tree,
        Part::Prism(index, _) => index,
    };
    match scene.solid(index).material {
        Material::Tree => ExactPart::Tree,
        _ if hit.normal.z.abs() < WALL_NORMAL => ExactPart::Wall,
        _ => ExactPart::Roof,
    }
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::SimulationConfig;
    use camera::LensModel;

    #[test]
    fn a_camera_in_the_street_sees_the_surface_where_it_is() {
        let mut config = SimulationConfig::preset("town").unwrap();
        (config.size_m, config.gsd_m, config.views) = (60.0, 2.0, 2);
        let simulation = Simulation::new(config).unwrap();
        let [east, north] = simulation.frame.origin_m();
        let lens = Lens::new(64, 48, LensModel::Pinhole, &[32.0, 32.0, 31.5, 23.5]).unwrap();
        let rotation = [[0.8, 0.6, 0.0], [0.0, 0.0, -1.0], [-0.6, 0.8, 0.0]];
        let ground = simulation.scene.terrain().height(0.0, 0.0);
        let pose = Pose { rotation, centre: [east, north, ground + 30.0] };
        let view = simulation.exact_view(&lens, &pose);
        let count = |part: ExactPart| view.part.data().iter().filter(|p| **p == part as u8).count();
        assert!(count(ExactPart::Sky) > 64 && count(ExactPart::Ground) > 200, "{:?}", view.part.data());
        assert!(count(ExactPart::Wall) > 0 && count(ExactPart::Roof) > 0);
        for row in 0..48 {
            for column in 0..64 {
                let depth = f64::from(view.depth_m[(column, row)]);
                if view.part[(column, row)] != ExactPart::Ground as u8 {
                    continue;
                }
                let at = [(column as f64 - 31.5) / 32.0, (row as f64 - 23.5) / 32.0, 1.0];
                let by = |axis: usize| (0..3).map(|k| depth * at[k] * rotation[k][axis]).sum::<f64>();
                let height = simulation.scene.terrain().height(by(0), by(1));
                assert!((ground + 30.0 + by(2) - height).abs() < 0.01 + 1e-3 * depth, "{column} {row}");
            }
        }
    }
}
