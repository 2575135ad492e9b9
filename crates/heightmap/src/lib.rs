//! Height maps seen from above, as in Cross-View Splatter (Turkulainen et al. 2026, arXiv
//! 2605.19656).
//!
//! A map is a square tile around the first ground camera. The camera is at the middle of the
//! square, and the top of the picture lies before it: columns run to its right, rows to its back. A
//! pixel holds the height of the upper surface in metres relative to the camera, which is 2 m above
//! the ground by convention. [`TileFrame`] positions the pixels. [`TileMap`] leads from them to a
//! source: a grid of heights ([`heights_from_grid`]), triangles ([`heights_from_triangles`]) or
//! points ([`HighestPoints`]). Where no source has a height, the map is NaN.

mod confidence;
mod error;
mod frame;
mod ground;
mod lattice;
mod model;
mod normalise;
mod points;
mod surface;
mod unproject;

pub use confidence::confidence_from_grid;
pub use error::HeightMapError;
pub use frame::{MapSystem, TileFrame, TileRequest};
pub use ground::{GROUND_REACH_M, ground_height};
pub use lattice::{SourceMap, TileMap};
pub use model::{PlacedTriangles, heights_from_triangles, lowest_from_triangles};
pub use normalise::mean_distance_m;
pub use points::{HighestPoints, PointTiles};
pub use surface::{Reading, heights_from_grid};
pub use unproject::{camera_points, map_points};
