//! Cells of the DSM that get no height: those under a mask, and those outside the area that was
//! asked for.

use std::path::Path;

use crs::MapProjection;
use eval::CellMap;
use formats::areas::AreaName;
use formats::raster::ImageSource;
use geo::{Area, CoordsIter, Rect};
use raster::{GeoTransform, Grid, Window, mark_inside};
use reconstruct::{DsmGrid, GroundMask, MapBounds};

use crate::config::DsmConfig;
use crate::error::{DsmError, DsmSetting, axes_hint, degrees};
use crate::masks::ground_polygons::{ground_around, holds_polygons, read_polygons, rings_in_cells};
use crate::notes::Notes;
use crate::planning::grid::lonlat_extent;

/// Cells of a grid that are looked at together for a mask that covers nothing.
const STRIP_CELLS: usize = 1 << 22;

/// Finds the cells of a grid that a configuration excludes; `None` when it excludes none.
///
/// # Errors
/// [`DsmError::Value`] for a raster without CRS, [`DsmError::Area`], [`DsmError::Image`],
/// [`DsmError::Crs`].
pub(crate) fn mask_on(config: &DsmConfig, grid: &DsmGrid) -> Result<Option<GroundMask>, DsmError> {
    if config.masks.is_empty() && config.area.is_none() {
        return Ok(None);
    }
    let map = grid.projection()?;
    let none = Grid::filled(grid.size.0, grid.size.1, false);
    let (mut masked, mut outside) = (none.clone(), none.clone());
    for path in &config.masks {
        match holds_polygons(path) {
            true => mark_polygons(path, AreaName::ALL, grid, &map, &mut masked)?,
            false => mark_raster(path, grid, &map, &mut masked)?,
        }
    }
    if let Some(area) = &config.area {
        let mut inside = none;
        mark_polygons(&area.file, area.wanted(), grid, &map, &mut inside)?;
        outside = inside.map(|inside| !inside);
    }
    Ok(Some(GroundMask { masked, outside }))
}

/// Checks that the files of a configuration can be used, before the images are read.
///
/// # Errors
/// As [`mask_on`].
pub(crate) fn check_masks(config: &DsmConfig) -> Result<(), DsmError> {
    for path in &config.masks {
        match holds_polygons(path) {
            true => drop(formats::areas::read(path, AreaName::ALL)?),
            false => drop(MaskRaster::open(path)?),
        }
    }
    if let Some(area) = &config.area {
        formats::areas::read(&area.file, area.wanted())?;
    }
    Ok(())
}

/// Warns of each mask that covers no cell of a grid.
///
/// # Errors
/// As [`mask_on`].
pub(crate) fn warn_of_masks(config: &DsmConfig, grid: &DsmGrid, notes: &mut Notes<'_>) -> Result<(), DsmError> {
    let map = grid.projection()?;
    let scene = lonlat_extent(grid.bounds(), &map)?;
    for path in &config.masks {
        let found = match holds_polygons(path) {
            true => polygons_beside(path, scene)?,
            false => raster_beside(path, grid, &map)?,
        };
        if let Some(place) = found {
            notes.warn(format!(
                "the mask covers nothing of the surface: it lies at {}, the surface at {}{}: {}",
                degrees(place),
                degrees(scene),
                axes_hint(place, scene),
                path.display()
            ));
        }
    }
    Ok(())
}

/// Returns the extent of the polygons of a mask that has none on the ground of a scene.
fn polygons_beside(path: &Path, scene: MapBounds) -> Result<Option<MapBounds>, DsmError> {
    let ground = Rect::new((scene.x_min, scene.y_min), (scene.x_max, scene.y_max));
    if read_polygons(path, AreaName::ALL, Some(ground))?.unsigned_area() > 0.0 {
        return Ok(None);
    }
    let all = read_polygons(path, AreaName::ALL, None)?;
    Ok(Some(all.exterior_coords_iter().fold(MapBounds::EMPTY, |extent, at| extent.including(at.x, at.y))))
}

/// Returns the extent of a raster mask that marks no cell of a grid.
fn raster_beside(path: &Path, grid: &DsmGrid, map: &MapProjection) -> Result<Option<MapBounds>, DsmError> {
    let rows = (STRIP_CELLS / grid.size.0.max(1)).max(1);
    for y in (0..grid.size.1).step_by(rows) {
        let height = rows.min(grid.size.1 - y);
        let part = grid.part(Window { x: 0, y: y as i64, width: grid.size.0, height });
        let mut cells = Grid::filled(part.size.0, part.size.1, false);
        mark_raster(path, &part, map, &mut cells)?;
        if cells.data().iter().any(|marked| *marked) {
            return Ok(None);
        }
    }
    let MaskRaster { source, geotransform, map: of_file } = MaskRaster::open(path)?;
    let (width, height) = (source.info().width as f64, source.info().height as f64);
    let corners = [(0.0, 0.0), (width, 0.0), (0.0, height), (width, height)];
    let extent = corners.into_iter().try_fold(MapBounds::EMPTY, |extent, (column, row)| {
        let (x, y) = geotransform.map_from_cell(column - 0.5, row - 0.5);
        let (lon, lat) = of_file.lonlat_from_map(x, y)?;
        Ok::<_, DsmError>(extent.including(lon, lat))
    });
    extent.map(Some)
}

