//! Reading areas by name: the polygons of a GeoPackage or a GeoJSON file.
//!
//! A GeoJSON file is in longitude and latitude (RFC 7946) unless it names another system in the way
//! of older files. Of each area the corners of its polygons are kept, holes included.

use std::path::{Path, PathBuf};

use gdal::vector::{Geometry, LayerAccess};
use gdal::{Dataset, DatasetOptions, GdalOpenFlags};
use serde_json::Value;

use crate::raster::{prepare_gdal, register_geopackage, with_gdal};
use crate::regular::read_regular;

/// Largest GeoJSON file that is read, bytes.
const SIZE_LIMIT: u64 = 256 << 20;
/// Most corners of an area.
const CORNERS_MAX: usize = 10_000_000;
/// System of GeoJSON files that name none.
const LONGITUDE_LATITUDE: &str = "EPSG:4326";

/// The corners of an area, in its coordinate reference system.
#[derive(Debug, Clone, PartialEq)]
#[non_exhaustive]
pub struct AreaCorners {
    /// Definition of the system, for PROJ.
    pub crs: String,
    /// Easting and northing, or longitude and latitude.
    pub corners: Vec<(f64, f64)>,
}

/// Place of an area in a file.
#[derive(Debug, Clone, Copy)]
pub struct AreaName<'a> {
    /// Layer of a GeoPackage; its only one when `None`.
    pub layer: Option<&'a str>,
    /// Field that holds names.
    pub field: &'a str,
    /// Name of the area.
    pub name: &'a str,
}

/// An area that cannot be read.
#[derive(Debug, thiserror::Error)]
#[error("cannot read the area ({what}): {}", path.display())]
#[non_exhaustive]
pub struct AreaError {
    /// The file.
    pub path: PathBuf,
    /// Text found and text expected.
    pub what: String,
}

/// Reads the area of a name from a GeoPackage (`.gpkg`) or a GeoJSON file.
///
/// ```
/// # let folder = tempfile::tempdir()?;
/// let path = folder.path().join("areas.geojson");
/// std::fs::write(&path, r#"{"type": "FeatureCollection", "features": [{"type": "Feature",
///     "properties": {"name": "north"}, "geometry": {"type": "Polygon",
///     "coordinates": [[[5.0, 43.0], [5.1, 43.0], [5.1, 43.2], [5.0, 43.0]]]}}]}"#)?;
/// let area = io::areas::read(&path, io::areas::AreaName { layer: None, field: "name", name: "north" })?;
/// assert_eq!((area.crs.as_str(), area.corners[2]), ("EPSG:4326", (5.1, 43.2)));
/// # Ok::<(), Box<dyn std::error::Error>>(())
/// ```
///
/// # Errors
/// [`AreaError`] for a file that cannot be read, for a name that no polygon or more than one
/// feature has, and for a layer without a reference system.
pub fn read(path: &Path, wanted: AreaName<'_>) -> Result<AreaCorners, AreaError> {
    let is_package = path.extension().is_some_and(|extension| extension.eq_ignore_ascii_case("gpkg"));
    let read = if is_package { geopackage(path, wanted) } else { geojson(path, wanted) };
    let checked = read.and_then(|area| {
        let is_finite = area.corners.iter().all(|(x, y)| x.is_finite() && y.is_finite());
        match area.corners.len() {
            0..3 => Err(format!("{:?} has no polygon", wanted.name)),
            3..=CORNERS_MAX if is_finite => Ok(area),
            _ => Err(format!("{:?} has corners that are no numbers, or too many", wanted.name)),
        }
    });
    checked.map_err(|what| AreaError { path: path.to_owned(), what })
}

/// Returns the only one of the features of a name, or why there is none.
fn only<T>(mut found: Vec<T>, wanted: AreaName<'_>, names: &[String]) -> Result<T, String> {
    const SHOWN: usize = 8;
    let AreaName { field, name, .. } = wanted;
    match (found.pop(), found.is_empty()) {
        (Some(one), true) => Ok(one),
        (Some(_), false) => Err(format!("{} features have the {field} {name:?}, expected one", found.len() + 1)),
        (None, _) => {
            let known: Vec<&str> = names.iter().take(SHOWN).map(String::as_str).collect();
            Err(format!("no feature has the {field} {name:?}; there are {}", known.join(", ")))
        }
    }
}

