//! City models: objects with surfaces and semantics, and the triangles made of them.
//!
//! A [`CityModel`] is what a file says: objects with an id, a kind and a parent, and per level of detail the polygons
//! of their surfaces with a [`SurfaceClass`]. Coordinates are f64 in the reference system of the model (for every use in
//! this toolkit: metres, east, north, up). Readers and writers are in the crate `io`.
//!
//! [`TriangleMesh::from_model`] makes triangles of it: one level of detail per object, polygons with holes by constrained
//! Delaunay triangulation, solids checked. Whatever is wrong is a [`Defect`] with a number, and every object of the model
//! has a status: used, or why not. [`check_solids`] adds what only a report needs: shells that meet themselves, cavities, solids
//! and parts that overlap.

mod class;
mod crs;
mod defect;
mod ears;
mod error;
mod kind;
mod lod;
mod model;
mod point;
mod pool;
mod ring;
mod select;
mod sets;
mod shell;
mod triangle_mesh;
mod triangulate;
mod validity;

pub use class::SurfaceClass;
pub use crs::CrsReference;
pub use defect::{Defect, DefectCode, Effect};
pub use error::ModelError;
pub use kind::{ObjectKind, Role};
pub use lod::Lod;
pub use model::{CityModel, CityObject, Geometry, GeometryKind, Surface};
pub use point::ModelPoint;
pub use pool::VertexPool;
pub use select::{LodChoice, ObjectStatus, Scope};
pub use triangle_mesh::{MeshConfig, MeshSurface, Meshed, ObjectReport, TriangleMesh};
pub use triangulate::{Finding, Triangulation, triangulate};
pub use validity::check_solids;
