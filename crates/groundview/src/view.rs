//! Depths, normals and kinds of the pixels of a camera on the ground, and the cells of a height
//! field that it sees.
//!
//! The depth of a perspective camera is along its z axis, that of a panorama along the ray. Normals
//! are in the axes of the map and turned to the camera. A pixel that meets nothing is sky where its
//! ray rises, and beyond the surface where it falls.

use bvh::Ray;
use camera::{ImagePoint, Lens, Pose};
use raster::Grid;
use rayon::prelude::*;

use super::{Ground, HeightField, Panorama};

/// The pixel shows the surface.
pub const GROUND: u8 = 0;
/// The pixel's ray rises and meets nothing.
pub const SKY: u8 = 1;
/// The pixel's ray falls beyond the surface, or the lens has no ray for it.
pub const BEYOND: u8 = 2;

/// A cell is seen if its ray meets nothing before this height above the cell, metres: its own
/// triangles end in it.
const ABOVE_CELL_M: f64 = 0.02;

/// Pixels of a camera and their rays.
#[derive(Debug, Clone, Copy)]
pub enum Viewer<'a> {
    /// A perspective camera.
    Perspective(&'a Lens),
    /// A 360° panorama.
    Panorama(Panorama),
}

/// What a camera sees.
#[derive(Debug, Clone)]
pub struct GroundView {
    /// Depths, metres; NaN where the surface is not met.
    pub depth_m: Grid<f32>,
    /// Unit normals (east, north, up of the map), zero where the surface is not met.
    pub normal: Grid<[f32; 3]>,
    /// [`GROUND`], [`SKY`] or [`BEYOND`].
    pub kind: Grid<u8>,
}

impl Viewer<'_> {
    /// Returns columns and rows.
    pub fn size(&self) -> (usize, usize) {
        match self {
            Self::Perspective(lens) => (lens.width(), lens.height()),
            Self::Panorama(panorama) => (panorama.width, panorama.height),
        }
    }

    /// Returns the direction of a pixel in the axes of the camera, scaled to a depth of 1 m.
    pub fn direction(&self, column: usize, row: usize) -> Option<[f64; 3]> {
        let (c, r) = (column as f64, row as f64);
        match self {
            Self::Perspective(lens) => lens.direction(ImagePoint::new(c, r)).map(|[x, y]| [x, y, 1.0]),
            Self::Panorama(panorama) => Some(panorama.direction(c, r)),
        }
    }

    /// Returns whether a position in the axes of the camera is in the picture.
    fn holds(&self, [x, y, z]: [f64; 3]) -> bool {
        match self {
            Self::Panorama(_) => true,
            Self::Perspective(lens) => {
                let at = if z > 0.0 { lens.project(x / z, y / z) } else { None };
                let inside = |c: f64, pixels: usize| c >= -0.5 && c < pixels as f64 - 0.5;
                at.is_some_and(|at| inside(at.sample, lens.width()) && inside(at.line, lens.height()))
            }
        }
    }
}

/// Renders what a camera sees of a surface.
pub fn render(surface: &impl Ground, viewer: &Viewer<'_>, pose: &Pose) -> GroundView {
    let (width, height) = viewer.size();
    let pixel = |k: usize| {
        let Some(in_camera) = viewer.direction(k % width, k / width) else { return (f32::NAN, [0.0; 3], BEYOND) };
        let direction = [0, 1, 2].map(|i| (0..3).map(|j| pose.rotation[j][i] * in_camera[j]).sum::<f64>());
        match surface.meet(&Ray { origin: pose.centre, direction, end: f64::INFINITY }) {
            Some(met) => {
                let away = (0..3).map(|i| met.normal[i] * direction[i]).sum::<f64>() > 0.0;
                (met.t as f32, met.normal.map(|c| if away { -c } else { c } as f32), GROUND)
            }
            None => (f32::NAN, [0.0; 3], if direction[2] >= 0.0 { SKY } else { BEYOND }),
        }
    };
    let pixels: Vec<(f32, [f32; 3], u8)> = (0..width * height).into_par_iter().map(pixel).collect();
    let mut view = GroundView {
        depth_m: Grid::filled(width, height, f32::NAN),
        normal: Grid::filled(width, height, [0.0; 3]),
        kind: Grid::filled(width, height, BEYOND),
    };
    for (k, (depth, normal, kind)) in pixels.into_iter().enumerate() {
        (view.depth_m.data_mut()[k], view.normal.data_mut()[k], view.kind.data_mut()[k]) = (depth, normal, kind);
    }
    view
}

