//! Contour lines of heights as GeoPackage, by GDAL's contour algorithm.

#![allow(unsafe_code)]

use std::path::Path;
use std::ptr::null_mut;

use crs::Crs;
use gdal::DriverManager;
use gdal::cpl::CslStringList;
use gdal::errors::GdalError;
use gdal::spatial_ref::SpatialRef;
use gdal::vector::sql::Dialect;
use gdal::vector::{Feature, LayerAccess, LayerOptions, OGRFieldType};
use gdal::{Dataset, DatasetOptions, GdalOpenFlags};
use raster::{GeoTransform, Grid, NO_DATA};

use super::band::{Band, BandData, in_memory};
use crate::atomic::write_path;
use crate::raster::access::gdal_access::{VectorFormat, register_vector};
use crate::raster::access::gdal_setup::with_gdal;
use crate::raster::error::RasterError;

/// Name of the layer.
const LAYER: &str = "contours";
/// Field of the heights.
const ELEVATION: &str = "elevation";

/// Heights whose contour lines are written.
#[derive(Debug, Clone, Copy)]
pub struct ContourSurface<'a> {
    /// Heights, metres; NaN is no-data.
    pub heights: &'a Grid<f32>,
    /// Position of the grid.
    pub geotransform: GeoTransform,
    /// Reference system with the datum of the heights.
    pub crs: Crs,
    /// Step between the lines, which lie at its multiples, in the unit of the vertical reference
    /// system: metres, or feet where it counts in feet. The lines have their heights in it, too.
    pub interval: f64,
    /// Lines shorter than this are specks of noise and left out, in units of the map.
    pub shortest: f64,
}

/// Contour lines that were written.
#[derive(Debug, Clone, Copy, PartialEq, Eq)]
pub struct ContourLines {
    /// Lines of the file.
    pub written: u64,
    /// Lines that were left out because they were too short.
    pub specks: u64,
}

/// Writes contour lines: the layer `contours` with the field `elevation`, lines with heights.
///
/// # Errors
/// [`RasterError::NotWritten`] when the file exists and `overwrite` is false, and when GDAL refuses
/// or lacks GeoPackages; [`RasterError::Crs`] for a code that PROJ does not know.
pub fn write_contours(path: &Path, surface: &ContourSurface<'_>, overwrite: bool) -> Result<ContourLines, RasterError> {
    surface.crs.wkt().map_err(|source| RasterError::Crs { path: path.to_owned(), source })?;
    let unknown = |source| RasterError::Crs { path: path.to_owned(), source };
    let metres = surface.crs.vertical.metres_per_unit().map_err(unknown)?;
    let heights = surface.heights.map(|height| (f64::from(*height) / metres) as f32);
    let mut lines = ContourLines { written: 0, specks: 0 };
    write_path(path, overwrite, |made| {
        let bands = [Band { description: "height", data: BandData::F32(&heights) }];
        let mut memory = in_memory(path, &bands, Some(f64::from(NO_DATA)))?;
        lines = with_gdal(|| {
            memory.set_geo_transform(&surface.geotransform.0)?;
            draw(&memory, surface, made)
        })
        .and_then(|drawn| verify(made, drawn.written).map(|()| drawn))
        .map_err(|reason| RasterError::unwritable(path, reason))?;
        Ok::<(), RasterError>(())
    })?;
    Ok(lines)
}

/// Checks that the file holds so many lines and that SQLite finds it whole.
///
/// GDAL before 3.7 reports nothing when closing a file fails, and SQLite writes most of it then: on
/// a full disk a file without the lines, or even without the layer, is left.
fn verify(made: &Path, lines: u64) -> Result<(), String> {
    let broken = |what: &str| format!("the written lines read back broken ({what}); check that the disk is not full");
    let options = DatasetOptions {
        open_flags: GdalOpenFlags::GDAL_OF_VECTOR | GdalOpenFlags::GDAL_OF_READONLY,
        allowed_drivers: Some(&[VectorFormat::GeoPackage.driver()]),
        ..DatasetOptions::default()
    };
    let checked = with_gdal(|| {
        let file = Dataset::open_ex(made, options)?;
        let found = file.layer_by_name(LAYER)?.feature_count();
        let mut state = file.execute_sql("PRAGMA integrity_check", None, Dialect::DEFAULT)?;
        let state = match state.as_mut().and_then(|rows| rows.features().next()) {
            Some(row) => row.field_as_string(0)?,
            None => None,
        };
        Ok((found, state))
    });
    match checked {
        Ok((found, Some(state))) if found == lines && state == "ok" => Ok(()),
        Ok((found, _)) if found != lines => Err(broken(&format!("{found} of {lines} lines"))),
        Ok((_, state)) => Err(broken(&state.unwrap_or_else(|| "it cannot be checked".to_owned()))),
        Err(reason) => Err(broken(&reason)),
    }
}

