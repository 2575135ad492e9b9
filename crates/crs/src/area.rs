//! Where on the Earth a CRS may be used, as its registry states it.

use crate::error::CrsError;
use crate::proj_handle::area_of_use;

/// Area of use of a CRS, degrees of longitude and latitude. An area that crosses the antimeridian
/// has a western bound that is greater than its eastern one.
#[derive(Debug, Clone, Copy, PartialEq)]
pub struct AreaOfUse {
    /// Western bound.
    pub west_deg: f64,
    /// Southern bound.
    pub south_deg: f64,
    /// Eastern bound.
    pub east_deg: f64,
    /// Northern bound.
    pub north_deg: f64,
}

impl AreaOfUse {
    /// Returns the area of use of an EPSG code, or `None` when the registry names none.
    ///
    /// ```
    /// let swiss = crs::AreaOfUse::of_epsg(2056)?.ok_or("no area")?;
    /// assert!(swiss.distance_deg(7.4, 46.9) == 0.0 && swiss.distance_deg(-81.7, 30.3) > 80.0);
    /// # Ok::<(), Box<dyn std::error::Error>>(())
    /// ```
    ///
    /// # Errors
    /// [`CrsError::NoTransformation`] for a code that PROJ does not know.
    pub fn of_epsg(code: u32) -> Result<Option<Self>, CrsError> {
        let definition = format!("EPSG:{code}");
        let bounds = area_of_use(&definition).map_err(|reason| CrsError::NoTransformation {
            source_crs: "EPSG:4326".to_owned(),
            target_crs: definition.clone(),
            reason,
        })?;
        let area =
            |[west_deg, south_deg, east_deg, north_deg]: [f64; 4]| Self { west_deg, south_deg, east_deg, north_deg };
        Ok(bounds.map(area))
    }

    /// Returns how far a place lies outside, degrees of longitude or latitude; 0 inside.
    pub fn distance_deg(&self, lon_deg: f64, lat_deg: f64) -> f64 {
        let beside = (self.south_deg - lat_deg).max(lat_deg - self.north_deg).max(0.0);
        // Degrees eastwards from the western bound, and the width of the area.
        let (from_west, width) =
            ((lon_deg - self.west_deg).rem_euclid(360.0), (self.east_deg - self.west_deg).rem_euclid(360.0));
        let whole = width == 0.0 && self.east_deg != self.west_deg;
        let along = if whole || from_west <= width { 0.0 } else { (from_west - width).min(360.0 - from_west) };
        beside.max(along)
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn areas_are_measured_around_the_earth() {
        let area = AreaOfUse { west_deg: 170.0, south_deg: -50.0, east_deg: -170.0, north_deg: -30.0 };
        for (lon, lat, expected) in
            [(175.0, -40.0, 0.0), (-175.0, -40.0, 0.0), (160.0, -40.0, 10.0), (-160.0, -20.0, 10.0)]
        {
            assert_eq!(area.distance_deg(lon, lat), expected, "{lon} {lat}");
        }
        let utm = AreaOfUse::of_epsg(32631).unwrap().unwrap();
        assert_eq!((utm.west_deg, utm.east_deg), (0.0, 6.0));
        assert!(AreaOfUse::of_epsg(1).is_err());
    }
}
