//! Polygons of change: the regions that were found, and the volumes of a given layer.

use change::{Change, volume_of};
use crs::MapProjection;
use formats::areas::{AreaFeature, NamedAreas};
use geo::{Coord, LineString, MapCoords, MultiPolygon, Polygon};
use raster::{GeoTransform, Grid, mark_inside, outlines};
use serde_json::{Map, Value, json};

use super::error::DiffError;
use super::report::{AreaVolume, DiffRegion};

/// Returns the regions as polygons in longitude and latitude with their properties.
pub(super) fn of_regions(
    regions: &[DiffRegion],
    width: usize,
    transform: &GeoTransform,
    map: &MapProjection,
) -> Result<Vec<AreaFeature>, DiffError> {
    let on_ground = |&(column, row): &(f64, f64)| -> Result<Coord<f64>, DiffError> {
        let (x, y) = transform.map_from_cell(column, row);
        let (x, y) = map.lonlat_from_map(x, y)?;
        Ok(Coord { x, y })
    };
    let ring = |ring: &Vec<(f64, f64)>| -> Result<LineString<f64>, DiffError> {
        Ok(LineString(ring.iter().map(on_ground).collect::<Result<_, _>>()?))
    };
    let mut features = Vec::new();
    for region in regions {
        let mut polygons = Vec::new();
        for rings in outlines(&region.found.cells, width) {
            let mut rings = rings.iter().map(ring).collect::<Result<Vec<_>, _>>()?.into_iter();
            let Some(outer) = rings.next() else { continue };
            polygons.push(Polygon::new(outer, rings.collect()));
        }
        features.push(AreaFeature { polygons: MultiPolygon(polygons), properties: properties(json!(region)) });
    }
    Ok(features)
}

/// Returns the volumes of the polygons of a layer, and the polygons in longitude and latitude with
/// their volumes as properties.
pub(super) fn of_areas(
    layer: &NamedAreas,
    change: &Change,
    transform: &GeoTransform,
    map: &MapProjection,
) -> Result<(Vec<AreaVolume>, Vec<AreaFeature>), DiffError> {
    let own = MapProjection::from_definition(&layer.crs)?;
    let (mut volumes, mut features) = (Vec::new(), Vec::new());
    for (number, (name, polygons)) in (1..).zip(&layer.areas) {
        let on_ground = polygons.try_map_coords(|c| own.lonlat_from_map(c.x, c.y).map(|(x, y)| Coord { x, y }))?;
        let in_cells = on_ground.try_map_coords(|c| -> Result<Coord<f64>, DiffError> {
            let point = map.map_from_lonlat(c.x, c.y)?;
            let (x, y) = transform.cell_from_map(point.x, point.y).unwrap_or((f64::NAN, f64::NAN));
            Ok(Coord { x, y })
        })?;
        let mut inside = Grid::filled(change.difference.width(), change.difference.height(), false);
        for polygon in &in_cells {
            let rings = std::iter::once(polygon.exterior()).chain(polygon.interiors());
            let rings: Vec<Vec<(f64, f64)>> = rings.map(|ring| ring.0.iter().map(|c| (c.x, c.y)).collect()).collect();
            mark_inside(&rings, &mut inside);
        }
        let cells = inside.data().iter().enumerate().filter(|(_, inside)| **inside).map(|(at, _)| at);
        let name = name.clone().unwrap_or_else(|| number.to_string());
        let volume = AreaVolume { name, volume: volume_of(change, cells) };
        features.push(AreaFeature { polygons: on_ground, properties: properties(json!(volume)) });
        volumes.push(volume);
    }
    Ok((volumes, features))
}

fn properties(value: Value) -> Map<String, Value> {
    match value {
        Value::Object(map) => map,
        _ => Map::new(),
    }
}
