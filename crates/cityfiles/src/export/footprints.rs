//! Writes the footprints of the objects with their heights as GeoJSON (RFC 7946: longitude and
//! latitude, WGS 84).
//!
//! The footprint of an object consists of its ground surfaces, or if it has none, of its surfaces
//! that face down. They are dissolved into polygons that are valid by OGC's rules. The attributes
//! and addresses of an object are among its properties.

use std::path::Path;

use city::{CityModel, ModelPoint, ObjectReport, ObjectStatus, SurfaceClass, SurfacePolygon};
use crs::MapProjection;
use geo::orient::Direction;
use geo::{Area, Coord, LineString, MultiPolygon, Orient, Polygon, unary_union};
use serde_json::{Value, json};

use crate::error::{CityError, CityFault};
use formats::atomic::write_stream;

/// Area of a polygon below which it is a sliver of rounding, m².
const AREA_MIN: f64 = 1e-4;

/// Counts of the objects in a file of footprints.
#[derive(Debug, Clone, Copy, PartialEq, Eq)]
pub struct Footprints {
    /// Objects with a footprint.
    pub written: usize,
    /// Objects that were used and have no surface that faces down.
    pub without: usize,
}

/// Writes the footprints of the objects that are used according to `reports`, at their level of
/// detail.
///
/// `reports` has one entry per object. The properties of a footprint are `id`, `kind`, `parent`,
/// `lod`, the heights `ground_m` and `top_m` in metres above the vertical datum of the model, and
/// their difference `height_m`. The attributes of the object follow, unless they have one of these
/// names, and its addresses as `address`.
///
/// # Errors
/// - [`CityError::Refused`] when the model has no known reference system (1010, 1011), or
///   coordinates that it cannot project (1002).
/// - [`CityError::NotWritten`] when the file exists and `overwrite` is false, or the system refuses
///   to write.
pub fn write_footprints(
    path: &Path,
    model: &CityModel,
    reports: &[ObjectReport],
    overwrite: bool,
) -> Result<Footprints, CityError> {
    let (features, count) = features(model, reports).map_err(|fault| fault.at(path))?;
    write_stream(path, overwrite, |out| {
        out.write_all(b"{\"type\":\"FeatureCollection\",\"features\":[")?;
        for (number, feature) in features.iter().enumerate() {
            out.write_all(if number == 0 { b"\n" } else { b",\n" })?;
            serde_json::to_writer(&mut *out, feature)?;
        }
        out.write_all(b"\n]}\n")
    })?;
    Ok(count)
}

fn features(model: &CityModel, reports: &[ObjectReport]) -> Result<(Vec<Value>, Footprints), CityFault> {
    use city::DefectCode::{CrsMissing, CrsUnknown};
    let Some(code) = model.crs.epsg else {
        let code = if model.crs.is_missing() { CrsMissing } else { CrsUnknown };
        let what = format!(
            "GeoJSON needs a model with a known reference system, the reference system of this one is {}",
            model.crs
        );
        return Err(CityFault::new(code, what, "model"));
    };
    let projection = MapProjection::from_definition(&format!("EPSG:{code}"))
        .map_err(|error| CityFault::new(CrsUnknown, error.to_string(), "model"))?;
    let mut count = Footprints { written: 0, without: 0 };
    let mut features = Vec::new();
    for (object, report) in model.objects.iter().zip(reports) {
        if !matches!(report.status, ObjectStatus::Used { .. }) {
            continue;
        }
        let geometries = object.geometries.iter().filter(|geometry| geometry.lod == report.lod);
        let surfaces: Vec<&SurfacePolygon> = geometries.flat_map(|geometry| &geometry.surfaces).collect();
        let heights = surfaces.iter().flat_map(|s| s.rings.iter().flatten()).map(|&i| position(model, i).z);
        let (low, high) = heights.fold((f64::INFINITY, f64::NEG_INFINITY), |(l, h), z| (l.min(z), h.max(z)));
        let origin = surfaces.first().and_then(|s| s.rings.first()?.first()).map(|&i| position(model, i));
        let origin = origin.unwrap_or_default();
        let footprint = dissolved(model, &bottom(model, &surfaces), origin);
        if footprint.0.is_empty() {
            count.without += 1;
            continue;
        }
        let polygons = coordinates(&footprint, origin, &projection)?;
        count.written += 1;
        let mut properties = json!({
            "id": object.id,
            "kind": object.kind.name(),
            "parent": object.parent.map(|parent| model.objects[parent].id.as_str()),
            "lod": report.lod.map(|lod| lod.to_string()),
            "ground_m": millimetres(low),
            "top_m": millimetres(high),
            "height_m": millimetres(high - low),
        });
        if let Some(properties) = properties.as_object_mut() {
            for (name, value) in &object.attributes {
                properties.entry(name).or_insert_with(|| value.clone());
            }
            if !object.addresses.is_empty() {
                properties.entry("address").or_insert_with(|| Value::Array(object.addresses.clone()));
            }
        }
        features.push(json!({
            "type": "Feature",
            "properties": properties,
            "geometry": { "type": "MultiPolygon", "coordinates": polygons },
        }));
    }
    Ok((features, count))
}

fn millimetres(value: f64) -> f64 {
    (value * 1e3).round() / 1e3
}

fn position(model: &CityModel, vertex: u32) -> ModelPoint {
    model.vertices[vertex as usize]
}

