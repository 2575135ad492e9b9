//! Geodetic ground: ellipsoid, local frames, CRS identity and vertical datums.
//!
//! Angles are degrees and heights metres above the WGS 84 ellipsoid unless a name says otherwise.
//! PROJ lives in this crate and nowhere else.

mod point;

pub use point::LonLatHeight;
