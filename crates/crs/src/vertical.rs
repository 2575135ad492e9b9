//! Conversion between heights above the ellipsoid and heights above a geoid or another vertical
//! CRS.
//!
//! H = h − N(λ, φ): the orthometric height is the ellipsoidal height minus the geoid's undulation.
//! EGM96 and EGM2008 are interpolated bilinearly in PROJ's grids (`vgridshift`). Other vertical
//! CRSs use PROJ's database without ballpark transformations. A missing grid is an error when the
//! converter is made; a height is never returned unchanged instead. Heights are in metres on both
//! sides, also where the unit of the vertical CRS is a foot. A point outside the grid is an
//! error for a single point, and NaN with a count for slices.

use std::path::Path;

use geodesy::GeodesyError;

use crate::area::AreaOfUse;
use crate::error::CrsError;
use crate::grids;
use crate::identity::VerticalDatum;
use crate::proj_handle::{CrsKind, Direction, Pool, Recipe, named_kind};

/// File names of the EGM96 grid in current and older distributions of PROJ.
const EGM96_GRIDS: [&str; 2] = ["us_nga_egm96_15.tif", "egm96_15.gtx"];
/// File names of the EGM2008 grid in current and older distributions of PROJ.
const EGM2008_GRIDS: [&str; 2] = ["us_nga_egm08_25.tif", "egm08_25.gtx"];

/// Grids of vertical CRSs, by EPSG code, where one file serves all of the area.
const GRIDS: [(u32, &str); 5] = [
    (3855, "us_nga_egm08_25.tif"),
    (5709, "nl_nsgi_nlgeo2018.tif"),
    (5720, "fr_ign_RAF20.tif"),
    (5773, "us_nga_egm96_15.tif"),
    (7837, "de_bkg_gcg2016.tif"),
];
/// Places along each side of the area of use at which a transformation is tried.
const TRIED: usize = 7;

/// Converts heights between the WGS 84 ellipsoid and one vertical datum. `Send` and `Sync`.
#[derive(Debug)]
pub struct HeightConverter {
    datum: VerticalDatum,
    /// The forward direction subtracts the undulation. `None` for the ellipsoid.
    pool: Option<Pool>,
    /// Metres per unit of the heights on the side of the datum, as `pool` gives and takes them.
    metres_per_unit: f64,
}

impl HeightConverter {
    /// Makes the converter of a datum, with the grids that PROJ finds (its folder, `PROJ_DATA`,
    /// `PROJ_LIB`), or that [`crate::get_missing_grids_from`] lets be fetched.
    ///
    /// ```
    /// use crs::{HeightConverter, VerticalDatum};
    ///
    /// let ellipsoid = HeightConverter::new(VerticalDatum::Ellipsoid)?;
    /// assert_eq!(ellipsoid.datum_from_ellipsoid(-81.66, 30.34, 12.5)?, 12.5);
    /// # Ok::<(), crs::CrsError>(())
    /// ```
    ///
    /// # Errors
    /// [`CrsError::MissingGrid`] when the geoid's grid is not installed, and
    /// [`CrsError::GridNotFetched`] when it cannot be fetched either;
    /// [`CrsError::NotVertical`] for the EPSG code of another kind of CRS;
    /// [`CrsError::NoTransformation`] when PROJ has no transformation from the ellipsoid to the
    /// EPSG code.
    pub fn new(datum: VerticalDatum) -> Result<Self, CrsError> {
        let metres_per_unit = datum.metres_per_unit().unwrap_or(1.0);
        let mut pool = installed(datum);
        // A datum of PROJ's database may work with the second of its grids only.
        for _ in 0..grids::NAMED_MAX {
            let Err(CrsError::MissingGrid { candidates, .. }) = &pool else { break };
            let Some(name) = candidates.first() else { break };
            if !grids::fetch(name)? {
                break;
            }
            pool = installed(datum);
        }
        Ok(Self { datum, pool: pool?, metres_per_unit })
    }

