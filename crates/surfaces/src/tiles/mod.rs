//! The tiles job: for each camera position a folder with a height map, an ortho on the same pixels,
//! and the cameras, as a network for cross-view synthesis is trained and run with (Turkulainen et
//! al. 2026, arXiv 2605.19656).
//!
//! A tile is turned to the heading of its camera; see [`crate::heightmap`]. What hides the ground
//! from a satellite may stand beside the tile, so that lines of sight are followed on a wider
//! surface. `tile.json` of a folder describes the tile, `tiles.json` beside the folders lists all
//! of them. A tile that cannot be made does not stop the others.

mod config;
mod error;
mod manifest;
mod picture;
mod run;
mod satellite;

pub use config::TilesConfig;
pub use manifest::{GroundCameraInTile, SatelliteInTile, TileFate, TileManifest, TileRecord, TilesReport};
pub use run::run;
