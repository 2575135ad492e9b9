//! A local east-north-up frame, metres.
//!
//! The frame is tangent to the ellipsoid at its origin. Conversions go through Earth-centred
//! coordinates, so that the antimeridian and the poles need no special care. East and north are the
//! directions at the origin. `up` differs from the height by d² / 2R (8 cm at 1 km), and
//! [`EnuFrame::ground_from_enu`] converts it back exactly.

use crate::LonLatHeight;
use crate::ellipsoid::{EcefPoint, ecef_from_ground, ground_from_ecef};

/// A position in an [`EnuFrame`], metres from its origin.
#[derive(Debug, Clone, Copy, PartialEq, Default)]
pub struct EnuPoint {
    /// Coordinate towards the east at the origin.
    pub east: f64,
    /// Coordinate towards the north at the origin.
    pub north: f64,
    /// Coordinate along the ellipsoid's normal at the origin.
    pub up: f64,
}

/// East-north-up axes at a ground point.
#[derive(Debug, Clone, Copy, PartialEq)]
pub struct EnuFrame {
    origin: LonLatHeight,
    origin_ecef: EcefPoint,
    sin_lon: f64,
    cos_lon: f64,
    sin_lat: f64,
    cos_lat: f64,
}

impl EnuFrame {
    /// Makes the frame at `origin`.
    ///
    /// ```
    /// use geodesy::{EnuFrame, LonLatHeight};
    ///
    /// let frame = EnuFrame::new(LonLatHeight::new(5.4, 43.53, 180.0));
    /// let above = frame.enu_from_ground(LonLatHeight::new(5.4, 43.53, 190.0));
    /// assert!((above.up - 10.0).abs() < 1e-6);
    /// ```
    pub fn new(origin: LonLatHeight) -> Self {
        let (sin_lon, cos_lon) = origin.lon_deg.to_radians().sin_cos();
        let (sin_lat, cos_lat) = origin.lat_deg.to_radians().sin_cos();
        Self { origin, origin_ecef: ecef_from_ground(origin), sin_lon, cos_lon, sin_lat, cos_lat }
    }

    /// Returns the ground point at (0, 0, 0).
    pub fn origin(&self) -> LonLatHeight {
        self.origin
    }

    /// Returns the local coordinates of a ground point.
    pub fn enu_from_ground(&self, ground: LonLatHeight) -> EnuPoint {
        let p = ecef_from_ground(ground);
        let (dx, dy, dz) = (p.x - self.origin_ecef.x, p.y - self.origin_ecef.y, p.z - self.origin_ecef.z);
        let outward = self.cos_lon * dx + self.sin_lon * dy;
        EnuPoint {
            east: self.cos_lon * dy - self.sin_lon * dx,
            north: self.cos_lat * dz - self.sin_lat * outward,
            up: self.cos_lat * outward + self.sin_lat * dz,
        }
    }

    /// Returns the ground point of local coordinates, with the longitude in (−180, 180].
    pub fn ground_from_enu(&self, enu: EnuPoint) -> LonLatHeight {
        let outward = self.cos_lat * enu.up - self.sin_lat * enu.north;
        ground_from_ecef(EcefPoint {
            x: self.origin_ecef.x + self.cos_lon * outward - self.sin_lon * enu.east,
            y: self.origin_ecef.y + self.sin_lon * outward + self.cos_lon * enu.east,
            z: self.origin_ecef.z + self.cos_lat * enu.north + self.sin_lat * enu.up,
        })
    }
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::ellipsoid::lon_near;
    use proptest::prelude::*;

    #[test]
    fn axes_point_east_north_and_up() {
        let frame = EnuFrame::new(LonLatHeight::new(-81.66, 30.34, 5.0));
        let up = frame.enu_from_ground(LonLatHeight::new(-81.66, 30.34, 105.0));
        assert!(up.east.abs() < 1e-8 && up.north.abs() < 1e-8 && (up.up - 100.0).abs() < 1e-8);
        let east = frame.enu_from_ground(LonLatHeight::new(-81.65, 30.34, 5.0));
        assert!(east.east > 900.0 && east.north.abs() < 1.0);
        let north = frame.enu_from_ground(LonLatHeight::new(-81.66, 30.35, 5.0));
        assert!(north.north > 1100.0 && north.east.abs() < 1e-8);
    }

    #[test]
    fn the_antimeridian_is_no_edge() {
        let frame = EnuFrame::new(LonLatHeight::new(179.9999, -17.0, 0.0));
        let across = frame.enu_from_ground(LonLatHeight::new(-179.9999, -17.0, 0.0));
        assert!(across.east > 20.0 && across.east < 22.0, "{across:?}");
        assert!((frame.ground_from_enu(across).lon_deg + 179.9999).abs() < 1e-12);
    }

    proptest! {
        #[test]
        fn round_trip(lon in -180.0..180.0f64, lat in -90.0..90.0f64, e in -5e4..5e4f64, n in -5e4..5e4f64, u in -1e3..1e4f64) {
            let frame = EnuFrame::new(LonLatHeight::new(lon, lat, 100.0));
            let ground = frame.ground_from_enu(EnuPoint { east: e, north: n, up: u });
            let back = frame.enu_from_ground(ground);
            prop_assert!((back.east - e).abs() < 1e-7 && (back.north - n).abs() < 1e-7 && (back.up - u).abs() < 1e-7);
            prop_assert!(ground.lon_deg > -180.0 && ground.lon_deg <= 180.0);
            prop_assert!((lon_near(ground.lon_deg, lon) - lon).abs() <= 180.0);
        }
    }
}
