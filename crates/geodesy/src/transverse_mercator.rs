//! A local transverse Mercator map: metres east and north of a point, true to scale at the height
//! of that point.
//!
//! The map uses Krüger's series to the sixth order in the third flattening (Karney, J. Geodesy 85,
//! 2011, eqs. 7–36). It is exact to nanometres within some thousand kilometres of the central
//! meridian. The origin is the point itself. Its meridian is grid north, so the convergence there
//! is zero. The scale is k = 1 + h / √(M N), so that a metre on the map is a metre on the ground at
//! height h (a *low-distortion projection*), to 1.3e-8 within 1 km of the origin. No PROJ object is
//! needed, so that thousands of such maps are cheap. GIS software reads
//! [`TransverseMercator::wkt`].

use crate::ellipsoid::{WGS84_A, WGS84_E2, WGS84_F, meridian_radius_m, prime_vertical_radius_m, wrap_lon};
use crate::{GeodesyError, LonLatHeight, MapPoint};

/// Orders of the series.
const ORDER: usize = 6;
/// Newton steps towards a latitude. Three are enough for full precision.
const STEPS: usize = 5;

/// A transverse Mercator map with its origin at a point.
#[derive(Debug, Clone, Copy, PartialEq)]
pub struct TransverseMercator {
    lon_deg: f64,
    lat_deg: f64,
    scale: f64,
    /// Radius of the rectifying sphere times the scale, metres.
    radius_m: f64,
    /// Rectifying latitude of the origin.
    xi: f64,
    alpha: [f64; ORDER],
    beta: [f64; ORDER],
}

impl TransverseMercator {
    /// Makes the map with its origin at a point, true to scale at the height of that point.
    ///
    /// ```
    /// use geodesy::{LonLatHeight, TransverseMercator};
    ///
    /// let map = TransverseMercator::local(LonLatHeight::new(5.4, 43.53, 180.0))?;
    /// let here = map.map_from_lonlat(5.4, 43.53)?;
    /// assert!(here.x.abs() < 1e-6 && here.y.abs() < 1e-6);
    /// # Ok::<(), geodesy::GeodesyError>(())
    /// ```
    ///
    /// # Errors
    /// [`GeodesyError::InvalidPosition`] for an invalid position or a height beyond ±100 km.
    pub fn local(origin: LonLatHeight) -> Result<Self, GeodesyError> {
        let LonLatHeight { lon_deg, lat_deg, height_m } = origin;
        let radius_m = (meridian_radius_m(lat_deg) * prime_vertical_radius_m(lat_deg)).sqrt();
        let scale = if height_m.abs() <= 1e5 { 1.0 + height_m / radius_m } else { f64::NAN };
        Self::new(lon_deg, lat_deg, scale)
    }

    /// Makes the map with its origin at a longitude and latitude in degrees and a scale on its
    /// central meridian.
    ///
    /// # Errors
    /// [`GeodesyError::InvalidPosition`] for an invalid position or a scale that is not positive.
    pub fn new(lon_deg: f64, lat_deg: f64, scale: f64) -> Result<Self, GeodesyError> {
        let position = lon_deg.is_finite() && lon_deg.abs() <= 360.0 && lat_deg.abs() <= 90.0;
        if !(position && scale > 0.0 && scale.is_finite()) {
            return Err(GeodesyError::InvalidPosition { lon_deg, lat_deg });
        }
        let n = WGS84_F / (2.0 - WGS84_F);
        let rectifying = WGS84_A / (1.0 + n) * (1.0 + n.powi(2) / 4.0 + n.powi(4) / 64.0 + n.powi(6) / 256.0);
        let mut map = Self {
            lon_deg: wrap_lon(lon_deg),
            lat_deg,
            scale,
            radius_m: scale * rectifying,
            xi: 0.0,
            alpha: series(n, &ALPHA),
            beta: series(n, &BETA),
        };
        map.xi = map.sphere_from_lonlat(0.0, lat_deg).0;
        Ok(map)
    }

    /// Returns the longitude of the origin, degrees.
    pub fn lon_deg(&self) -> f64 {
        self.lon_deg
    }

    /// Returns the latitude of the origin, degrees.
    pub fn lat_deg(&self) -> f64 {
        self.lat_deg
    }

    /// Returns the scale on the central meridian.
    pub fn scale(&self) -> f64 {
        self.scale
    }