fn geojson(path: &Path, wanted: AreaName<'_>) -> Result<AreaCorners, String> {
    let bytes = read_regular(path, SIZE_LIMIT).map_err(|e| e.to_string())?;
    let json: Value = serde_json::from_slice(&bytes).map_err(|e| e.to_string())?;
    let features = json["features"].as_array().ok_or("it is no collection of GeoJSON features")?;
    let name_of = |feature: &Value| match &feature["properties"][wanted.field] {
        Value::String(text) => Some(text.clone()),
        Value::Number(number) => Some(number.to_string()),
        _ => None,
    };
    let names: Vec<String> = features.iter().filter_map(name_of).collect();
    let found = features.iter().filter(|feature| name_of(feature).as_deref() == Some(wanted.name)).collect();
    let geometry = &only(found, wanted, &names)?["geometry"];
    let mut corners = Vec::new();
    if matches!(geometry["type"].as_str(), Some("Polygon" | "MultiPolygon")) {
        positions(&geometry["coordinates"], &mut corners);
    }
    // "urn:ogc:def:crs:EPSG::32631", "EPSG:32631"; "urn:ogc:def:crs:OGC:1.3:CRS84".
    let named = json["crs"]["properties"]["name"].as_str().filter(|name| name.contains("EPSG"));
    let code = named.and_then(|name| name.rsplit(':').next());
    let crs = code.map_or_else(|| LONGITUDE_LATITUDE.to_owned(), |code| format!("EPSG:{code}"));
    Ok(AreaCorners { crs, corners })
}

/// Collects the positions of nested arrays of coordinates. JSON is at most 128 arrays deep.
fn positions(coordinates: &Value, corners: &mut Vec<(f64, f64)>) {
    let Some(all) = coordinates.as_array() else { return };
    match all.as_slice() {
        [Value::Number(x), Value::Number(y), ..] => {
            corners.push((x.as_f64().unwrap_or(f64::NAN), y.as_f64().unwrap_or(f64::NAN)));
        }
        inner => inner.iter().for_each(|inner| positions(inner, corners)),
    }
}

fn geopackage(path: &Path, wanted: AreaName<'_>) -> Result<AreaCorners, String> {
    if !path.metadata().map_err(|e| e.to_string())?.is_file() {
        return Err("it is not a regular file".to_owned());
    }
    prepare_gdal();
    register_geopackage();
    let options = DatasetOptions {
        open_flags: GdalOpenFlags::GDAL_OF_VECTOR | GdalOpenFlags::GDAL_OF_READONLY,
        allowed_drivers: Some(&["GPKG"]),
        ..DatasetOptions::default()
    };
    let dataset = with_gdal(|| Dataset::open_ex(path, options))?;
    let mut layer = match wanted.layer {
        Some(name) => with_gdal(|| dataset.layer_by_name(name))?,
        None if dataset.layer_count() == 1 => with_gdal(|| dataset.layer(0))?,
        None => {
            let names: Vec<String> = dataset.layers().map(|layer| layer.name()).collect();
            return Err(format!("it has {} layers, name one of {}", names.len(), names.join(", ")));
        }
    };
    let crs = layer.spatial_ref().and_then(|system| system.to_wkt().ok()).ok_or("the layer has no reference system")?;
    let (mut names, mut found) = (Vec::new(), Vec::new());
    for feature in layer.features() {
        let field =
            feature.field_index(wanted.field).map_err(|_| format!("the layer has no field {}", wanted.field))?;
        let Ok(Some(name)) = feature.field_as_string(field) else { continue };
        if name == wanted.name {
            let mut corners = Vec::new();
            if let Some(geometry) = feature.geometry() {
                corners_of(geometry, &mut corners);
            }
            found.push(corners);
        }
        names.push(name);
    }
    Ok(AreaCorners { crs, corners: only(found, wanted, &names)? })
}

