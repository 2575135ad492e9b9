//! Positions on and above the WGS 84 ellipsoid, local frames and UTM, in plain Rust.
//!
//! Angles are degrees and heights metres above the WGS 84 ellipsoid unless a name says otherwise.
//! Map projections of other coordinate reference systems, and vertical datums, are in the crate
//! `crs`.

mod ellipsoid;
mod enu;
mod error;
mod point;
mod transverse_mercator;
mod utm;

pub use ellipsoid::{
    EcefPoint, WGS84_A, WGS84_B, WGS84_E2, WGS84_F, ecef_from_ground, ground_from_ecef, lon_near, meridian_radius_m,
    metres_per_degree, prime_vertical_radius_m, wrap_lon,
};
pub use enu::{EnuFrame, EnuPoint};
pub use error::GeodesyError;
pub use point::{LonLatHeight, MapPoint};
pub use transverse_mercator::TransverseMercator;
pub use utm::{ups_epsg, utm_epsg};
