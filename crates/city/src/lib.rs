//! City models: objects with classified surfaces, and the triangles made of them.
//!
//! A [`CityModel`] holds the content of a file: objects with an identifier, a kind and a parent,
//! and per level of detail the polygons of their surfaces, each with a [`SurfaceClass`].
//! Coordinates are f64 in the reference system of the model. Everywhere in this toolkit that is
//! metres east, north and up. The crate `io` reads and writes the files.
//!
//! [`TriangleMesh::from_model`] makes triangles: it picks one level of detail per object, cuts
//! polygons with holes by constrained Delaunay triangulation and checks the solids. Each problem is
//! a [`Defect`] with a number of the catalogue, and each object has an [`ObjectStatus`] that says
//! whether it was used. [`check_solids`] runs the slow checks that only a report needs: shells that
//! intersect themselves, cavities, overlapping solids and building parts.

mod appearance;
mod class;
mod crs;
mod defect;
mod ears;
mod error;
mod kind;
mod lod;
mod model;
mod piece;
mod point;
mod pool;
mod ring;
mod select;
mod sets;
mod shell;
mod triangle_mesh;
mod triangulate;
mod validity;

pub use appearance::{Appearance, RingTexture, SurfaceAppearance, SurfaceMaterial, SurfaceTexture};
pub use class::SurfaceClass;
pub use crs::CrsReference;
pub use defect::{Defect, DefectCode, Effect};
pub use error::ModelError;
pub use kind::{BuildingRole, ObjectKind};
pub use lod::Lod;
pub use model::{CityModel, CityObject, Geometry, GeometryKind, SurfacePolygon};
pub use point::ModelPoint;
pub use pool::VertexPool;
pub use select::{LodChoice, ObjectStatus, Scope};
pub use triangle_mesh::{MeshConfig, MeshSurface, MeshedModel, ObjectReport, TriangleMesh};
pub use triangulate::{PolygonFinding, Triangulation, triangulate};
pub use validity::check_solids;
