//! Conversion between longitude and latitude and map coordinates, through PROJ.
//!
//! Longitude and latitude are degrees of WGS 84. Map coordinates are in the units of the CRS, in
//! the order easting, northing (or longitude, latitude: the traditional GIS order, not the order of
//! the authority). Heights are not converted; see [`crate::HeightConverter`]. A [`MapProjection`]
//! is `Send` and `Sync`. Each call takes one exclusive PROJ handle, so threads run in parallel when
//! they pass slices.

use geodesy::{GeodesyError, MapPoint, metres_per_degree};

use crate::error::CrsError;
use crate::proj_handle::{CrsKind, Direction, Pool, Recipe, metres_per_unit, named_kind};

/// The conversion between WGS 84 longitude and latitude and a map CRS.
#[derive(Debug)]
pub struct MapProjection {
    definition: String,
    metres_per_unit: Option<f64>,
    pool: Pool,
}

impl MapProjection {
    /// Makes the projection of an EPSG code.
    ///
    /// ```
    /// let utm = crs::MapProjection::from_epsg(32617)?;
    /// let map = utm.map_from_lonlat(-81.66, 30.34)?;
    /// let (lon_deg, lat_deg) = utm.lonlat_from_map(map.x, map.y)?;
    /// assert!((lon_deg + 81.66).abs() < 1e-9 && (lat_deg - 30.34).abs() < 1e-9);
    /// # Ok::<(), crs::CrsError>(())
    /// ```
    ///
    /// # Errors
    /// [`CrsError::NotAMap`] for a code that is geocentric or vertical;
    /// [`CrsError::NoTransformation`] when PROJ does not know the code or has no transformation to
    /// it from WGS 84.
    pub fn from_epsg(code: u32) -> Result<Self, CrsError> {
        Self::from_definition(&format!("EPSG:{code}"))
    }

    /// Makes the projection of any CRS that PROJ reads: `EPSG:n`, WKT, PROJJSON. The vertical part
    /// of a compound CRS is ignored. Transformations of unknown accuracy ("ballpark") are refused.
    ///
    /// # Errors
    /// [`CrsError::NotAMap`] for a CRS that is geocentric or vertical;
    /// [`CrsError::NoTransformation`] when PROJ does not know the CRS or has no transformation to
    /// it from WGS 84.
    pub fn from_definition(definition: &str) -> Result<Self, CrsError> {
        let fails = |reason| CrsError::NoTransformation {
            source_crs: "EPSG:4326".to_owned(),
            target_crs: first_line(definition),
            reason,
        };
        let found = named_kind(definition).map_err(fails)?;
        if matches!(found.kind, CrsKind::Geocentric | CrsKind::Vertical) {
            return Err(CrsError::NotAMap { crs: first_line(definition), found: found.to_string() });
        }
        let recipe = Recipe::Horizontal { source: "EPSG:4326".to_owned(), target: definition.to_owned() };
        let metres_per_unit = metres_per_unit(definition).map_err(fails)?;
        let pool = Pool::new(recipe).map_err(fails)?;
        Ok(Self { definition: definition.to_owned(), metres_per_unit, pool })
    }

    /// The definition that this projection was made from.
    pub fn definition(&self) -> &str {
        &self.definition
    }

    /// Metres per unit of `x` and `y`; `None` for a geographic CRS, whose units are degrees.
    pub fn metres_per_unit(&self) -> Option<f64> {
        self.metres_per_unit
    }

    /// Returns the lengths of a unit of `x` and of a unit of `y` at the ordinate `y`, metres. On a
    /// projected map they are the same everywhere. Degrees are measured on the ellipsoid at the
    /// latitude `y`.
    ///
    /// ```
    /// let (east, north) = crs::MapProjection::from_epsg(4326)?.metres_per_unit_at(60.0);
    /// assert!((east - 55_800.0).abs() < 1.0 && (north - 111_412.0).abs() < 1.0);
    /// # Ok::<(), crs::CrsError>(())
    /// ```
    pub fn metres_per_unit_at(&self, y: f64) -> (f64, f64) {
        self.metres_per_unit.map_or_else(|| metres_per_degree(y), |metres| (metres, metres))
    }

    /// Returns the map position of a longitude and latitude in degrees.
    ///
    /// # Errors
    /// [`CrsError::Position`] with [`GeodesyError::OutsideDomain`] where the projection is not
    /// defined.
    pub fn map_from_lonlat(&self, lon_deg: f64, lat_deg: f64) -> Result<MapPoint, CrsError> {
        let (x, y) = self.one(Direction::Forward, lon_deg, lat_deg)?;
        Ok(MapPoint { x, y })
    }