/// Returns the ground surfaces, or if there are none, the surfaces that face down.
fn bottom<'a>(model: &CityModel, surfaces: &[&'a SurfacePolygon]) -> Vec<&'a SurfacePolygon> {
    let ground = |surface: &&&SurfacePolygon| surface.class == SurfaceClass::Ground;
    let classed: Vec<&SurfacePolygon> = surfaces.iter().filter(ground).copied().collect();
    if !classed.is_empty() {
        return classed;
    }
    surfaces.iter().filter(|surface| faces_down(model, surface)).copied().collect()
}

/// Returns whether the outer ring is clockwise seen from above, and its slope is below 45 degrees.
fn faces_down(model: &CityModel, surface: &SurfacePolygon) -> bool {
    let Some(ring) = surface.rings.first().filter(|ring| ring.len() >= 3) else { return false };
    let origin = position(model, ring[0]);
    let at = |i: usize| position(model, ring[i % ring.len()]).from_origin(origin);
    let mut normal = [0.0; 3];
    for i in 0..ring.len() {
        let (a, b) = (at(i), at(i + 1));
        let cross = [a[1] * b[2] - a[2] * b[1], a[2] * b[0] - a[0] * b[2], a[0] * b[1] - a[1] * b[0]];
        normal.iter_mut().zip(cross).for_each(|(sum, c)| *sum += c);
    }
    -normal[2] > normal[0].hypot(normal[1])
}

/// Dissolves surfaces into one footprint, whose polygons are valid by OGC's rules: touching
/// surfaces are one polygon, and rings neither cross nor repeat themselves. Coordinates are metres
/// (units of the model) from `origin`. Slivers below [`AREA_MIN`] are rounding.
fn dissolved(model: &CityModel, surfaces: &[&SurfacePolygon], origin: ModelPoint) -> MultiPolygon {
    let ring = |ring: &Vec<u32>| -> LineString {
        let corner = |&vertex: &u32| {
            let [x, y, _] = position(model, vertex).from_origin(origin);
            // Whole millimetres, so that corners that are meant to be one are.
            Coord { x: millimetres(x), y: millimetres(y) }
        };
        ring.iter().map(corner).collect()
    };
    let polygon = |surface: &&SurfacePolygon| {
        let mut rings = surface.rings.iter().map(ring);
        let outer = rings.next().unwrap_or_else(|| LineString::new(Vec::new()));
        Polygon::new(outer, rings.collect()).orient(Direction::Default)
    };
    let polygons: Vec<Polygon> = surfaces.iter().map(polygon).filter(|p| p.unsigned_area() > 0.0).collect();
    let mut whole = unary_union(&polygons);
    whole.0.retain(|polygon| polygon.unsigned_area() > AREA_MIN);
    whole.orient(Direction::Default)
}

/// Returns polygons as GeoJSON: closed rings, the outer ones counter-clockwise seen from above,
/// holes clockwise, in longitude and latitude.
fn coordinates(footprint: &MultiPolygon, origin: ModelPoint, projection: &MapProjection) -> Result<Value, CityFault> {
    let place = |at: &Coord| -> Result<[f64; 2], CityFault> {
        let (lon, lat) = projection
            .lonlat_from_map(at.x + origin.x, at.y + origin.y)
            .map_err(|error| CityFault::new(city::DefectCode::CoordinateOutOfRange, error.to_string(), "model"))?;
        // 1e-9 degrees are about a tenth of a millimetre: the rounding folds no ring of
        // millimetres.
        Ok([lon, lat].map(|degrees| (degrees * 1e9).round() / 1e9))
    };
    let ring = |ring: &LineString| ring.0.iter().map(place).collect::<Result<Vec<_>, _>>().map(|points| json!(points));
    let polygon = |polygon: &Polygon| {
        let rings = std::iter::once(polygon.exterior()).chain(polygon.interiors());
        rings.map(ring).collect::<Result<Vec<Value>, _>>().map(Value::Array)
    };
    footprint.0.iter().map(polygon).collect::<Result<Vec<Value>, _>>().map(Value::Array)
}

#[cfg(test)]
mod tests {
    use city::{CrsReference, SurfaceClass};
    use geo::Validation;

    use super::*;

    /// Two squares that share an edge, one that repeats the first, and one that touches a corner.
    #[test]
    fn touching_surfaces_are_one_valid_polygon() {
        let mut model = CityModel::new(CrsReference::from_epsg(25832, None));
        let mut surfaces = Vec::new();
        for (x, y) in [(0.0, 0.0), (4.0, 0.0), (0.0, 0.0), (8.0, 4.0)] {
            let first = model.vertices.len() as u32;
            let corners = [(x, y), (x, y + 4.0), (x + 4.0, y + 4.0), (x + 4.0, y)];
            model.vertices.extend(corners.map(|(x, y)| ModelPoint::new(500_000.0 + x, 5_700_000.0 + y, 30.0)));
            surfaces.push(SurfacePolygon::new(vec![(first..first + 4).collect()], SurfaceClass::Ground));
        }
        let all: Vec<&SurfacePolygon> = surfaces.iter().collect();
        let footprint = dissolved(&model, &all, model.vertices[0]);
        assert!(footprint.is_valid(), "{footprint:?}");
        assert_eq!((footprint.0.len(), footprint.unsigned_area()), (2, 48.0));
    }
}