    /// Returns the metres east and north of the origin for a longitude and latitude in degrees.
    ///
    /// # Errors
    /// [`GeodesyError::OutsideDomain`] 80° and more from the central meridian.
    pub fn map_from_lonlat(&self, lon_deg: f64, lat_deg: f64) -> Result<MapPoint, GeodesyError> {
        let east_deg = wrap_lon(lon_deg - self.lon_deg);
        if !(lat_deg.abs() <= 90.0 && east_deg.abs() < 80.0) {
            return Err(GeodesyError::OutsideDomain { x: lon_deg, y: lat_deg, crs: self.to_string() });
        }
        let (xi, eta) = self.sphere_from_lonlat(east_deg.to_radians(), lat_deg);
        Ok(MapPoint { x: self.radius_m * eta, y: self.radius_m * (xi - self.xi) })
    }

    /// Returns the longitude in (−180, 180] and latitude, degrees, for metres east and north of the
    /// origin.
    ///
    /// # Errors
    /// [`GeodesyError::OutsideDomain`] for numbers beyond 5,000 km.
    pub fn lonlat_from_map(&self, x: f64, y: f64) -> Result<(f64, f64), GeodesyError> {
        if !(x.abs() < 5e6 && y.abs() < 5e6) {
            return Err(GeodesyError::OutsideDomain { x, y, crs: self.to_string() });
        }
        let (xi, eta) = (y / self.radius_m + self.xi, x / self.radius_m);
        let (mut xi1, mut eta1) = (xi, eta);
        for (k, beta) in (1..).zip(self.beta) {
            let twice = 2.0 * f64::from(k);
            xi1 -= beta * (twice * xi).sin() * (twice * eta).cosh();
            eta1 -= beta * (twice * xi).cos() * (twice * eta).sinh();
        }
        let conformal = xi1.sin() / eta1.sinh().hypot(xi1.cos());
        let east = eta1.sinh().atan2(xi1.cos());
        let lat_deg = geographic_tangent(conformal).atan().to_degrees();
        Ok((wrap_lon(self.lon_deg + east.to_degrees()), lat_deg))
    }

    /// Returns WKT that GDAL, PROJ and GIS software read.
    pub fn wkt(&self) -> String {
        format!(
            "PROJCS[\"{self}\",GEOGCS[\"WGS 84\",DATUM[\"WGS_1984\",SPHEROID[\"WGS 84\",6378137,298.257223563,\
             AUTHORITY[\"EPSG\",\"7030\"]],AUTHORITY[\"EPSG\",\"6326\"]],PRIMEM[\"Greenwich\",0],\
             UNIT[\"degree\",0.0174532925199433],AUTHORITY[\"EPSG\",\"4326\"]],PROJECTION[\"Transverse_Mercator\"],\
             PARAMETER[\"latitude_of_origin\",{}],PARAMETER[\"central_meridian\",{}],PARAMETER[\"scale_factor\",{}],\
             PARAMETER[\"false_easting\",0],PARAMETER[\"false_northing\",0],UNIT[\"metre\",1],\
             AXIS[\"Easting\",EAST],AXIS[\"Northing\",NORTH]]",
            self.lat_deg, self.lon_deg, self.scale
        )
    }

    /// Returns the position on the rectifying sphere: northing and easting as angles.
    fn sphere_from_lonlat(&self, east: f64, lat_deg: f64) -> (f64, f64) {
        let conformal = conformal_tangent(lat_deg.to_radians().tan());
        let xi1 = conformal.atan2(east.cos());
        let eta1 = (east.sin() / conformal.hypot(east.cos())).asinh();
        let (mut xi, mut eta) = (xi1, eta1);
        for (k, alpha) in (1..).zip(self.alpha) {
            let twice = 2.0 * f64::from(k);
            xi += alpha * (twice * xi1).sin() * (twice * eta1).cosh();
            eta += alpha * (twice * xi1).cos() * (twice * eta1).sinh();
        }
        (xi, eta)
    }
}

impl std::fmt::Display for TransverseMercator {
    fn fmt(&self, f: &mut std::fmt::Formatter<'_>) -> std::fmt::Result {
        write!(f, "local transverse Mercator at {:.6} {:.6}", self.lon_deg, self.lat_deg)
    }
}

/// Returns the tangent of the conformal latitude from the tangent of the geographic latitude.
fn conformal_tangent(tangent: f64) -> f64 {
    let e = WGS84_E2.sqrt();
    let root = tangent.hypot(1.0);
    let sigma = (e * (e * tangent / root).atanh()).sinh();
    tangent * sigma.hypot(1.0) - sigma * root
}

/// Returns the tangent of the geographic latitude from the tangent of the conformal latitude, by
/// Newton's method (Karney's eqs. 19–21).
fn geographic_tangent(conformal: f64) -> f64 {
    let mut tangent = conformal;
    for _ in 0..STEPS {
        let found = conformal_tangent(tangent);
        let slope =
            (1.0 - WGS84_E2) * found.hypot(1.0) * tangent.hypot(1.0) / (1.0 + (1.0 - WGS84_E2) * tangent * tangent);
        let step = (conformal - found) / slope;
        if !step.is_finite() {
            break;
        }
        tangent += step;
    }
    tangent
}