    /// Makes the converter of a datum with a given geoid grid (GTX or GeoTIFF).
    ///
    /// # Errors
    /// [`CrsError::UnusableGrid`] when PROJ cannot read the file, or cannot be given its path.
    pub fn with_grid(datum: VerticalDatum, grid: &Path) -> Result<Self, CrsError> {
        let unusable = |reason: String| CrsError::UnusableGrid { path: grid.to_owned(), reason };
        let name = grid.to_str().ok_or_else(|| unusable("the path is not UTF-8".to_owned()))?;
        if name.contains(['"', ',', '+']) {
            return Err(unusable(
                "the path has a quote, a comma or a plus sign, which PROJ does not accept".to_owned(),
            ));
        }
        let pool = Pool::new(Recipe::Pipeline(grid_pipeline(name))).map_err(unusable)?;
        Ok(Self { datum, pool: Some(pool), metres_per_unit: 1.0 })
    }

    /// The vertical datum of the converter.
    pub fn datum(&self) -> VerticalDatum {
        self.datum
    }

    /// Converts a height above the ellipsoid to a height above the datum, metres, at a position in
    /// degrees.
    ///
    /// # Errors
    /// [`CrsError::Position`] with [`GeodesyError::OutsideDomain`] where the grid has no value.
    pub fn datum_from_ellipsoid(&self, lon_deg: f64, lat_deg: f64, height_m: f64) -> Result<f64, CrsError> {
        self.one(Direction::Forward, lon_deg, lat_deg, height_m)
    }

    /// Converts a height above the datum to a height above the ellipsoid, metres, at a position in
    /// degrees.
    ///
    /// # Errors
    /// [`CrsError::Position`] with [`GeodesyError::OutsideDomain`] where the grid has no value.
    pub fn ellipsoid_from_datum(&self, lon_deg: f64, lat_deg: f64, height_m: f64) -> Result<f64, CrsError> {
        self.one(Direction::Inverse, lon_deg, lat_deg, height_m)
    }

    /// Converts slices in place, as [`Self::datum_from_ellipsoid`] does. Returns the number of NaN
    /// heights, including those that were NaN before.
    ///
    /// # Errors
    /// [`CrsError::LengthMismatch`]; [`CrsError::NoTransformation`] when PROJ cannot make a further
    /// handle.
    pub fn datum_from_ellipsoid_slices(
        &self,
        lon_deg: &[f64],
        lat_deg: &[f64],
        height_m: &mut [f64],
    ) -> Result<usize, CrsError> {
        self.many(Direction::Forward, lon_deg, lat_deg, height_m)
    }

    /// Converts slices in place, as [`Self::ellipsoid_from_datum`] does. Returns the number of NaN
    /// heights.
    ///
    /// # Errors
    /// As [`Self::datum_from_ellipsoid_slices`].
    pub fn ellipsoid_from_datum_slices(
        &self,
        lon_deg: &[f64],
        lat_deg: &[f64],
        height_m: &mut [f64],
    ) -> Result<usize, CrsError> {
        self.many(Direction::Inverse, lon_deg, lat_deg, height_m)
    }

    fn one(&self, direction: Direction, lon: f64, lat: f64, height: f64) -> Result<f64, CrsError> {
        let mut heights = [height];
        match self.many(direction, &[lon], &[lat], &mut heights)? {
            0 => Ok(heights[0]),
            _ => Err(GeodesyError::OutsideDomain { x: lon, y: lat, crs: self.datum.to_string() }.into()),
        }
    }

    fn many(&self, direction: Direction, lon: &[f64], lat: &[f64], height: &mut [f64]) -> Result<usize, CrsError> {
        if lon.len() != lat.len() || lon.len() != height.len() {
            return Err(CrsError::LengthMismatch { lengths: vec![lon.len(), lat.len(), height.len()] });
        }
        let Some(pool) = &self.pool else {
            return Ok(height.iter().filter(|h| !h.is_finite()).count());
        };
        let (mut x, mut y) = (lon.to_vec(), lat.to_vec());
        let scale = |heights: &mut [f64], factor: f64| {
            if factor != 1.0 {
                heights.iter_mut().for_each(|h| *h *= factor);
            }
        };
        if direction == Direction::Inverse {
            scale(height, 1.0 / self.metres_per_unit);
        }
        let failed = pool
            .apply(direction, &mut x, &mut y, height)
            .map_err(|reason| no_transformation(&self.datum.to_string(), reason))?;
        if direction == Direction::Forward {
            scale(height, self.metres_per_unit);
        }
        Ok(failed)
    }
}

