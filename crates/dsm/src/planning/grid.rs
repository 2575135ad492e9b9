//! The grid of the DSM: CRS, cell size and extent.

use crs::{AreaOfUse, CrsError, HeightConverter, MapProjection};
use geo::CoordsIter;
use geodesy::{metres_per_degree, utm_epsg};
use reconstruct::{DsmGrid, MapBounds, Preset, ReconstructError, ViewGeometry, cell_size, shared_ground, snapped};
use report::plain_number;

use crate::config::{DsmConfig, LayerArea};
use crate::error::{DsmError, DsmSetting};
use crate::masks::ground_polygons::read_polygons;
use crate::notes::Notes;

/// Beyond this distance from its area of use a CRS needs to be forced, degrees. Scenes at the
/// border of two UTM zones are written in either, and half a zone beyond it distorts by 2 in 1000.
const FAR_OUTSIDE_DEG: f64 = 3.0;
/// Fewest cells on a side of a grid whose cell size is given. Fewer come from a size in wrong
/// units: with two cells between a void border on each side, nothing of a surface has a shape.
const SIDE_MIN: usize = 5;
/// Deviation of a map's scale from 1 that is told. Maps for measuring, such as UTM and national
/// grids, stay far below, and cell sizes are given with two digits.
const SCALE_TOLERANCE: f64 = 0.01;
/// Steps along each edge of bounds in another CRS. A bend of an edge between two of them is below a
/// thousandth of its whole bend, which for a scene of 100 km is below a metre.
const EDGE_STEPS: usize = 32;
/// Chooses CRS, cell size and extent where they are not given. `coarsest_gsd_m` is the pixel of the
/// coarsest image.
///
/// # Errors
/// [`DsmError::Value`] for a CRS that is not in metres and for a grid of too many cells,
/// [`DsmError::BoundsMissScene`], [`DsmError::Crs`].
pub(crate) fn choose_grid(
    config: &DsmConfig,
    geometry: &ViewGeometry,
    coarsest_gsd_m: f64,
) -> Result<DsmGrid, DsmError> {
    let centre = geometry.centre;
    let epsg = match config.crs_epsg {
        Some(code) => code,
        None => utm_epsg(centre.lon_deg, centre.lat_deg).map_err(CrsError::from)?,
    };
    let projection = MapProjection::from_epsg(epsg)?;
    if !config.force_crs
        && let Some(area) =
            outside_area(epsg, (centre.lon_deg, centre.lat_deg))?.filter(|area| area.distance_deg > FAR_OUTSIDE_DEG)
    {
        return Err(DsmError::value(DsmSetting::Crs, area.text, "a CRS for the place of the scene"));
    }
    // What cannot be converted at the end fails before the computation.
    HeightConverter::new(config.vertical)?;
    let gsd_m = config.gsd_m.unwrap_or_else(|| rounded_gsd_m(coarsest_gsd_m * config.preset.pixels_per_cell()));
    let covered = covered_bounds(geometry, &projection)?;
    if let Some(area) = &config.area {
        let (polygons, covered) = (extent(area)?, lonlat_extent(covered, &projection)?);
        if !polygons.meets(covered) {
            return Err(DsmError::AreaMissesScene { path: area.file.clone(), area: polygons, covered });
        }
    }
    let bounds = match (asked_bounds(config, &projection)?, &config.area) {
        (Some(bounds), _) => bounds,
        (None, Some(area)) => bounds_of_area(area, &projection)?,
        (None, None) => covered,
    };
    if !bounds.meets(covered) {
        return Err(DsmError::BoundsMissScene { bounds, covered, epsg });
    }
    let (geotransform, size) = snapped(bounds, cell_size(&projection, gsd_m, centre.lat_deg))?;
    if config.gsd_m.is_some() && size.0.min(size.1) < SIDE_MIN {
        let found = format!("{gsd_m} m, which gives a grid of {} × {} cells", size.0, size.1);
        let expected = format!(
            "a cell size in metres for {SIDE_MIN} or more cells on each side; a pixel of the images has {coarsest_gsd_m:.2} m"
        );
        return Err(DsmError::value(DsmSetting::CellSize, found, expected));
    }
    Ok(DsmGrid { epsg, geotransform, size, gsd_m })
}

