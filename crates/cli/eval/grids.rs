//! From the cells of the reference to those of another file: surfaces, terrain, classes, masks.

use std::path::Path;

use anyhow::{Context, bail, ensure};
use crs::{CrsIdentity, MapProjection};
use eval::{CellMap, bilinear, nearest};
use geodesy::{meridian_radius_m, prime_vertical_radius_m};
use io::raster::{Dem, ImageSource};
use raster::{GeoTransform, Grid};

/// Most cells of a class raster.
const CELLS_MAX: usize = 1 << 30;

/// The name of a file's CRS for PROJ; `None` where it has none.
pub(super) fn definition(dem: &Dem) -> Option<String> {
    dem.horizontal_epsg.map(|code| format!("EPSG:{code}")).or_else(|| dem.crs_wkt.clone())
}

pub(super) fn projection(definition: &str, path: &Path) -> anyhow::Result<MapProjection> {
    MapProjection::from_definition(definition).with_context(|| format!("its coordinate system: {}", path.display()))
}

/// Metres per map unit of a surface along x and y, at its middle.
pub(super) fn metres_per_unit(dem: &Dem) -> anyhow::Result<(f64, f64)> {
    let (column, row) = (dem.heights.width() as f64 / 2.0, dem.heights.height() as f64 / 2.0);
    let lat_deg = dem.geotransform.map_from_cell(column, row).1;
    metres_per_unit_at(definition(dem).as_deref(), lat_deg, &dem.path)
}

/// … of a coordinate system: the same everywhere on a map, those of the latitude for degrees; 1 where there is none.
pub(super) fn metres_per_unit_at(definition: Option<&str>, lat_deg: f64, path: &Path) -> anyhow::Result<(f64, f64)> {
    let Some(definition) = definition else { return Ok((1.0, 1.0)) };
    if let Some(metres) = projection(definition, path)?.metres_per_unit() {
        return Ok((metres, metres));
    }
    let per_degree = 1.0_f64.to_radians();
    let east = prime_vertical_radius_m(lat_deg) * lat_deg.to_radians().cos();
    Ok((east * per_degree, meridian_radius_m(lat_deg) * per_degree))
}

/// The map from the cells of the reference to those of a grid with a CRS of its own (or, without, that of the reference).
pub(super) fn cell_map(
    reference: &Dem,
    other: &GeoTransform,
    other_crs: Option<String>,
    margin: usize,
) -> anyhow::Result<CellMap> {
    let (from, to) = match (definition(reference), other_crs) {
        (Some(from), Some(to)) if from != to => (from, to),
        _ => return Ok(CellMap::affine(&reference.geotransform, other)?),
    };
    let (from, to) = (projection(&from, &reference.path)?, MapProjection::from_definition(&to)?);
    let size = (reference.heights.width(), reference.heights.height());
    let project = |x, y| {
        let (lon, lat) = from.lonlat_from_map(x, y).ok()?;
        let point = to.map_from_lonlat(lon, lat).ok()?;
        Some((point.x, point.y))
    };
    Ok(CellMap::projected(&reference.geotransform, other, size, margin, project)?)
}

/// Another surface at the cells of the reference.
pub(super) fn surface_on_reference(other: &Dem, reference: &Dem) -> anyhow::Result<Grid<f32>> {
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

/// The whole numbers of a raster at the cells of the reference, each from the nearest cell; `what` it is, in a word.
pub(super) fn numbers_on_reference(
    path: &Path,
    what: &str,
    reference: &Dem,
    notes: &mut Vec<String>,
) -> anyhow::Result<Grid<Option<i32>>> {
    let source = ImageSource::open(path)?;
    let info = source.info();
    ensure!(info.bands == 1, "{} bands, expected the one of a {what} raster: {}", info.bands, path.display());
    let cells = info.width.saturating_mul(info.height);
    ensure!(cells <= CELLS_MAX, "{cells} cells, at most 2^30 are read from a {what} raster: {}", path.display());
    let own = whole_numbers(&source.read_luma(source.window())?.luma, what, path)?;
    let (width, height) = (reference.heights.width(), reference.heights.height());
    let Some(geotransform) = info.geotransform else {
        ensure!(
            (own.width(), own.height()) == (width, height),
            "the {what} raster has no georeference and {} x {} cells, the reference {width} x {height}: give one that names \
             its position: {}",
            own.width(),
            own.height(),
            path.display()
        );
        notes.push(format!(
            "the {what} raster has no georeference: taken as on the grid of the reference, which has its size"
        ));
        return Ok(own);
    };
    let crs = info.crs_wkt.as_deref().map(|wkt| {
        Ok::<_, anyhow::Error>(match CrsIdentity::of(wkt)?.horizontal {
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

fn whole_numbers(values: &Grid<f32>, what: &str, path: &Path) -> anyhow::Result<Grid<Option<i32>>> {
    let whole = |&value: &f32| (value.is_finite() && value.fract() == 0.0).then_some(value as i32);
    if let Some(odd) = values.data().iter().find(|v| v.is_finite() && whole(v).is_none()) {
        bail!("the {what} raster holds {odd}, expected whole numbers: {}", path.display());
    }
    Ok(values.map(whole))
}