/// Returns the transformation to a datum with the grids that are installed.
fn installed(datum: VerticalDatum) -> Result<Option<Pool>, CrsError> {
    match datum {
        VerticalDatum::Ellipsoid => Ok(None),
        VerticalDatum::Egm96 => first_grid(datum, &EGM96_GRIDS).map(Some),
        VerticalDatum::Egm2008 => first_grid(datum, &EGM2008_GRIDS).map(Some),
        VerticalDatum::Epsg(code) => through_database(code).map(Some),
    }
}

/// Opens the first grid of a list that PROJ can read.
fn first_grid(datum: VerticalDatum, names: &[&str]) -> Result<Pool, CrsError> {
    names
        .iter()
        .find_map(|name| Pool::new(Recipe::Pipeline(grid_pipeline(name))).ok())
        .ok_or_else(|| missing(datum, names.iter().map(|name| (*name).to_owned()).collect()))
}

/// Returns the PROJ pipeline that subtracts the grid's value at a longitude and latitude in degrees
/// from the height.
fn grid_pipeline(grid: &str) -> String {
    format!(
        "+proj=pipeline +step +proj=unitconvert +xy_in=deg +xy_out=rad \
         +step +proj=vgridshift +grids=\"{grid}\" +multiplier=-1 \
         +step +proj=unitconvert +xy_in=rad +xy_out=deg"
    )
}

/// Makes the transformation to a vertical CRS in PROJ's database. When its grids are missing, PROJ
/// makes none, or one that fails at every point. So it is tried inside the area of use of the CRS.
fn through_database(code: u32) -> Result<Pool, CrsError> {
    if let Ok(found) = named_kind(&format!("EPSG:{code}"))
        && found.kind != CrsKind::Vertical
    {
        return Err(CrsError::NotVertical { code, found: found.to_string() });
    }
    let target = format!("EPSG:4326+{code}");
    let recipe = Recipe::Spatial { source: "EPSG:4979".to_owned(), target: target.clone() };
    let wanted = || match GRIDS.iter().find(|(known, _)| *known == code) {
        Some((_, name)) => vec![(*name).to_owned()],
        None => grids::missing_between("EPSG:4979", &target),
    };
    let datum = VerticalDatum::Epsg(code);
    let without = |reason| match wanted() {
        names if names.is_empty() => no_transformation(&target, reason),
        names => missing(datum, names),
    };
    let pool = Pool::new(recipe).map_err(without)?;
    match AreaOfUse::of_epsg(code) {
        Ok(Some(area)) if !converts_somewhere(&pool, &area) => Err(missing(datum, wanted())),
        _ => Ok(pool),
    }
}

fn missing(datum: VerticalDatum, candidates: Vec<String>) -> CrsError {
    CrsError::MissingGrid { datum: datum.to_string(), candidates, folders: grids::folders() }
}

/// Whether a transformation has a value at one of a lattice of places in an area.
fn converts_somewhere(pool: &Pool, area: &AreaOfUse) -> bool {
    let width = (area.east_deg - area.west_deg).rem_euclid(360.0);
    let share = |i: usize| (i as f64 + 0.5) / TRIED as f64;
    let places = (0..TRIED * TRIED).map(|i| (share(i % TRIED), share(i / TRIED)));
    let (mut lon, mut lat): (Vec<f64>, Vec<f64>) = places
        .map(|(x, y)| (area.west_deg + x * width, area.south_deg + y * (area.north_deg - area.south_deg)))
        .unzip();
    let mut heights = vec![0.0; lon.len()];
    let failed = pool.apply(Direction::Forward, &mut lon, &mut lat, &mut heights);
    failed.is_ok_and(|failed| failed < heights.len())
}

