//! Rasters on other grids, read at the cells of the reference: surfaces, terrain, classes, masks.

use std::path::Path;

use crs::{CrsIdentity, MapProjection};
use eval::{CellMap, bilinear, nearest};
use formats::raster::{Dem, ImageSource};
use raster::{GeoTransform, Grid};

use super::error::EvalJobError;
use job::error::FileCrsError;

/// Most cells that are read from a class raster or mask.
const CELLS_MAX: usize = 1 << 30;

/// Returns the coordinate reference system of a file as PROJ takes it.
pub(crate) fn definition(dem: &Dem) -> Option<String> {
    dem.horizontal_epsg.map(|code| format!("EPSG:{code}")).or_else(|| dem.crs_wkt.clone())
}

/// Returns the metres per map unit of a surface along x and y, at its middle.
pub(super) fn metres_per_unit(dem: &Dem) -> Result<(f64, f64), EvalJobError> {
    let (column, row) = (dem.heights.width() as f64 / 2.0, dem.heights.height() as f64 / 2.0);
    let lat_deg = dem.geotransform.map_from_cell(column, row).1;
    metres_per_unit_at(definition(dem).as_deref(), lat_deg, &dem.path)
}

/// Returns the metres per unit of a coordinate reference system along x and y.
///
/// The scale of a projected map is the same everywhere; degrees are measured on the ellipsoid at
/// `lat_deg`. Without a coordinate reference system the unit is taken as the metre.
pub(super) fn metres_per_unit_at(
    definition: Option<&str>,
    lat_deg: f64,
    path: &Path,
) -> Result<(f64, f64), EvalJobError> {
    let Some(definition) = definition else { return Ok((1.0, 1.0)) };
    Ok(FileCrsError::projection(path, definition)?.metres_per_unit_at(lat_deg))
}

/// Returns the map from the cells of the reference to the cells of another grid.
///
/// A grid without a coordinate reference system is taken to be in the one of the reference. The map
/// holds for `margin` cells beyond the reference.
pub(super) fn cell_map(
    reference: &Dem,
    other: &GeoTransform,
    other_crs: Option<String>,
    margin: usize,
) -> Result<CellMap, EvalJobError> {
    let (from, to) = match (definition(reference), other_crs) {
        (Some(from), Some(to)) if from != to => (from, to),
        _ => return Ok(CellMap::affine(&reference.geotransform, other)?),
    };
    let (from, to) = (FileCrsError::projection(&reference.path, &from)?, MapProjection::from_definition(&to)?);
    let size = (reference.heights.width(), reference.heights.height());
    let project = |x, y| {
        let (lon, lat) = from.lonlat_from_map(x, y).ok()?;
        let point = to.map_from_lonlat(lon, lat).ok()?;
        Some((point.x, point.y))
    };
    Ok(CellMap::projected(&reference.geotransform, other, size, margin, project)?)
}

/// Reads another surface at the cells of the reference, bilinearly.
pub(crate) fn surface_on_reference(other: &Dem, reference: &Dem) -> Result<Grid<f32>, EvalJobError> {
    let map = cell_map(reference, &other.geotransform, definition(other), 0)?;
    let mut on_reference = Grid::filled(reference.heights.width(), reference.heights.height(), f32::NAN);
    for row in 0..on_reference.height() {
        for (column, height) in on_reference.row_mut(row).iter_mut().enumerate() {
            let (x, y) = map.position(column as f64, row as f64);
            *height = bilinear(&other.heights, x, y).map_or(f32::NAN, |h| h as f32);
        }
    }
    Ok(on_reference)
}

/// Reads the whole numbers of a raster at the cells of the reference, each from the nearest cell.
/// `what` names the raster in messages.
pub(super) fn numbers_on_reference(
    path: &Path,
    what: &'static str,
    reference: &Dem,
    notes: &mut Vec<String>,
) -> Result<Grid<Option<i32>>, EvalJobError> {
    let unusable = |found: String| EvalJobError::NumberRaster { what, found, path: path.to_owned() };
    let source = ImageSource::open(path)?;
    let info = source.info();
    if info.bands != 1 {
        return Err(unusable(format!("has {} bands, expected one", info.bands)));
    }
    let cells = info.width.saturating_mul(info.height);
    if cells > CELLS_MAX {
        return Err(unusable(format!("has {cells} cells, at most 2^30 are read")));
    }
    let own = whole_numbers(&source.read_luma(source.window())?.luma).map_err(unusable)?;
    let (width, height) = (reference.heights.width(), reference.heights.height());
    let Some(geotransform) = info.geotransform else {
        if (own.width(), own.height()) != (width, height) {
            return Err(unusable(format!(
                "has no georeference and {} x {} cells, the reference {width} x {height}: use one that names its position",
                own.width(),
                own.height()
            )));
        }
        notes.push(format!(
            "the {what} raster has no georeference: taken as on the grid of the reference, which has its size"
        ));
        return Ok(own);
    };
    let crs = info.crs_wkt.as_deref().map(|wkt| {
        Ok::<_, EvalJobError>(match CrsIdentity::of(wkt)?.horizontal {
            Some(code) => format!("EPSG:{code}"),
            None => wkt.to_owned(),
        })
    });
    let map = cell_map(reference, &geotransform, crs.transpose()?, 0)?;
    let mut on_reference = Grid::filled(width, height, None);
    for row in 0..height {
        for (column, number) in on_reference.row_mut(row).iter_mut().enumerate() {
            let (x, y) = map.position(column as f64, row as f64);
            *number = nearest(&own, x, y).flatten();
        }
    }
    Ok(on_reference)
}

/// Converts samples to whole numbers; NaN becomes `None`.
fn whole_numbers(values: &Grid<f32>) -> Result<Grid<Option<i32>>, String> {
    let whole = |&value: &f32| (value.is_finite() && value.fract() == 0.0).then_some(value as i32);
    if let Some(odd) = values.data().iter().find(|v| v.is_finite() && whole(v).is_none()) {
        return Err(format!("holds {odd}, expected whole numbers"));
    }
    Ok(values.map(whole))
}
