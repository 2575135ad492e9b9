//! Bird's-eye products (Cross-View Splatter, Turkulainen et al. 2026): height maps turned to a heading, true orthos, ground
//! views of a height field, alignment and splits of camera models, and satellite splats.
//!
//! Heights are metres above the WGS 84 ellipsoid unless a type says otherwise; local frames are east, north, up in metres.

pub mod align;
pub mod ground;
pub mod heightmap;
pub mod ortho;
pub mod splats;
pub mod split;
