//! Where an RPC is valid: the box of longitude, latitude and height that its coefficients were
//! fitted on.

use geodesy::LonLatHeight;

use crate::Rpc;
use crate::limits::short_way;

/// A box around a centre; it may lie across the antimeridian.
#[derive(Debug, Clone, Copy, PartialEq)]
pub struct ValidityDomain {
    /// Centre: LONG_OFF, LAT_OFF, HEIGHT_OFF.
    pub centre: LonLatHeight,
    /// Half the extent in longitude, degrees.
    pub half_lon_deg: f64,
    /// Half the extent in latitude, degrees.
    pub half_lat_deg: f64,
    /// Half the extent in height, metres.
    pub half_height_m: f64,
}

impl ValidityDomain {
    /// Returns whether a point lies in the box, faces included.
    pub fn contains(&self, g: LonLatHeight) -> bool {
        short_way(g.lon_deg - self.centre.lon_deg).abs() <= self.half_lon_deg
            && (g.lat_deg - self.centre.lat_deg).abs() <= self.half_lat_deg
            && (g.height_m - self.centre.height_m).abs() <= self.half_height_m
    }

    /// Returns the point at fractions of the half-extents: longitude, latitude, height. Fractions
    /// in [−1, 1] are inside the box. The longitude is not brought back into ±180°.
    pub fn at(&self, [l, p, h]: [f64; 3]) -> LonLatHeight {
        LonLatHeight::new(
            self.centre.lon_deg + l * self.half_lon_deg,
            self.centre.lat_deg + p * self.half_lat_deg,
            self.centre.height_m + h * self.half_height_m,
        )
    }

    /// Returns the lowest and highest height, metres.
    pub fn height_range_m(&self) -> (f64, f64) {
        (self.centre.height_m - self.half_height_m, self.centre.height_m + self.half_height_m)
    }
}

impl Rpc {
    /// Returns the box on which the coefficients were fitted: offsets ± scales.
    pub fn domain(&self) -> ValidityDomain {
        ValidityDomain {
            centre: LonLatHeight::new(self.long_off, self.lat_off, self.height_off),
            half_lon_deg: self.long_scale.abs(),
            half_lat_deg: self.lat_scale.abs(),
            half_height_m: self.height_scale.abs(),
        }
    }
}
