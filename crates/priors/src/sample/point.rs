//! A point on a surface.

use city::SurfaceClass;
use numeric::vector::Vector;

use crate::PriorModel;

/// Point on a surface.
#[derive(Debug, Clone, Copy, PartialEq)]
pub struct Sample {
    /// Position, metres from the origin of the mesh.
    pub position: [f64; 3],
    /// Unit normal of its triangle.
    pub normal: [f32; 3],
    /// Distance to its neighbours that follows from the density, metres: 1/√(points per m²).
    pub spacing_m: f32,
    /// Index of its triangle.
    pub triangle: u32,
    /// Index of its object in the city model.
    pub object: u32,
    /// Class of its surface.
    pub class: SurfaceClass,
}

impl PriorModel {
    /// Makes a point on a triangle.
    pub(super) fn sample_at(&self, triangle: usize, position: Vector, spacing_m: f64) -> Sample {
        let surface = self.mesh().surface(triangle);
        Sample {
            position,
            normal: self.normal(triangle).map(|c| c as f32),
            spacing_m: spacing_m as f32,
            triangle: triangle as u32,
            object: surface.object,
            class: surface.class,
        }
    }
}

/// Maps a place of the unit square to a triangle, by folding one half of the square onto the other.
pub(super) fn on_triangle([a, b, c]: [Vector; 3], [u, v]: [f64; 2]) -> Vector {
    let [u, v] = if u + v > 1.0 { [1.0 - u, 1.0 - v] } else { [u, v] };
    [0, 1, 2].map(|i| a[i] + u * (b[i] - a[i]) + v * (c[i] - a[i]))
}