/// Evaluates the rows of a table as polynomials in n. Row j begins with the power n^j.
fn series(n: f64, table: &[&[f64]; ORDER]) -> [f64; ORDER] {
    std::array::from_fn(|j| {
        let powers = (j as i32 + 1..).map(|power| n.powi(power));
        table[j].iter().zip(powers).map(|(c, power)| c * power).sum()
    })
}

/// Karney's eq. 35, from n^j on.
const ALPHA: [&[f64]; ORDER] = [
    &[1.0 / 2.0, -2.0 / 3.0, 5.0 / 16.0, 41.0 / 180.0, -127.0 / 288.0, 7891.0 / 37800.0],
    &[13.0 / 48.0, -3.0 / 5.0, 557.0 / 1440.0, 281.0 / 630.0, -1_983_433.0 / 1_935_360.0],
    &[61.0 / 240.0, -103.0 / 140.0, 15061.0 / 26880.0, 167_603.0 / 181_440.0],
    &[49561.0 / 161_280.0, -179.0 / 168.0, 6_601_661.0 / 7_257_600.0],
    &[34729.0 / 80640.0, -3_418_889.0 / 1_995_840.0],
    &[212_378_941.0 / 319_334_400.0],
];
/// Karney's eq. 36, from n^j on.
const BETA: [&[f64]; ORDER] = [
    &[1.0 / 2.0, -2.0 / 3.0, 37.0 / 96.0, -1.0 / 360.0, -81.0 / 512.0, 96199.0 / 604_800.0],
    &[1.0 / 48.0, 1.0 / 15.0, -437.0 / 1440.0, 46.0 / 105.0, -1_118_711.0 / 3_870_720.0],
    &[17.0 / 480.0, -37.0 / 840.0, -209.0 / 4480.0, 5569.0 / 90720.0],
    &[4397.0 / 161_280.0, -11.0 / 504.0, -830_251.0 / 7_257_600.0],
    &[4583.0 / 161_280.0, -108_847.0 / 3_991_680.0],
    &[20_648_693.0 / 638_668_800.0],
];

#[cfg(test)]
mod tests {
    use super::*;
    use crate::EnuFrame;
    use proptest::prelude::*;

    #[test]
    fn a_metre_of_the_map_is_a_metre_on_the_ground_at_the_height_of_its_origin() {
        let origin = LonLatHeight::new(55.5, -21.1, 2340.0);
        let (map, enu) = (TransverseMercator::local(origin).unwrap(), EnuFrame::new(origin));
        for (x, y) in [(183.0, 0.0), (0.0, -183.0), (129.5, 129.5)] {
            let (lon, lat) = map.lonlat_from_map(x, y).unwrap();
            let p = enu.enu_from_ground(LonLatHeight::new(lon, lat, 2340.0));
            assert!((p.east - x).abs() < 2e-3 && (p.north - y).abs() < 2e-3, "{p:?}");
        }
    }

    #[test]
    fn impossible_numbers_are_refused() {
        for (lon, lat, scale) in
            [(f64::NAN, 0.0, 1.0), (0.0, 90.1, 1.0), (0.0, f64::NAN, 1.0), (400.0, 0.0, 1.0), (0.0, 0.0, 0.0)]
        {
            assert!(TransverseMercator::new(lon, lat, scale).is_err(), "{lon} {lat} {scale}");
        }
        assert!(TransverseMercator::local(LonLatHeight::new(0.0, 0.0, f64::NAN)).is_err());
        let map = TransverseMercator::new(0.0, 0.0, 1.0).unwrap();
        assert!(map.map_from_lonlat(100.0, 0.0).is_err() && map.lonlat_from_map(f64::NAN, 0.0).is_err());
    }

    proptest! {
        #[test]
        fn the_way_back_is_the_way(lon in -180.0..180.0f64, lat in -89.9..89.9f64, x in -3e5..3e5f64, y in -3e5..3e5f64) {
            let map = TransverseMercator::new(lon, lat, 1.0001).unwrap();
            let (l, p) = map.lonlat_from_map(x, y).unwrap();
            // Beyond a pole the position lies on another meridian, more than a quarter of the globe
            // away.
            if let Ok(back) = map.map_from_lonlat(l, p) {
                prop_assert!((back.x - x).abs() < 1e-6 && (back.y - y).abs() < 1e-6);
            } else {
                prop_assert!(lat.abs() > 80.0);
            }
        }
    }
}