fn no_transformation(target: &str, reason: String) -> CrsError {
    CrsError::NoTransformation { source_crs: "EPSG:4979".to_owned(), target_crs: target.to_owned(), reason }
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn the_ellipsoid_changes_nothing() {
        let none = HeightConverter::new(VerticalDatum::Ellipsoid).unwrap();
        assert_eq!(none.datum_from_ellipsoid(10.0, 20.0, 30.0), Ok(30.0));
        assert!(none.datum_from_ellipsoid(10.0, 20.0, f64::NAN).is_err());
    }

    #[test]
    fn a_missing_grid_is_named_and_never_passed_over() {
        let error = HeightConverter::new(VerticalDatum::Egm2008).err();
        if let Some(error) = error {
            assert!(error.to_string().contains("us_nga_egm08_25.tif"), "{error}");
        }
        // NAVD 88 needs grids that differ by region: without them the height must be lost, not
        // kept.
        if let Ok(converter) = HeightConverter::new(VerticalDatum::Epsg(3855)) {
            let height = converter.datum_from_ellipsoid(-81.66, 30.34, 0.0);
            assert!(height != Ok(0.0), "the height came through unchanged");
        }
        let path = Path::new("/nonexistent/grid.gtx");
        assert!(matches!(HeightConverter::with_grid(VerticalDatum::Egm2008, path), Err(CrsError::UnusableGrid { .. })));
    }

    /// The code of a map, of the ellipsoid's heights or of a compound CRS is no vertical datum.
    #[test]
    fn codes_of_other_systems_are_refused_by_name() {
        for (code, name) in [(32631, "UTM zone 31N"), (4979, "WGS 84"), (7415, "NAP"), (4978, "geocentric")] {
            let error = HeightConverter::new(VerticalDatum::Epsg(code)).unwrap_err();
            assert!(matches!(error, CrsError::NotVertical { .. }), "{error}");
            assert!(error.to_string().contains(name), "{error}");
        }
    }

    /// The error names the grids that PROJ's database lists, and the folders that PROJ searches.
    #[test]
    fn a_missing_grid_of_the_database_is_named_with_the_folders() {
        let Err(error) = HeightConverter::new(VerticalDatum::Epsg(6360)) else { return };
        let text = error.to_string();
        assert!(text.contains("us_noaa_g"), "{text}");
        let CrsError::MissingGrid { folders, .. } = error else { panic!("{text}") };
        assert!(!folders.is_empty() && folders.iter().all(|folder| text.contains(&*folder.to_string_lossy())));
    }

    /// German heights need a grid that PROJ's own package lacks: the error names it.
    #[test]
    fn the_grid_of_a_national_datum_is_named() {
        match HeightConverter::new(VerticalDatum::Epsg(7837)) {
            Err(error) => assert!(error.to_string().contains("de_bkg_gcg2016.tif"), "{error}"),
            Ok(converter) => assert!(converter.datum_from_ellipsoid(9.0, 51.0, 100.0).is_ok_and(|h| h < 60.0)),
        }
    }

    #[test]
    fn both_directions_undo_each_other_and_slices_agree() {
        let converter = HeightConverter::new(VerticalDatum::Egm96).unwrap();
        let lon = [-81.66, 55.6, 179.95, -179.95, 0.0];
        let lat = [30.34, -21.1, 10.0, 10.0, 89.9];
        let mut heights = [12.5, 2340.0, -3.0, 0.0, 100.0];
        let before = heights;
        assert_eq!(converter.datum_from_ellipsoid_slices(&lon, &lat, &mut heights), Ok(0));
        for i in 0..lon.len() {
            assert_eq!(converter.datum_from_ellipsoid(lon[i], lat[i], before[i]), Ok(heights[i]));
        }
        assert_eq!(converter.ellipsoid_from_datum_slices(&lon, &lat, &mut heights), Ok(0));
        for i in 0..lon.len() {
            assert!((heights[i] - before[i]).abs() < 1e-9);
        }
        assert!(converter.datum_from_ellipsoid(f64::NAN, 0.0, 0.0).is_err());
    }
}
