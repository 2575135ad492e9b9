//! Vectors for display: points, lines and polygons of a GeoJSON file, a GeoPackage or a shapefile,
//! with their attributes.
//!
//! A GeoJSON file is in longitude and latitude (RFC 7946) unless it names another system in the way
//! of older files. Curves and heights are left out; what is read is bounded.

use std::path::Path;

use gdal::vector::{FieldValue, LayerAccess};
use geo::Coord;
use serde_json::{Map, Value, json};

use crate::areas::{AreaError, open_vector_file, system_of_geojson};
use crate::raster::{VectorFormat, with_gdal};
use crate::regular::read_regular;

/// Largest GeoJSON file that is read, bytes.
const SIZE_LIMIT: u64 = 64 << 20;
/// Most corners of all layers of a file: a browser draws so many in a fraction of a second.
const CORNERS_MAX: usize = 1_000_000;
/// Most features of all layers of a file, and most attributes of a feature.
const FEATURES_MAX: usize = 200_000;
const ATTRIBUTES_MAX: usize = 64;

/// Features of a layer in one reference system.
#[derive(Debug, Clone, PartialEq)]
#[non_exhaustive]
pub struct VectorLayer {
    /// Name of the layer; that of the file in GeoJSON.
    pub name: String,
    /// Definition of the system, for PROJ.
    pub crs: String,
    /// The features that have a place.
    pub features: Vec<VectorFeature>,
}

/// A feature with its attributes.
#[derive(Debug, Clone, PartialEq)]
pub struct VectorFeature {
    /// What its parts are.
    pub kind: VectorKind,
    /// Rings of polygons, lines, or points one by one: easting and northing, or longitude and
    /// latitude.
    pub parts: Vec<Vec<Coord<f64>>>,
    /// Attributes by name: texts and numbers.
    pub properties: Map<String, Value>,
}

/// What the parts of a feature are.
#[derive(Debug, Clone, Copy, PartialEq, Eq)]
pub enum VectorKind {
    /// Points.
    Points,
    /// Lines.
    Lines,
    /// Rings of polygons; a hole is a ring inside another one.
    Polygons,
}

/// Whether the ending of a name is that of a file that [`read_vectors`] reads.
pub fn is_vector_name(path: &Path) -> bool {
    let ending = path.extension().unwrap_or_default().to_string_lossy().to_ascii_lowercase();
    matches!(ending.as_str(), "geojson" | "json" | "gpkg" | "shp")
}

/// Reads all layers of a file.
///
/// ```
/// # let folder = tempfile::tempdir()?;
/// let path = folder.path().join("lines.geojson");
/// std::fs::write(&path, r#"{"type": "FeatureCollection", "features": [{"type": "Feature",
///     "properties": {"elevation": 12.5}, "geometry": {"type": "LineString",
///     "coordinates": [[5.0, 43.0], [5.1, 43.0]]}}]}"#)?;
/// let layers = formats::vectors::read_vectors(&path)?;
/// assert_eq!((layers[0].name.as_str(), layers[0].features[0].parts[0][1].x), ("lines", 5.1));
/// # Ok::<(), Box<dyn std::error::Error>>(())
/// ```
///
/// # Errors
/// [`AreaError`] for a file that cannot be read, for layers without a reference system, and for
/// more than a million corners.
pub fn read_vectors(path: &Path) -> Result<Vec<VectorLayer>, AreaError> {
    let ending = path.extension().map(|extension| extension.to_string_lossy().to_ascii_lowercase());
    let read = match ending.as_deref() {
        Some("gpkg") => through_gdal(path, VectorFormat::GeoPackage),
        Some("shp") => through_gdal(path, VectorFormat::Shapefile),
        _ => geojson(path).map(|layer| vec![layer]),
    };
    read.map_err(|what| AreaError { path: path.to_owned(), what })
}

/// Counts what was read, and stops what is too much.
#[derive(Default)]
struct Bounded {
    corners: usize,
    features: usize,
}

impl Bounded {
    /// Returns a feature of a geometry of GeoJSON; `None` for one without a place.
    fn feature(&mut self, geometry: &Value, properties: Map<String, Value>) -> Result<Option<VectorFeature>, String> {
        let Some((kind, parts)) = parts_of(geometry) else { return Ok(None) };
        self.features += 1;
        self.corners += parts.iter().map(Vec::len).sum::<usize>();
        if self.corners > CORNERS_MAX || self.features > FEATURES_MAX {
            return Err(format!(
                "it has more than {CORNERS_MAX} corners or {FEATURES_MAX} features, which no page draws: simplify it \
                 (ogr2ogr -simplify) or cut it out (ogr2ogr -clipsrc)"
            ));
        }
        let properties = properties.into_iter().filter(|(_, value)| !value.is_object() && !value.is_array());
        Ok(Some(VectorFeature { kind, parts, properties: properties.take(ATTRIBUTES_MAX).collect() }))
    }
}

