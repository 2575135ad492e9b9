//! Readers and writers of every file format. No other crate uses GDAL.
//!
//! Readers convert to the toolkit's convention: the centre of the upper-left pixel is (0, 0), and
//! heights are metres above the ellipsoid unless a reader reports the vertical datum. Writers
//! refuse to replace a file unless `overwrite` is set, and a file appears under its name only when
//! it is complete ([`atomic`]).

pub mod areas;
pub mod atomic;
mod camera_file;
pub mod colmap;
pub mod coloured_mesh;
pub mod control;
mod download;
mod format_error;
mod geoparquet;
pub mod gltf;
pub mod ground_points;
pub mod lines;
pub mod maps;
pub mod npy;
pub mod ply;
pub mod points;
pub mod positions;
pub mod raster;
mod regular;
pub mod rpc;
pub mod similarity;
pub mod splat_files;
pub mod splat_ply;
pub mod stac;
pub mod textured_mesh;
pub mod transforms;
pub mod vectors;

pub use atomic::{SaveError, write_bytes};
pub use download::download;
pub use format_error::FormatError;
pub use regular::{open as open_regular, read_regular, read_regular_text};
