//! Every file format, in and out. GDAL lives here and nowhere else.
//!
//! Readers convert to the toolkit's one convention (centre of the upper-left pixel at 0, 0; metres above the ellipsoid)
//! and say so; writers put a file under its name only when it is complete.

pub mod atomic;
pub mod citymodel;
pub mod colmap;
pub mod control;
mod lines;
pub mod maps;
pub mod npy;
pub mod ply;
pub mod points;
pub mod positions;
pub mod raster;
pub mod rpc;
pub mod similarity;
pub mod splat_ply;
pub mod surfaces;
pub mod transforms;

pub use atomic::{SaveError, write_bytes};
