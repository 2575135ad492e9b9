//! Views from the ground: what cameras and 360° panoramas see of a height field or of a mesh.
//!
//! Positions are metres from a local origin on a map: easting, northing, height. Rays follow a
//! [`HeightField`] exactly, with two triangles for each square of cells, and a [`MeshGround`]
//! through the tree of the crate `bvh`. [`render`] makes depths, normals and the kind of each
//! pixel. [`visible_cells`] finds the cells that a camera sees. [`compose`] lays a rendered ground
//! layer over a satellite layer.

mod compose;
mod field;
mod mesh;
mod panorama;
mod view;

pub use compose::{SizeError, compose};
pub use field::HeightField;
pub use mesh::MeshGround;
pub use panorama::{Panorama, level_pose};
pub use view::{BEYOND, GROUND, GroundView, SKY, Viewer, render, visible_cells};

/// Where a ray meets a surface.
#[derive(Debug, Clone, Copy, PartialEq)]
pub struct Met {
    /// In lengths of the ray's direction.
    pub t: f64,
    /// Unit normal of the surface, in the axes of the map; of fields upwards.
    pub normal: [f64; 3],
}

/// What rays can meet.
pub trait Ground: Sync {
    /// The first of the surface that a ray meets between its origin (exclusive) and its end.
    fn meet(&self, ray: &bvh::Ray) -> Option<Met>;
}