fn draw(memory: &Dataset, surface: &ContourSurface<'_>, made: &Path) -> Result<ContourLines, GdalError> {
    register_vector(VectorFormat::GeoPackage);
    let driver = DriverManager::get_driver_by_name(VectorFormat::GeoPackage.driver())?;
    let mut file = driver.create_vector_only(made)?;
    let place = SpatialRef::from_definition(&surface.crs.to_string())?;
    let ty = gdal_sys::OGRwkbGeometryType::wkbLineString25D;
    let mut layer = file.create_layer(LayerOptions { name: LAYER, srs: Some(&place), ty, options: None })?;
    layer.create_defn_fields(&[("id", OGRFieldType::OFTInteger), (ELEVATION, OGRFieldType::OFTReal)])?;
    let mut options = CslStringList::new();
    options.set_name_value("LEVEL_INTERVAL", &surface.interval.to_string())?;
    options.set_name_value("NODATA", &NO_DATA.to_string())?;
    options.set_name_value("ID_FIELD", "0")?;
    options.set_name_value("ELEV_FIELD", "1")?;
    let band = memory.rasterband(1)?;
    // One transaction: the file would be synchronised to the disk for each line.
    // SAFETY: the layer is open and borrowed during the call.
    unsafe { gdal_sys::OGR_L_StartTransaction(layer.c_layer()) };
    // SAFETY: the band, the layer and the list of options are alive and borrowed during the call;
    // without a progress function its argument is not used.
    let result = unsafe {
        gdal_sys::GDALContourGenerateEx(band.c_rasterband(), layer.c_layer().cast(), options.as_ptr(), None, null_mut())
    };
    let short: Vec<u64> =
        layer.features().filter(|line| is_shorter(line, surface.shortest)).filter_map(|f| f.fid()).collect();
    for &line in &short {
        // SAFETY: the layer is open and borrowed during the call.
        let deleted = unsafe { gdal_sys::OGR_L_DeleteFeature(layer.c_layer(), line as i64) };
        if deleted != gdal_sys::OGRErr::OGRERR_NONE {
            return Err(GdalError::OgrError { err: deleted, method_name: "OGR_L_DeleteFeature" });
        }
    }
    // SAFETY: as for the start of the transaction.
    let committed = unsafe { gdal_sys::OGR_L_CommitTransaction(layer.c_layer()) };
    if committed != gdal_sys::OGRErr::OGRERR_NONE {
        return Err(GdalError::OgrError { err: committed, method_name: "OGR_L_CommitTransaction" });
    }
    if result != gdal_sys::CPLErr::CE_None {
        return Err(GdalError::BadArgument("no contour lines can be drawn".to_owned()));
    }
    let lines = ContourLines { written: layer.feature_count(), specks: short.len() as u64 };
    file.close()?;
    Ok(lines)
}

fn is_shorter(line: &Feature<'_>, shortest: f64) -> bool {
    line.geometry().is_none_or(|geometry| geometry.length() < shortest)
}

#[cfg(test)]
mod tests {
    use super::*;
    use crs::VerticalDatum;