/// Finds the cells of a height field that a camera sees.
pub fn visible_cells(field: &HeightField, viewer: &Viewer<'_>, pose: &Pose) -> Grid<bool> {
    let (width, height) = (field.heights().width(), field.heights().height());
    let mut seen = Grid::filled(width, height, false);
    seen.data_mut().par_chunks_mut(width).enumerate().for_each(|(row, cells)| {
        for (column, cell) in cells.iter_mut().enumerate() {
            let [x, y, z] = field.position(column, row);
            let target = [x, y, z + ABOVE_CELL_M];
            *cell = z.is_finite() && viewer.holds(pose.camera_from_world(target)) && {
                let direction = [0, 1, 2].map(|i| target[i] - pose.centre[i]);
                field.meet(&Ray { origin: pose.centre, direction, end: 1.0 }).is_none()
            };
        }
    });
    seen
}

#[cfg(test)]
mod tests {
    use super::super::{MeshGround, level_pose};
    use super::*;
    use raster::GeoTransform;

    /// Flat ground with a block of 6 m, 10 m north of the origin.
    fn street() -> HeightField {
        let mut heights = Grid::filled(121, 121, 0.0f32);
        for row in 20..40 {
            heights.row_mut(row)[50..70].fill(6.0);
        }
        HeightField::new(heights, GeoTransform::north_up(-30.25, 30.25, 0.5), [0.0; 3]).unwrap()
    }

    #[test]
    fn a_wall_stands_where_it_stands_and_hides_what_is_behind() {
        let (field, pose) = (street(), level_pose([0.0, 0.0, 1.6], 0.0));
        let lens = Panorama::crop_lens(64, 90.0).unwrap();
        let view = render(&field, &Viewer::Perspective(&lens), &pose);
        // The wall's foot is at row 40 (10 m), its top at row 39 (10.5 m).
        let middle = f64::from(view.depth_m[(32, 32)]);
        assert!((10.0..10.5).contains(&middle), "{middle}");
        assert!(view.normal[(32, 32)][1] < -0.9);
        // Below the horizon the ground: depth is height over the slope of the ray.
        let [_, y] = lens.direction(ImagePoint::new(32.0, 60.0)).unwrap();
        assert!((f64::from(view.depth_m[(32, 60)]) - 1.6 / y).abs() < 1e-5 && view.normal[(32, 60)][2] > 0.999);
        assert_eq!((view.kind[(32, 2)], view.kind[(32, 60)]), (SKY, GROUND));
        let seen = visible_cells(&field, &Viewer::Perspective(&lens), &pose);
        assert!(seen[(60, 50)] && !seen[(60, 30)] && !seen[(60, 10)] && !seen[(60, 80)]);
        let around = visible_cells(&field, &Viewer::Panorama(Panorama { width: 8, height: 4 }), &pose);
        assert!(around[(60, 80)] && !around[(60, 10)]);
        // Lower than all of the field nothing is beyond it but sky and what falls past its edge.
        let down = render(&field, &Viewer::Panorama(Panorama { width: 64, height: 32 }), &pose);
        assert!(down.kind.data().contains(&BEYOND) && down.kind[(32, 31)] == GROUND);
    }

    #[test]
    fn fields_and_their_triangles_look_alike() {
        let (field, pose) = (street(), level_pose([0.3, -2.2, 1.6], 17.0));
        let (positions, triangles) = field.triangles();
        let mesh = MeshGround::new(&positions, &triangles).unwrap();
        let viewer = Viewer::Panorama(Panorama { width: 180, height: 90 });
        let (a, b) = (render(&field, &viewer, &pose), render(&mesh, &viewer, &pose));
        assert_eq!(a.kind.data(), b.kind.data());
        for (a, b) in a.depth_m.data().iter().zip(b.depth_m.data()) {
            assert!((a.is_nan() && b.is_nan()) || (a - b).abs() < 1e-4 * b, "{a} {b}");
        }
        let turned = |n: &[f32; 3], m: &[f32; 3]| (0..3).map(|i| (n[i] - m[i]).abs()).fold(0.0, f32::max);
        let off = a.normal.data().iter().zip(b.normal.data()).filter(|(n, m)| turned(n, m) > 1e-4).count();
        // Rays along an edge may take either of its triangles.
        assert!(off < 40, "{off}");
    }
}
