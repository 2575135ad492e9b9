//! The EPSG code of the map zone of a position.
//!
//! Between 80° S and 84° N it is the UTM zone of the longitude (WGS 84, EPSG:326zz north, 327zz
//! south). Beyond, it is universal polar stereographic (EPSG:5041 north, 5042 south, axes east,
//! north). The exceptions for Norway (32V) and Svalbard (31X to 37X) are not applied. They serve
//! map sheets, and the regular zone is as accurate.

use crate::{GeodesyError, wrap_lon};

/// Returns the EPSG code of the UTM zone at a position in degrees, or of the polar zone beyond 84°
/// N and 80° S.
///
/// ```
/// assert_eq!(geodesy::utm_epsg(5.4, 43.5), Ok(32631));
/// ```
///
/// # Errors
/// [`GeodesyError::InvalidPosition`] for non-finite numbers and latitudes beyond the poles.
pub fn utm_epsg(lon_deg: f64, lat_deg: f64) -> Result<u32, GeodesyError> {
    if !lon_deg.is_finite() || !lat_deg.is_finite() || lat_deg.abs() > 90.0 {
        return Err(GeodesyError::InvalidPosition { lon_deg, lat_deg });
    }
    if !(-80.0..84.0).contains(&lat_deg) {
        return Ok(ups_epsg(lat_deg));
    }
    let lon = wrap_lon(lon_deg);
    // The antimeridian is the western edge of zone 1 and belongs to it.
    let zone = if lon == 180.0 { 1 } else { ((lon + 180.0) / 6.0).floor() as u32 + 1 };
    Ok(if lat_deg >= 0.0 { 32600 + zone } else { 32700 + zone })
}

/// Returns the EPSG code of the universal polar stereographic zone of a hemisphere (axes east,
/// north).
pub fn ups_epsg(lat_deg: f64) -> u32 {
    if lat_deg >= 0.0 { 5041 } else { 5042 }
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn zones_follow_longitude_and_hemisphere() {
        for (lon, lat, code) in [
            (-81.66, 30.34, 32617),
            (55.6, -21.1, 32740),
            (180.0, 0.0, 32601),
            (-180.0, -1.0, 32701),
            (179.999, 10.0, 32660),
            (365.0, 10.0, 32631),
            (20.0, 85.0, 5041),
            (20.0, -85.0, 5042),
            (20.0, 83.99, 32634),
        ] {
            assert_eq!(utm_epsg(lon, lat), Ok(code), "{lon} {lat}");
        }
        assert!(utm_epsg(f64::NAN, 0.0).is_err() && utm_epsg(0.0, 91.0).is_err());
    }
}