/// Returns the bounds that are asked for, on the map of the DSM: where they are given in another
/// CRS, the rectangle around them, whose edges are curves there.
pub(crate) fn asked_bounds(config: &DsmConfig, map: &MapProjection) -> Result<Option<MapBounds>, DsmError> {
    let (Some(bounds), Some(code)) = (config.bounds, config.bounds_epsg) else { return Ok(config.bounds) };
    if map.definition() == format!("EPSG:{code}") {
        return Ok(Some(bounds));
    }
    let own = MapProjection::from_epsg(code)?;
    let mut on_map = MapBounds::EMPTY;
    for step in 0..=EDGE_STEPS {
        let share = step as f64 / EDGE_STEPS as f64;
        let x = bounds.x_min + share * (bounds.x_max - bounds.x_min);
        let y = bounds.y_min + share * (bounds.y_max - bounds.y_min);
        for (x, y) in [(x, bounds.y_min), (x, bounds.y_max), (bounds.x_min, y), (bounds.x_max, y)] {
            let (lon, lat) = own.lonlat_from_map(x, y)?;
            let at = map.map_from_lonlat(lon, lat)?;
            on_map = on_map.including(at.x, at.y);
        }
    }
    Ok(Some(on_map))
}

/// Returns the longitudes and latitudes of the polygons of an area.
fn extent(area: &LayerArea) -> Result<MapBounds, DsmError> {
    let polygons = read_polygons(&area.file, area.wanted(), None)?;
    Ok(polygons.exterior_coords_iter().fold(MapBounds::EMPTY, |extent, corner| extent.including(corner.x, corner.y)))
}

/// Returns the longitudes and latitudes of a map rectangle.
pub(crate) fn lonlat_extent(bounds: MapBounds, map: &MapProjection) -> Result<MapBounds, CrsError> {
    let corners = [bounds.x_min, bounds.x_max].map(|x| [bounds.y_min, bounds.y_max].map(|y| (x, y)));
    corners.into_iter().flatten().try_fold(MapBounds::EMPTY, |extent, (x, y)| {
        let (lon, lat) = map.lonlat_from_map(x, y)?;
        Ok(extent.including(lon, lat))
    })
}

/// Returns the map rectangle around the polygons of an area.
fn bounds_of_area(area: &LayerArea, projection: &MapProjection) -> Result<MapBounds, DsmError> {
    let mut bounds = MapBounds::EMPTY;
    for corner in read_polygons(&area.file, area.wanted(), None)?.exterior_coords_iter() {
        let at = projection.map_from_lonlat(corner.x, corner.y)?;
        bounds = bounds.including(at.x, at.y);
    }
    Ok(bounds)
}

/// A CRS that is used outside its area of use.
struct OutsideArea {
    /// Distance of the scene from the area, degrees.
    distance_deg: f64,
    /// Where the CRS and the scene are.
    text: String,
}

/// Returns how far the scene lies outside the area of use of the CRS; `None` when it lies inside.
fn outside_area(epsg: u32, (lon_deg, lat_deg): (f64, f64)) -> Result<Option<OutsideArea>, CrsError> {
    let Some(area) = AreaOfUse::of_epsg(epsg)? else { return Ok(None) };
    let distance_deg = area.distance_deg(lon_deg, lat_deg);
    let AreaOfUse { west_deg, south_deg, east_deg, north_deg } = area;
    let text = format!(
        "EPSG:{epsg}, which is for {west_deg:.1}° to {east_deg:.1}° E, {south_deg:.1}° to {north_deg:.1}° N; \
         the scene is at {lon_deg:.2}° E, {lat_deg:.2}° N"
    );
    Ok((distance_deg > 0.0).then_some(OutsideArea { distance_deg, text }))
}

/// Warns of a CRS that is used outside its area of use. A place that cannot be found is no warning.
fn warn_of_area(grid: &DsmGrid, notes: &mut Notes<'_>) {
    let (x, y) = grid.bounds().middle();
    let place = grid.projection().and_then(|projection| projection.lonlat_from_map(x, y));
    if let Ok(Some(area)) = place.and_then(|place| outside_area(grid.epsg, place)) {
        notes.warn(format!("the CRS is used outside its area of use, where it distorts: {}", area.text));
    }
}

