//! Writes the footprints of the objects with their heights as GeoJSON (RFC 7946: longitude and
//! latitude, WGS 84).
//!
//! The footprint of an object consists of its ground surfaces, or if it has none, of its surfaces
//! that face down. Polygons that touch are not merged.

use std::path::Path;

use city::{CityModel, ModelPoint, ObjectReport, ObjectStatus, SurfaceClass, SurfacePolygon};
use crs::MapProjection;
use serde_json::{Value, json};

use crate::atomic::write_stream;
use crate::citymodel::error::{CityError, CityFault};

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
/// their difference `height_m`.
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
        let polygons: Result<Vec<Value>, CityFault> =
            bottom(model, &surfaces).into_iter().map(|surface| polygon(model, surface, &projection)).collect();
        let polygons = polygons?;
        if polygons.is_empty() {
            count.without += 1;
            continue;
        }
        count.written += 1;
        features.push(json!({
            "type": "Feature",
            "properties": {
                "id": object.id,
                "kind": object.kind.name(),
                "parent": object.parent.map(|parent| model.objects[parent].id.as_str()),
                "lod": report.lod.map(|lod| lod.to_string()),
                "ground_m": millimetres(low),
                "top_m": millimetres(high),
                "height_m": millimetres(high - low),
            },
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

/// Returns the rings as GeoJSON: closed, the outer ring counter-clockwise seen from above, holes
/// clockwise.
fn polygon(model: &CityModel, surface: &SurfacePolygon, projection: &MapProjection) -> Result<Value, CityFault> {
    let ring = |(number, ring): (usize, &Vec<u32>)| -> Result<Value, CityFault> {
        let mut points: Vec<[f64; 2]> = Vec::with_capacity(ring.len() + 1);
        for &vertex in ring {
            let at = position(model, vertex);
            let (lon, lat) = projection
                .lonlat_from_map(at.x, at.y)
                .map_err(|error| CityFault::new(city::DefectCode::CoordinateOutOfRange, error.to_string(), "model"))?;
            // 1e-8 degrees are about a millimetre.
            points.push([lon, lat].map(|degrees| (degrees * 1e8).round() / 1e8));
        }
        let turn = |i: usize| {
            let (a, b) = (points[i], points[(i + 1) % points.len()]);
            (a[0] - points[0][0]) * (b[1] - points[0][1]) - (b[0] - points[0][0]) * (a[1] - points[0][1])
        };
        let counter_clockwise = (0..points.len()).map(turn).sum::<f64>() > 0.0;
        if counter_clockwise != (number == 0) {
            points.reverse();
        }
        points.extend(points.first().copied());
        Ok(json!(points))
    };
    surface.rings.iter().enumerate().map(ring).collect::<Result<Vec<Value>, _>>().map(Value::Array)
}