/// Returns the parts of a geometry of GeoJSON; `None` without a corner.
fn parts_of(geometry: &Value) -> Option<(VectorKind, Vec<Vec<Coord<f64>>>)> {
    let corner = |position: &Value| {
        let (x, y) = (position.get(0)?.as_f64()?, position.get(1)?.as_f64()?);
        (x.is_finite() && y.is_finite()).then_some(Coord { x, y })
    };
    let line = |positions: &Value| positions.as_array().into_iter().flatten().filter_map(corner).collect::<Vec<_>>();
    let lines = |all: &Value| all.as_array().into_iter().flatten().map(line).collect::<Vec<_>>();
    let coordinates = &geometry["coordinates"];
    let (kind, mut parts) = match geometry["type"].as_str()? {
        "Point" => (VectorKind::Points, vec![corner(coordinates).into_iter().collect()]),
        "MultiPoint" => (VectorKind::Points, line(coordinates).into_iter().map(|point| vec![point]).collect()),
        "LineString" => (VectorKind::Lines, vec![line(coordinates)]),
        "MultiLineString" => (VectorKind::Lines, lines(coordinates)),
        "Polygon" => (VectorKind::Polygons, lines(coordinates)),
        "MultiPolygon" => {
            let polygons = coordinates.as_array().into_iter().flatten();
            (VectorKind::Polygons, polygons.flat_map(lines).collect())
        }
        _ => return None,
    };
    parts.retain(|part| !part.is_empty());
    (!parts.is_empty()).then_some((kind, parts))
}

fn geojson(path: &Path) -> Result<VectorLayer, String> {
    let bytes = read_regular(path, SIZE_LIMIT).map_err(|e| e.to_string())?;
    let json: Value = serde_json::from_slice(&bytes).map_err(|e| e.to_string())?;
    let features = json["features"].as_array().ok_or("it is no collection of GeoJSON features")?;
    let mut bounded = Bounded::default();
    let mut found = Vec::new();
    for feature in features {
        let properties = feature["properties"].as_object().cloned().unwrap_or_default();
        found.extend(bounded.feature(&feature["geometry"], properties)?);
    }
    let name = path.file_stem().unwrap_or_default().to_string_lossy().into_owned();
    Ok(VectorLayer { name, crs: system_of_geojson(&json), features: found })
}

fn through_gdal(path: &Path, format: VectorFormat) -> Result<Vec<VectorLayer>, String> {
    let dataset = open_vector_file(path, format)?;
    let mut bounded = Bounded::default();
    let mut layers = Vec::new();
    for mut layer in dataset.layers() {
        let name = layer.name();
        let crs = layer
            .spatial_ref()
            .and_then(|system| system.to_wkt().ok())
            .ok_or_else(|| format!("the layer {name} has no reference system"))?;
        let mut features = Vec::new();
        for feature in layer.features() {
            let Some(geometry) = feature.geometry() else { continue };
            let geometry: Value =
                serde_json::from_str(&with_gdal(|| geometry.json())?).map_err(|error| error.to_string())?;
            let properties = feature.fields().filter_map(|(name, value)| Some((name, value_of(value?)?)));
            features.extend(bounded.feature(&geometry, properties.collect())?);
        }
        layers.push(VectorLayer { name, crs, features });
    }
    Ok(layers)
}

/// Returns a field that is a number or a text.
fn value_of(field: FieldValue) -> Option<Value> {
    match field {
        FieldValue::IntegerValue(value) => Some(json!(value)),
        FieldValue::Integer64Value(value) => Some(json!(value)),
        FieldValue::RealValue(value) => Some(json!(value)),
        FieldValue::StringValue(text) => Some(json!(text)),
        FieldValue::DateValue(date) => Some(json!(date.to_string())),
        _ => None,
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn every_geometry_has_its_parts() {
        let folder = tempfile::tempdir().unwrap();
        let path = folder.path().join("all.geojson");
        let ring = json!([[0, 0], [4, 0], [4, 4], [0, 0]]);
        let geometries = [
            json!({"type": "Point", "coordinates": [1, 2, 3]}),
            json!({"type": "MultiPoint", "coordinates": [[1, 2], [3, 4]]}),
            json!({"type": "LineString", "coordinates": [[1, 2], [3, 4]]}),
            json!({"type": "MultiPolygon", "coordinates": [[ring, ring], [ring]]}),
            json!({"type": "LineString", "coordinates": []}),
            json!({"type": "LineString", "coordinates": [["a", null]]}),
            Value::Null,
        ];
        let feature = |geometry: &Value| json!({"type": "Feature", "geometry": geometry, "properties": {"id": 7, "deep": {"x": 1}, "list": [1]}});
        let features: Vec<Value> = geometries.iter().map(feature).collect();
        std::fs::write(&path, json!({"type": "FeatureCollection", "features": features}).to_string()).unwrap();
        let layers = read_vectors(&path).unwrap();
        let found: Vec<_> = layers[0].features.iter().map(|f| (f.kind, f.parts.len())).collect();
        let (points, lines, polygons) = (VectorKind::Points, VectorKind::Lines, VectorKind::Polygons);
        assert_eq!(found, [(points, 1), (points, 2), (lines, 1), (polygons, 3)]);
        assert_eq!(Value::Object(layers[0].features[0].properties.clone()), json!({"id": 7}));
        std::fs::write(&path, "[]").unwrap();
        assert!(read_vectors(&path).unwrap_err().to_string().contains("no collection"));
    }

    #[test]
    fn too_many_corners_are_refused() {
        let mut bounded = Bounded { corners: CORNERS_MAX, features: 0 };
        let point = json!({"type": "Point", "coordinates": [1, 2]});
        assert!(bounded.feature(&point, Map::new()).unwrap_err().contains("simplify"));
    }
}
