//! Points on and above the ellipsoid.

use serde::{Deserialize, Serialize};

/// A geographic position: WGS 84 longitude and latitude in degrees, height in metres above the
/// ellipsoid.
#[derive(Debug, Clone, Copy, PartialEq, Default, Serialize, Deserialize)]
pub struct LonLatHeight {
    /// Longitude, degrees, east positive.
    pub lon_deg: f64,
    /// Latitude, degrees, north positive.
    pub lat_deg: f64,
    /// Height above the WGS 84 ellipsoid, metres.
    pub height_m: f64,
}

impl LonLatHeight {
    /// Makes a point from longitude and latitude in degrees and an ellipsoidal height in metres.
    pub const fn new(lon_deg: f64, lat_deg: f64, height_m: f64) -> Self {
        Self { lon_deg, lat_deg, height_m }
    }
}

/// A position on a map, in the units of its CRS.
#[derive(Debug, Clone, Copy, PartialEq, Default)]
pub struct MapPoint {
    /// Easting (or longitude).
    pub x: f64,
    /// Northing (or latitude).
    pub y: f64,
}
