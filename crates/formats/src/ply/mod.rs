//! PLY files: the header, the numbers after it, and points for trainers of Gaussian splats.
//!
//! A header names the elements of a file, such as `vertex` and `face`, and their properties. Three
//! encodings are read: text, and binary numbers of either byte order. Binary little-endian files
//! are written. Two comments place a file on a map: `origin x y z`, which its positions are
//! relative to, and `crs`, the definition of the reference system.

mod body;
mod header;
mod points;

pub use body::PlyBody;
pub use header::{PlyElement, PlyEncoding, PlyFault, PlyHeader, PlyNumber, PlyProperty, looks_like_ply, write_header};
pub use points::{PlyPoint, write_points};