    /// Returns the longitude and latitude in degrees of a map position.
    ///
    /// # Errors
    /// [`CrsError::Position`] with [`GeodesyError::OutsideDomain`] where the projection is not
    /// defined.
    pub fn lonlat_from_map(&self, x: f64, y: f64) -> Result<(f64, f64), CrsError> {
        self.one(Direction::Inverse, x, y)
    }

    /// Converts longitudes to x and latitudes to y, in place. Points outside the domain become NaN,
    /// and their number is returned.
    ///
    /// # Errors
    /// [`CrsError::LengthMismatch`]; [`CrsError::NoTransformation`] when PROJ cannot make a further
    /// handle.
    pub fn map_from_lonlat_slices(&self, lon_to_x: &mut [f64], lat_to_y: &mut [f64]) -> Result<usize, CrsError> {
        self.many(Direction::Forward, lon_to_x, lat_to_y)
    }

    /// Converts x to longitudes and y to latitudes, in place. Points outside the domain become NaN,
    /// and their number is returned.
    ///
    /// # Errors
    /// As [`Self::map_from_lonlat_slices`].
    pub fn lonlat_from_map_slices(&self, x_to_lon: &mut [f64], y_to_lat: &mut [f64]) -> Result<usize, CrsError> {
        self.many(Direction::Inverse, x_to_lon, y_to_lat)
    }

    fn one(&self, direction: Direction, x: f64, y: f64) -> Result<(f64, f64), CrsError> {
        let (mut xs, mut ys) = ([x], [y]);
        match self.many(direction, &mut xs, &mut ys)? {
            0 => Ok((xs[0], ys[0])),
            _ => Err(GeodesyError::OutsideDomain { x, y, crs: first_line(&self.definition) }.into()),
        }
    }

    fn many(&self, direction: Direction, x: &mut [f64], y: &mut [f64]) -> Result<usize, CrsError> {
        if x.len() != y.len() {
            return Err(CrsError::LengthMismatch { lengths: vec![x.len(), y.len()] });
        }
        self.pool.apply(direction, x, y, &mut []).map_err(|reason| CrsError::NoTransformation {
            source_crs: "EPSG:4326".to_owned(),
            target_crs: first_line(&self.definition),
            reason,
        })
    }
}

impl Clone for MapProjection {
    /// Makes a projection with separate PROJ handles, which are created on first use.
    fn clone(&self) -> Self {
        Self { definition: self.definition.clone(), metres_per_unit: self.metres_per_unit, pool: self.pool.duplicate() }
    }
}

/// Returns the start of a definition, for messages: WKT has many lines.
fn first_line(definition: &str) -> String {
    let line = definition.lines().next().unwrap_or_default();
    line.chars().take(80).collect()
}

#[cfg(test)]
mod tests {
    use super::*;
    use proptest::prelude::*;

    /// Positions on maps in US survey feet, in international feet and in degrees come back to a
    /// millimetre.
    #[test]
    fn feet_and_degrees_round_trip_within_a_millimetre() {
        for (code, lon, lat, unit) in [
            (2236, -81.66, 30.34, Some(1200.0 / 3937.0)),
            (2222, -112.0, 33.4, Some(0.3048)),
            (4326, -81.66, 30.34, None),
            (4269, -81.66, 30.34, None),
        ] {
            let projection = MapProjection::from_epsg(code).unwrap();
            match (projection.metres_per_unit(), unit) {
                (Some(found), Some(wanted)) => assert!((found - wanted).abs() < 1e-12, "EPSG:{code}: {found}"),
                (found, wanted) => assert_eq!(found, wanted, "EPSG:{code}"),
            }
            for k in 0..100 {
                let (lon, lat) = (lon + 0.01 * f64::from(k % 10), lat + 0.01 * f64::from(k / 10));
                let map = projection.map_from_lonlat(lon, lat).unwrap();
                let (back_lon, back_lat) = projection.lonlat_from_map(map.x, map.y).unwrap();
                let error_m = 111_320.0 * (back_lon - lon).abs().max((back_lat - lat).abs());
                assert!(error_m < 1e-3, "EPSG:{code}: {error_m} m");
            }
        }
    }

    #[test]
    fn round_trips_in_utm_ups_and_degrees() {
        for (code, lon, lat) in [
            (32617, -81.66, 30.34),
            (32740, 55.6, -21.1),
            (5041, 100.0, 85.0),
            (5042, -179.99, -88.0),
            (4326, 7.5, 3.0),
        ] {
            let projection = MapProjection::from_epsg(code).unwrap();
            let map = projection.map_from_lonlat(lon, lat).unwrap();
            let (lon_back, lat_back) = projection.lonlat_from_map(map.x, map.y).unwrap();
            assert!((lon_back - lon).abs() < 1e-10 && (lat_back - lat).abs() < 1e-10, "{code}");
        }
    }

