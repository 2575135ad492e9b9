//! The products job: what people open beside a surface model, made from the folder of a run.
//!
//! - `cloud.laz` and `cloud.copc.laz`: a coloured point for each observed cell, with σ, confidence,
//!   views and source as extra dimensions, and the class ground where there is a terrain model.
//! - `dtm/`: the terrain model, as [`surfaces::dtm`] makes it.
//! - `classes/`: ground, buildings and vegetation, as [`surfaces::classes`] finds them.
//! - `contours.gpkg`: contour lines of the terrain model.
//! - `mesh.glb`, `tileset.json` and `tiles/`: the textured surface as one mesh, and as 3D Tiles.
//! - `ortho.tif`: the ortho that gives the colours, where none was given.
//! - `products.json` and `products.html`: the report of the last call, and its page.
//!
//! What an earlier call made (the ortho, the terrain model) is used again.

mod cloud;
mod colour;
mod config;
mod contours;
mod error;
mod mesh;
mod mesh_level;
mod mesh_tiles;
mod page;
mod product;
mod report;
mod run;
mod scene;

pub use cloud::CloudReport;
pub use colour::ColourReport;
pub use config::ProductsConfig;
pub use contours::ContoursReport;
pub(crate) use error::ProductsError;
pub use mesh::MeshReport;
pub use product::ProductKind;
pub use report::ProductsReport;
pub use run::run;
pub(crate) use run::{beside, remove_products};
