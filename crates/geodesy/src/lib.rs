//! Geodetic ground: ellipsoid, local frames, CRS identity and vertical datums.
//!
//! Angles are degrees and heights metres above the WGS 84 ellipsoid unless a name says otherwise.
//! PROJ lives in this crate and nowhere else, and its C interface in one private module. PROJ's network access is
//! switched off: a grid is read from the local disk or reported as missing.

mod crs;
mod ellipsoid;
mod enu;
mod error;
mod point;
mod proj_handle;
mod projection;
mod transverse_mercator;
mod vertical;

pub use crs::{Crs, CrsIdentity, CrsRequest, VerticalDatum, ups_epsg, utm_epsg};
pub use ellipsoid::{
    EcefPoint, WGS84_A, WGS84_B, WGS84_E2, WGS84_F, ecef_from_ground, ground_from_ecef, lon_near, meridian_radius_m,
    prime_vertical_radius_m, wrap_lon,
};
pub use enu::{EnuFrame, EnuPoint};
pub use error::GeodesyError;
pub use point::LonLatHeight;
pub use projection::{MapPoint, MapProjection};
pub use transverse_mercator::TransverseMercator;
pub use vertical::HeightConverter;