    proptest! {
        /// A round trip in the zone of the position, at any latitude and on both sides of the
        /// antimeridian.
        #[test]
        fn any_place_survives_its_own_zone(
            lon in -180.0..180.0f64,
            lat in -89.9..89.9f64,
            dx in -2e4..2e4f64,
            dy in -2e4..2e4f64,
        ) {
            let projection = MapProjection::from_epsg(geodesy::utm_epsg(lon, lat).unwrap()).unwrap();
            let at = projection.map_from_lonlat(lon, lat).unwrap();
            let (lon_back, lat_back) = projection.lonlat_from_map(at.x + dx, at.y + dy).unwrap();
            let back = projection.map_from_lonlat(lon_back, lat_back).unwrap();
            prop_assert!((back.x - at.x - dx).abs() < 1e-4 && (back.y - at.y - dy).abs() < 1e-4, "{back:?} {at:?}");
        }
    }

    #[test]
    fn a_scene_on_the_antimeridian_stays_in_one_piece() {
        let projection = MapProjection::from_epsg(32701).unwrap();
        let west = projection.map_from_lonlat(179.999, -17.0).unwrap();
        let east = projection.map_from_lonlat(-179.999, -17.0).unwrap();
        assert!(east.x - west.x > 200.0 && east.x - west.x < 220.0, "{west:?} {east:?}");
        let (lon, _) = projection.lonlat_from_map(west.x, west.y).unwrap();
        assert!((lon - 179.999).abs() < 1e-9, "{lon}");
    }

    #[test]
    fn compound_and_geographic_systems_keep_their_horizontal_part() {
        let plain = MapProjection::from_epsg(32617).unwrap();
        let compound = MapProjection::from_definition("EPSG:32617+5773").unwrap();
        assert_eq!(plain.map_from_lonlat(-81.0, 30.0), compound.map_from_lonlat(-81.0, 30.0));
        assert_eq!(plain.metres_per_unit(), Some(1.0));
        assert_eq!(MapProjection::from_epsg(4326).unwrap().metres_per_unit(), None);
        let feet = MapProjection::from_epsg(2236).unwrap().metres_per_unit().unwrap();
        assert!((feet - 0.3048).abs() < 1e-5);
        let degrees = MapProjection::from_epsg(4326).unwrap().map_from_lonlat(-81.0, 30.0).unwrap();
        assert_eq!(degrees, MapPoint { x: -81.0, y: 30.0 });
    }

    #[test]
    fn systems_without_a_map_are_refused_by_kind() {
        for (code, kind) in [(4978, "geocentric"), (5773, "vertical")] {
            let error = MapProjection::from_epsg(code).unwrap_err();
            assert!(matches!(error, CrsError::NotAMap { .. }), "{error}");
            assert!(error.to_string().contains(kind), "{error}");
        }
    }

    #[test]
    fn what_cannot_be_projected_is_an_error() {
        assert!(matches!(MapProjection::from_epsg(1), Err(CrsError::NoTransformation { .. })));
        assert!(matches!(MapProjection::from_definition("a\0b"), Err(CrsError::NoTransformation { .. })));
        let projection = MapProjection::from_epsg(32617).unwrap();
        for (lon, lat) in [(f64::NAN, 0.0), (0.0, 200.0), (f64::INFINITY, 10.0)] {
            assert!(
                matches!(
                    projection.map_from_lonlat(lon, lat),
                    Err(CrsError::Position(GeodesyError::OutsideDomain { .. }))
                ),
                "{lon}"
            );
        }
        let (mut xs, mut ys) = ([-81.0, f64::NAN], [30.0, 30.0]);
        assert_eq!(projection.map_from_lonlat_slices(&mut xs, &mut ys), Ok(1));
        assert!(xs[0].is_finite() && xs[1].is_nan() && ys[1].is_nan());
        assert!(projection.map_from_lonlat_slices(&mut xs, &mut [1.0]).is_err());
    }

    #[test]
    fn threads_share_one_projection() {
        let projection = MapProjection::from_epsg(32617).unwrap();
        let expected = projection.map_from_lonlat(-81.0, 30.0).unwrap();
        std::thread::scope(|scope| {
            for _ in 0..4 {
                scope.spawn(|| {
                    for _ in 0..100 {
                        assert_eq!(projection.map_from_lonlat(-81.0, 30.0).unwrap(), expected);
                    }
                });
            }
        });
        assert_eq!(projection.clone().map_from_lonlat(-81.0, 30.0).unwrap(), expected);
    }
}