/// Collects the corners of a geometry and of its parts.
fn corners_of(geometry: &Geometry, corners: &mut Vec<(f64, f64)>) {
    let mut points = Vec::new();
    geometry.get_points(&mut points);
    corners.extend(points.into_iter().map(|(x, y, _)| (x, y)));
    for part in 0..geometry.geometry_count() {
        corners_of(&geometry.get_geometry(part), corners);
    }
}

#[cfg(test)]
mod tests {
    use super::*;
    use gdal::spatial_ref::SpatialRef;
    use gdal::vector::{FieldDefn, LayerOptions, OGRFieldType, OGRwkbGeometryType};

    fn named<'a>(layer: Option<&'a str>, name: &'a str) -> AreaName<'a> {
        AreaName { layer, field: "name", name }
    }

    #[test]
    fn geopackages_give_their_corners_and_their_map() {
        let folder = tempfile::tempdir().unwrap();
        let path = folder.path().join("areas.gpkg");
        prepare_gdal();
        register_geopackage();
        let Ok(driver) = gdal::DriverManager::get_driver_by_name("GPKG") else { return };
        let mut dataset = driver.create_vector_only(&path).unwrap();
        let srs = SpatialRef::from_epsg(32631).unwrap();
        for name in ["blocks", "others"] {
            let options = LayerOptions { name, srs: Some(&srs), ty: OGRwkbGeometryType::wkbPolygon, options: None };
            let layer = dataset.create_layer(options).unwrap();
            FieldDefn::new("name", OGRFieldType::OFTString).unwrap().add_to_layer(&layer).unwrap();
            let mut feature = gdal::vector::Feature::new(layer.defn()).unwrap();
            feature.set_field_string(feature.field_index("name").unwrap(), "north").unwrap();
            feature.set_geometry(Geometry::bbox(693_000.0, 4_822_000.0, 693_500.0, 4_822_400.0).unwrap()).unwrap();
            feature.create(&layer).unwrap();
        }
        drop(dataset);
        let area = read(&path, named(Some("blocks"), "north")).unwrap();
        assert!(area.crs.contains("UTM zone 31N"), "{}", area.crs);
        assert!(area.corners.contains(&(693_500.0, 4_822_400.0)), "{:?}", area.corners);
        let told = read(&path, named(None, "north")).unwrap_err().to_string();
        assert!(told.contains("2 layers, name one of blocks, others"), "{told}");
        let told = read(&path, named(Some("blocks"), "south")).unwrap_err().to_string();
        assert!(told.contains("no feature has the name \"south\"; there are north"), "{told}");
    }

    #[test]
    fn geojson_that_is_wrong_is_told() {
        let folder = tempfile::tempdir().unwrap();
        let path = folder.path().join("a.geojson");
        let feature =
            r#"{"properties": {"name": "a"}, "geometry": {"type": "TYPE", "coordinates": [[[1, 2], [3, 4], [5, 6]]]}}"#;
        let polygon = feature.replace("TYPE", "Polygon");
        for (text, words) in [
            ("{".to_owned(), "EOF"),
            ("{}".to_owned(), "no collection"),
            (format!("{{\"features\": [{feature}]}}"), "has no polygon"),
            (format!("{{\"features\": [{polygon}, {polygon}]}}"), "2 features have the name"),
        ] {
            std::fs::write(&path, &text).unwrap();
            let told = read(&path, named(None, "a")).unwrap_err().to_string();
            assert!(told.contains(words), "{text}: {told}");
        }
        let crs = r#""crs": {"type": "name", "properties": {"name": "urn:ogc:def:crs:EPSG::2154"}}"#;
        std::fs::write(&path, format!("{{{crs}, \"features\": [{polygon}]}}")).unwrap();
        assert_eq!(read(&path, named(None, "a")).unwrap().crs, "EPSG:2154");
    }
}