/// Marks the cells whose centres lie in a polygon.
fn mark_polygons(
    path: &Path,
    wanted: AreaName<'_>,
    grid: &DsmGrid,
    map: &MapProjection,
    cells: &mut Grid<bool>,
) -> Result<(), DsmError> {
    let place = |c: geo::Coord<f64>| {
        let at = map.map_from_lonlat(c.x, c.y).ok()?;
        grid.geotransform.cell_from_map(at.x, at.y)
    };
    let bounds = grid.bounds();
    let corners = [bounds.x_min, bounds.x_max].map(|x| [bounds.y_min, bounds.y_max].map(|y| map.lonlat_from_map(x, y)));
    let corners = corners.into_iter().flatten().collect::<Result<Vec<_>, _>>()?;
    for rings in rings_in_cells(read_polygons(path, wanted, ground_around(corners))?, place) {
        mark_inside(&rings, cells);
    }
    Ok(())
}

fn unusable(path: &Path, found: &str, expected: &str) -> DsmError {
    DsmError::value(DsmSetting::Masks, format!("{found}: {}", path.display()), expected)
}

/// A mask that is a raster on a map.
struct MaskRaster {
    source: ImageSource,
    geotransform: GeoTransform,
    map: MapProjection,
}

impl MaskRaster {
    fn open(path: &Path) -> Result<Self, DsmError> {
        let source = ImageSource::open(path)?;
        let (Some(geotransform), Some(wkt)) = (source.info().geotransform, &source.info().crs_wkt) else {
            return Err(unusable(
                path,
                "a raster without a coordinate reference system",
                "a georeferenced raster, GeoJSON or a GeoPackage; masks in the frame of an image are image masks",
            ));
        };
        let map = MapProjection::from_definition(wkt)?;
        Ok(Self { source, geotransform, map })
    }
}

/// Marks the cells whose centres lie on a pixel of a raster that is neither 0 nor without data.
fn mark_raster(path: &Path, grid: &DsmGrid, map: &MapProjection, cells: &mut Grid<bool>) -> Result<(), DsmError> {
    let MaskRaster { source, geotransform, map: of_file } = MaskRaster::open(path)?;
    let info = source.info();
    let project = |x, y| {
        let (lon, lat) = map.lonlat_from_map(x, y).ok()?;
        let point = of_file.map_from_lonlat(lon, lat).ok()?;
        Some((point.x, point.y))
    };
    let place = CellMap::projected(&grid.geotransform, &geotransform, grid.size, 0, project)
        .map_err(|_| unusable(path, "a raster whose map does not hold the scene", "one that covers the scene"))?;
    let (columns, rows) = (info.width as i64, info.height as i64);
    for row in 0..grid.size.1 {
        let places: Vec<Option<(i64, i64)>> = (0..grid.size.0)
            .map(|column| {
                let (x, y) = place.position(column as f64, row as f64);
                let at = (x.round() as i64, y.round() as i64);
                let is_inside = x.is_finite() && y.is_finite() && (0..columns).contains(&at.0);
                (is_inside && (0..rows).contains(&at.1)).then_some(at)
            })
            .collect();
        let Some(window) = around(places.iter().flatten()) else { continue };
        let samples = source.read_samples(1, window)?;
        for (cell, at) in cells.row_mut(row).iter_mut().zip(places) {
            let sample = at.map(|(x, y)| samples[((x - window.x) as usize, (y - window.y) as usize)]);
            *cell |= sample.is_some_and(|sample| sample.is_finite() && sample != 0.0);
        }
    }
    Ok(())
}

/// Returns the smallest window that holds some pixels.
fn around<'a>(pixels: impl Iterator<Item = &'a (i64, i64)>) -> Option<Window> {
    let bounds = pixels.fold(None, |bounds, &(x, y)| {
        let (x0, y0, x1, y1) = bounds.unwrap_or((x, y, x, y));
        Some((x0.min(x), y0.min(y), x1.max(x), y1.max(y)))
    });
    let (x0, y0, x1, y1) = bounds?;
    Some(Window { x: x0, y: y0, width: (x1 - x0 + 1) as usize, height: (y1 - y0 + 1) as usize })
}