/// Warns of a map whose metres are none on the ground, such as that of web maps (EPSG:3857).
fn warn_of_scale(grid: &DsmGrid, notes: &mut Notes<'_>) {
    if let Some(scale) = scale_of(grid).filter(|scale| (scale - 1.0).abs() > SCALE_TOLERANCE) {
        notes.warn(format!(
            "EPSG:{} stretches the ground by {scale:.3} here: a cell of {} m on the map is {:.3} m on the ground, \
             and lengths, areas and volumes on the map are wrong; a UTM zone, which is the default, is true to scale",
            grid.epsg,
            grid.gsd_m,
            grid.gsd_m / scale
        ));
    }
}

/// Returns the metres on the map for a metre on the ground in the middle of the grid, going east;
/// `None` for degrees, and where the place cannot be found.
fn scale_of(grid: &DsmGrid) -> Option<f64> {
    let projection = grid.projection().ok()?;
    let metres = projection.metres_per_unit()?;
    let (x, y) = grid.bounds().middle();
    let step = grid.bounds().x_max - x;
    let (lon, lat) = projection.lonlat_from_map(x, y).ok()?;
    let (east_lon, east_lat) = projection.lonlat_from_map(x + step, y).ok()?;
    let (across, along) = metres_per_degree(lat);
    let ground_m = ((east_lon - lon) * across).hypot((east_lat - lat) * along);
    (ground_m > 0.0).then_some(step * metres / ground_m)
}

/// Notes the choices of [`choose_grid`].
pub(crate) fn note_grid(config: &DsmConfig, grid: &DsmGrid, coarsest_gsd_m: f64, notes: &mut Notes<'_>) {
    let given = |is_given: bool, else_why: String| if is_given { "given".to_owned() } else { else_why };
    let zone = given(config.crs_epsg.is_some(), "the UTM (or polar) zone of the scene's centre".to_owned());
    warn_of_area(grid, notes);
    warn_of_scale(grid, notes);
    notes.choose("crs", format!("EPSG:{}, heights above {}", grid.epsg, config.vertical), zone);
    let matched = match config.preset {
        Preset::Fast => "twice the coarsest image's",
        Preset::Balanced | Preset::Accurate => "the coarsest image's",
    };
    let coarsest = format!("{matched} {coarsest_gsd_m:.3} m, rounded to 5 cm");
    let cell = grid.geotransform.0;
    let in_units = match grid.projection().ok().and_then(|projection| projection.metres_per_unit()) {
        Some(1.0) => String::new(),
        Some(_) => format!(", {:.4} units of the map", cell[1]),
        None => format!(", {:.8}° × {:.8}°", cell[1], -cell[5]),
    };
    notes.choose("gsd", format!("{} m{in_units}", grid.gsd_m), given(config.gsd_m.is_some(), coarsest));
    let seen = given(
        config.bounds.is_some(),
        match config.area {
            Some(_) => "the rectangle around the area's polygons".to_owned(),
            None => "the ground that at least two images see".to_owned(),
        },
    );
    let bounds = grid.bounds().to_array().map(plain_number).join(", ");
    notes.choose("bounds", format!("[{bounds}], {} × {} cells", grid.size.0, grid.size.1), seen);
}

/// Rounds to whole multiples of 5 cm: a tidy number costs no detail.
fn rounded_gsd_m(gsd_m: f64) -> f64 {
    ((gsd_m * 20.0).round() / 20.0).max(0.05)
}

/// Returns the map rectangle of the ground that at least two images see.
fn covered_bounds(geometry: &ViewGeometry, projection: &MapProjection) -> Result<MapBounds, DsmError> {
    let hull = shared_ground(&geometry.outlines).ok_or(ReconstructError::NoOverlap { share_percent: 0.0 })?;
    let mut bounds = MapBounds::EMPTY;
    for p in hull.exterior().points() {
        let g = geometry.frame.ground_from_enu(geodesy::EnuPoint { east: p.x(), north: p.y(), up: 0.0 });
        let m = projection.map_from_lonlat(g.lon_deg, g.lat_deg)?;
        bounds = bounds.including(m.x, m.y);
    }
    Ok(bounds)
}