    #[test]
    fn lines_of_a_cone_are_circles_at_their_heights() {
        let folder = tempfile::tempdir().unwrap();
        let path = folder.path().join("contours.gpkg");
        let cells = (0..101 * 101).map(|i| 50.25 - ((i % 101) as f32 - 50.0).hypot((i / 101) as f32 - 50.0));
        let heights = Grid::from_vec(101, 101, cells.collect()).unwrap();
        let geotransform = GeoTransform::north_up(500_000.0, 4_000_000.0, 1.0);
        let crs = Crs { horizontal: 32631, vertical: VerticalDatum::Egm96 };
        let surface = ContourSurface { heights: &heights, geotransform, crs, interval: 10.0, shortest: 0.0 };
        let lines = write_contours(&path, &surface, false).unwrap().written;
        let open_flags = GdalOpenFlags::GDAL_OF_VECTOR;
        let file = Dataset::open_ex(&path, DatasetOptions { open_flags, ..Default::default() }).unwrap();
        let mut layer = file.layer(0).unwrap();
        let found = crs::CrsIdentity::of(&layer.spatial_ref().unwrap().to_wkt().unwrap()).unwrap();
        assert_eq!((found.horizontal, found.vertical), (Some(32631), Some(VerticalDatum::Egm96)));
        assert_eq!((layer.name().as_str(), layer.feature_count()), (LAYER, lines));
        let mut levels = Vec::new();
        for feature in layer.features() {
            let field = feature.field_index(ELEVATION).unwrap();
            let level = feature.field_as_double(field).unwrap().unwrap();
            levels.push(level);
            let mut points = Vec::new();
            feature.geometry().unwrap().get_points(&mut points);
            for (x, y, z) in points {
                assert_eq!(z, level);
                let radius = (x - 500_050.5f64).hypot(y - 3_999_949.5);
                // GDAL prolongs lines to the outer side of the cells at the border.
                assert!((radius - (50.25 - level)).abs() < 0.5, "{level} {radius}");
            }
        }
        levels.sort_by(f64::total_cmp);
        levels.dedup();
        assert!(levels.ends_with(&[10.0, 20.0, 30.0, 40.0, 50.0]), "{levels:?}");
    }

    /// A cone of 50 m and a bump of noise, with heights in US survey feet.
    #[test]
    fn specks_are_left_out_and_heights_keep_the_unit_of_their_reference_system() {
        let folder = tempfile::tempdir().unwrap();
        let cells = (0..101 * 101).map(|i| 50.25 - ((i % 101) as f32 - 50.0).hypot((i / 101) as f32 - 50.0));
        let mut heights = Grid::from_vec(101, 101, cells.collect()).unwrap();
        heights[(5, 5)] = 12.0;
        let geotransform = GeoTransform::north_up(500_000.0, 4_000_000.0, 1.0);
        let crs = Crs { horizontal: 2230, vertical: VerticalDatum::Epsg(6360) };
        let surface = ContourSurface { heights: &heights, geotransform, crs, interval: 20.0, shortest: 0.0 };
        let all = write_contours(&folder.path().join("all.gpkg"), &surface, false).unwrap();
        let path = folder.path().join("long.gpkg");
        let long = write_contours(&path, &ContourSurface { shortest: 10.0, ..surface }, false).unwrap();
        assert!(all.specks == 0 && long.specks > 0, "{all:?} {long:?}");
        assert_eq!(long.written + long.specks, all.written);
        let open_flags = GdalOpenFlags::GDAL_OF_VECTOR;
        let file = Dataset::open_ex(&path, DatasetOptions { open_flags, ..Default::default() }).unwrap();
        let mut layer = file.layer(0).unwrap();
        let field = layer.defn().field_index(ELEVATION).unwrap();
        let highest = layer.features().filter_map(|f| f.field_as_double(field).unwrap()).fold(0.0, f64::max);
        // The top is at 164.9 feet; the circle at 160 feet is 9 m long, that at 140 feet 48 m.
        assert_eq!(highest, 140.0);
    }

    #[test]
    fn a_file_that_was_cut_short_is_not_taken_for_whole() {
        let folder = tempfile::tempdir().unwrap();
        let path = folder.path().join("contours.gpkg");
        let heights = Grid::from_vec(64, 64, (0..64 * 64).map(|i| (i % 64) as f32).collect()).unwrap();
        let geotransform = GeoTransform::north_up(500_000.0, 4_000_000.0, 1.0);
        let crs = Crs { horizontal: 32631, vertical: VerticalDatum::Ellipsoid };
        let surface = ContourSurface { heights: &heights, geotransform, crs, interval: 1.0, shortest: 0.0 };
        let lines = write_contours(&path, &surface, false).unwrap().written;
        verify(&path, lines).unwrap();
        assert!(verify(&path, lines + 1).unwrap_err().contains("lines"));
        let whole = std::fs::read(&path).unwrap();
        for pages in [1, 3, whole.len() / 4096 - 1] {
            std::fs::write(&path, &whole[..4096 * pages]).unwrap();
            let reason = verify(&path, lines).unwrap_err();
            assert!(reason.contains("read back broken"), "{pages} pages: {reason}");
        }
    }
}
