//! Areas: the polygons of a GeoPackage, a shapefile, a GeoParquet or a GeoJSON file, and writing
//! polygons as GeoJSON.
//!
//! A GeoJSON file is in longitude and latitude (RFC 7946) unless it names another system in the way
//! of older files.

use std::path::{Path, PathBuf};

use gdal::vector::LayerAccess;
use gdal::{Dataset, DatasetOptions, GdalOpenFlags};
use geo::{Coord, CoordsIter, LineString, MultiPolygon, Polygon};
use numeric::failures;
use serde_json::{Value, json};

use crate::atomic::{SaveError, write_stream};
use crate::geoparquet;
use crate::raster::{VectorFormat, prepare_gdal, register_vector, with_gdal};
use crate::regular::read_regular;

/// Largest GeoJSON file that is read, bytes.
const SIZE_LIMIT: u64 = 256 << 20;
/// Most corners of an area.
const CORNERS_MAX: usize = 10_000_000;
/// System of GeoJSON files that name none.
const LONGITUDE_LATITUDE: &str = "EPSG:4326";

/// Polygons in a coordinate reference system.
#[derive(Debug, Clone, PartialEq)]
#[non_exhaustive]
pub struct Area {
    /// Definition of the system, for PROJ.
    pub crs: String,
    /// Polygons, whose corners are easting and northing, or longitude and latitude.
    pub polygons: MultiPolygon<f64>,
}

/// Place of an area in a file.
#[derive(Debug, Clone, Copy)]
pub struct AreaName<'a> {
    /// Layer of a GeoPackage; its only one when `None`.
    pub layer: Option<&'a str>,
    /// Field that holds names.
    pub field: &'a str,
    /// Name of the area; all polygons of the layer when `None`.
    pub name: Option<&'a str>,
}

impl AreaName<'_> {
    /// All polygons of the only layer.
    pub const ALL: Self = Self { layer: None, field: "", name: None };
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

failures!(AreaError: File);

/// Reads the area of a name, or all areas, from a GeoPackage (`.gpkg`), a shapefile (`.shp`), a
/// GeoParquet file (`.parquet`) or a GeoJSON file.
///
/// ```
/// # let folder = tempfile::tempdir()?;
/// use formats::areas::AreaName;
///
/// let path = folder.path().join("areas.geojson");
/// std::fs::write(&path, r#"{"type": "FeatureCollection", "features": [{"type": "Feature",
///     "properties": {"name": "north"}, "geometry": {"type": "Polygon",
///     "coordinates": [[[5.0, 43.0], [5.1, 43.0], [5.1, 43.2], [5.0, 43.0]]]}}]}"#)?;
/// let area = formats::areas::read(&path, AreaName { layer: None, field: "name", name: Some("north") })?;
/// assert_eq!((area.crs.as_str(), area.polygons.0[0].exterior().0[2].x), ("EPSG:4326", 5.1));
/// assert_eq!(area, formats::areas::read(&path, AreaName::ALL)?);
/// # Ok::<(), Box<dyn std::error::Error>>(())
/// ```
///
/// # Errors
/// [`AreaError`] for a file that cannot be read, for a name that no polygon or more than one
/// feature has, and for a layer without a reference system.
pub fn read(path: &Path, wanted: AreaName<'_>) -> Result<Area, AreaError> {
    let read = layer(path, wanted).and_then(|(crs, features)| Ok(Area { crs, polygons: chosen(features, wanted)? }));
    let checked = read.and_then(|area| {
        let what = wanted.name.map_or_else(|| "the layer".to_owned(), |name| format!("{name:?}"));
        let is_finite = area.polygons.coords_iter().all(|c| c.x.is_finite() && c.y.is_finite());
        match area.polygons.coords_count() {
            0..3 => Err(format!("{what} has no polygon")),
            3..=CORNERS_MAX if is_finite => Ok(area),
            _ => Err(format!("{what} has corners that are no numbers, or too many")),
        }
    });
    checked.map_err(|what| AreaError { path: path.to_owned(), what })
}

/// Areas of a layer, one for each feature with polygons.
#[derive(Debug, Clone, PartialEq)]
#[non_exhaustive]
pub struct NamedAreas {
    /// Definition of the system, for PROJ.
    pub crs: String,
    /// Names, where the features have them, and polygons.
    pub areas: Vec<(Option<String>, MultiPolygon<f64>)>,
}

/// Reads all features with polygons of a layer. `layer` names the layer of a GeoPackage with
/// several, `field` the field that holds the names, if any.
///
/// # Errors
/// [`AreaError`] for a file that cannot be read, for one without polygons, and for a layer without
/// a reference system.
pub fn read_features(path: &Path, layer_name: Option<&str>, field: Option<&str>) -> Result<NamedAreas, AreaError> {
    let wanted = AreaName { layer: layer_name, field: field.unwrap_or_default(), name: None };
    let failed = |what: String| AreaError { path: path.to_owned(), what };
    let (crs, features) = layer(path, wanted).map_err(failed)?;
    let areas: Vec<_> = features
        .into_iter()
        .filter(|feature| !feature.polygons.is_empty())
        .map(|feature| (feature.name, MultiPolygon(feature.polygons)))
        .collect();
    let corners = || areas.iter().flat_map(|(_, polygons)| polygons.coords_iter());
    match corners().count() {
        0 => Err(failed("the layer has no polygon".to_owned())),
        1..=CORNERS_MAX if corners().all(|c| c.x.is_finite() && c.y.is_finite()) => Ok(NamedAreas { crs, areas }),
        _ => Err(failed("the layer has corners that are no numbers, or too many".to_owned())),
    }
}

/// A polygon with properties to write.
#[derive(Debug, Clone, PartialEq)]
pub struct AreaFeature {
    /// Polygons in longitude and latitude.
    pub polygons: MultiPolygon<f64>,
    /// Properties by name.
    pub properties: serde_json::Map<String, Value>,
}

/// Writes polygons with their properties as GeoJSON (RFC 7946).
///
/// # Errors
/// [`SaveError::Exists`] when the file exists and `overwrite` is false; [`SaveError::Unwritable`].
pub fn write(path: &Path, features: &[AreaFeature], overwrite: bool) -> Result<(), SaveError> {
    // A hundred-millionth of a degree is a millimetre.
    let position = |c: &Coord<f64>| [(c.x * 1e8).round() / 1e8, (c.y * 1e8).round() / 1e8];
    let ring = |ring: &LineString<f64>| ring.0.iter().map(position).collect::<Vec<_>>();
    let rings = |p: &Polygon<f64>| std::iter::once(p.exterior()).chain(p.interiors()).map(ring).collect::<Vec<_>>();
    write_stream(path, overwrite, |out| {
        out.write_all(b"{\"type\":\"FeatureCollection\",\"features\":[")?;
        for (number, feature) in features.iter().enumerate() {
            out.write_all(if number == 0 { b"\n" } else { b",\n" })?;
            let coordinates: Vec<_> = feature.polygons.iter().map(rings).collect();
            let geometry = json!({"type": "MultiPolygon", "coordinates": coordinates});
            let feature = json!({"type": "Feature", "properties": feature.properties, "geometry": geometry});
            serde_json::to_writer(&mut *out, &feature)?;
        }
        out.write_all(b"\n]}\n")
    })
}

/// A feature with its polygons.
struct Feature {
    name: Option<String>,
    polygons: Vec<Polygon<f64>>,
}

/// Reads the reference system and the features of a layer.
fn layer(path: &Path, wanted: AreaName<'_>) -> Result<(String, Vec<Feature>), String> {
    let ending = path.extension().map(|extension| extension.to_string_lossy().to_ascii_lowercase());
    match ending.as_deref() {
        Some("gpkg") => through_gdal(path, VectorFormat::GeoPackage, wanted),
        Some("shp") => through_gdal(path, VectorFormat::Shapefile, wanted),
        Some("parquet" | "geoparquet") => {
            let (crs, features) = geoparquet::read(path, wanted.field)?;
            Ok((crs, features.into_iter().map(|(name, polygons)| Feature { name, polygons }).collect()))
        }
        _ => geojson(path, wanted),
    }
}

/// Returns the polygons of the only feature of a name, or those of all features.
fn chosen(features: Vec<Feature>, wanted: AreaName<'_>) -> Result<MultiPolygon<f64>, String> {
    const SHOWN: usize = 8;
    let AreaName { field, name: Some(name), .. } = wanted else {
        return Ok(features.into_iter().flat_map(|feature| feature.polygons).collect());
    };
    let (mut found, others): (Vec<Feature>, Vec<Feature>) =
        features.into_iter().partition(|feature| feature.name.as_deref() == Some(name));
    match (found.pop(), found.is_empty()) {
        (Some(one), true) => Ok(MultiPolygon(one.polygons)),
        (Some(_), false) => Err(format!("{} features have the {field} {name:?}, expected one", found.len() + 1)),
        (None, _) => {
            let known: Vec<String> = others.into_iter().filter_map(|feature| feature.name).take(SHOWN).collect();
            Err(format!("no feature has the {field} {name:?}; there are {}", known.join(", ")))
        }
    }
}

fn geojson(path: &Path, wanted: AreaName<'_>) -> Result<(String, Vec<Feature>), String> {
    let bytes = read_regular(path, SIZE_LIMIT).map_err(|e| e.to_string())?;
    let json: Value = serde_json::from_slice(&bytes).map_err(|e| e.to_string())?;
    let features = json["features"].as_array().ok_or("it is no collection of GeoJSON features")?;
    let feature = |feature: &Value| {
        let geometry = &feature["geometry"];
        let parts = match geometry["type"].as_str() {
            Some("Polygon") => vec![&geometry["coordinates"]],
            Some("MultiPolygon") => geometry["coordinates"].as_array().into_iter().flatten().collect(),
            _ => Vec::new(),
        };
        let name = match &feature["properties"][wanted.field] {
            Value::String(text) => Some(text.clone()),
            Value::Number(number) => Some(number.to_string()),
            _ => None,
        };
        Feature { name, polygons: parts.into_iter().filter_map(polygon).collect() }
    };
    let features = features.iter().map(feature).collect();
    Ok((system_of_geojson(&json), features))
}

/// Returns the reference system of a GeoJSON file: longitude and latitude unless it names another
/// one in the way of older files.
pub(crate) fn system_of_geojson(json: &Value) -> String {
    // "urn:ogc:def:crs:EPSG::32631", "EPSG:32631"; "urn:ogc:def:crs:OGC:1.3:CRS84".
    let named = json["crs"]["properties"]["name"].as_str().filter(|name| name.contains("EPSG"));
    let code = named.and_then(|name| name.rsplit(':').next());
    code.map_or_else(|| LONGITUDE_LATITUDE.to_owned(), |code| format!("EPSG:{code}"))
}

/// Makes a polygon of an array of rings, the outer one first.
fn polygon(rings: &Value) -> Option<Polygon<f64>> {
    let number = |value: Option<&Value>| value.and_then(Value::as_f64).unwrap_or(f64::NAN);
    let corner = |position: &Value| {
        let position = position.as_array().map_or(&[][..], Vec::as_slice);
        Coord { x: number(position.first()), y: number(position.get(1)) }
    };
    let ring = |ring: &Value| Some(LineString(ring.as_array()?.iter().map(corner).collect()));
    let mut rings = rings.as_array()?.iter().filter_map(ring);
    Some(Polygon::new(rings.next()?, rings.collect()))
}

/// Opens a regular file with the driver of its format alone.
pub(crate) fn open_vector_file(path: &Path, format: VectorFormat) -> Result<Dataset, String> {
    if !path.metadata().map_err(|e| e.to_string())?.is_file() {
        return Err("it is not a regular file".to_owned());
    }
    prepare_gdal();
    register_vector(format);
    let options = DatasetOptions {
        open_flags: GdalOpenFlags::GDAL_OF_VECTOR | GdalOpenFlags::GDAL_OF_READONLY,
        allowed_drivers: Some(&[format.driver()]),
        ..DatasetOptions::default()
    };
    with_gdal(|| Dataset::open_ex(path, options))
}

fn through_gdal(path: &Path, format: VectorFormat, wanted: AreaName<'_>) -> Result<(String, Vec<Feature>), String> {
    let dataset = open_vector_file(path, format)?;
    let mut layer = match wanted.layer {
        Some(name) => with_gdal(|| dataset.layer_by_name(name))?,
        None if dataset.layer_count() == 1 => with_gdal(|| dataset.layer(0))?,
        None => {
            let names: Vec<String> = dataset.layers().map(|layer| layer.name()).collect();
            return Err(format!("it has {} layers, name one of {}", names.len(), names.join(", ")));
        }
    };
    let crs = layer
        .spatial_ref()
        .and_then(|system| system.to_wkt().ok())
        .ok_or("the layer has no reference system, in a shapefile the file .prj beside it")?;
    let mut features = Vec::new();
    for feature in layer.features() {
        let name = match wanted.field {
            "" => None,
            _ => {
                let field = feature
                    .field_index(wanted.field)
                    .map_err(|_| format!("the layer has no field {}", wanted.field))?;
                feature.field_as_string(field).ok().flatten()
            }
        };
        let is_wanted = wanted.name.is_none() || wanted.name == name.as_deref();
        let polygons = match feature.geometry().filter(|_| is_wanted) {
            None => Vec::new(),
            Some(geometry) => match with_gdal(|| geometry.to_geo())? {
                geo::Geometry::Polygon(polygon) => vec![polygon],
                geo::Geometry::MultiPolygon(polygons) => polygons.0,
                _ => Vec::new(),
            },
        };
        features.push(Feature { name, polygons });
    }
    Ok((crs, features))
}

#[cfg(test)]
mod tests {
    use super::*;
    use gdal::spatial_ref::SpatialRef;
    use gdal::vector::{FieldDefn, Geometry, LayerOptions, OGRFieldType, OGRwkbGeometryType};

    fn named<'a>(layer: Option<&'a str>, name: &'a str) -> AreaName<'a> {
        AreaName { layer, field: "name", name: Some(name) }
    }

    #[test]
    fn geopackages_give_their_polygons_and_their_map() {
        let folder = tempfile::tempdir().unwrap();
        let path = folder.path().join("areas.gpkg");
        prepare_gdal();
        register_vector(VectorFormat::GeoPackage);
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
        assert!(area.polygons.coords_iter().any(|c| (c.x, c.y) == (693_500.0, 4_822_400.0)), "{:?}", area.polygons);
        let all = AreaName { layer: Some("others"), ..AreaName::ALL };
        assert_eq!(read(&path, all).unwrap().polygons, area.polygons);
        let told = read(&path, named(None, "north")).unwrap_err().to_string();
        assert!(told.contains("2 layers, name one of blocks, others"), "{told}");
        let told = read(&path, named(Some("blocks"), "south")).unwrap_err().to_string();
        assert!(told.contains("no feature has the name \"south\"; there are north"), "{told}");
    }

    #[test]
    fn shapefiles_give_their_polygons_and_their_map() {
        let folder = tempfile::tempdir().unwrap();
        let path = folder.path().join("areas.shp");
        prepare_gdal();
        register_vector(VectorFormat::Shapefile);
        let driver = gdal::DriverManager::get_driver_by_name("ESRI Shapefile").unwrap();
        let srs = SpatialRef::from_epsg(2154).unwrap();
        let mut dataset = driver.create_vector_only(&path).unwrap();
        {
            let options =
                LayerOptions { name: "areas", srs: Some(&srs), ty: OGRwkbGeometryType::wkbPolygon, options: None };
            let layer = dataset.create_layer(options).unwrap();
            FieldDefn::new("name", OGRFieldType::OFTString).unwrap().add_to_layer(&layer).unwrap();
            let mut feature = gdal::vector::Feature::new(layer.defn()).unwrap();
            feature.set_field_string(feature.field_index("name").unwrap(), "north").unwrap();
            feature.set_geometry(Geometry::bbox(893_000.0, 6_222_000.0, 893_500.0, 6_222_400.0).unwrap()).unwrap();
            feature.create(&layer).unwrap();
        }
        drop(dataset);
        let area = read(&path, named(None, "north")).unwrap();
        assert!(area.crs.contains("Lambert-93") || area.crs.contains("Lambert_93"), "{}", area.crs);
        assert!(area.polygons.coords_iter().any(|c| (c.x, c.y) == (893_500.0, 6_222_400.0)), "{:?}", area.polygons);
        std::fs::remove_file(folder.path().join("areas.prj")).unwrap();
        let told = read(&path, AreaName::ALL).unwrap_err().to_string();
        assert!(told.contains(".prj beside it"), "{told}");
    }

    #[test]
    fn geoparquet_gives_its_polygons_and_its_map() {
        let path = Path::new(env!("CARGO_MANIFEST_DIR")).join("tests/data/areas.parquet");
        let area = read(&path, named(None, "south")).unwrap();
        assert_eq!((area.crs.as_str(), area.polygons.0.len()), ("EPSG:32631", 2));
        assert_eq!(read(&path, AreaName::ALL).unwrap().polygons.0.len(), 3);
        let told = read(&path, named(None, "nrth")).unwrap_err().to_string();
        assert!(told.contains("there are north, south"), "{told}");
        let folder = tempfile::tempdir().unwrap();
        let broken = folder.path().join("a.parquet");
        std::fs::write(&broken, "PAR1").unwrap();
        let told = read(&broken, AreaName::ALL).unwrap_err().to_string();
        assert!(told.contains("write it as GeoPackage"), "{told}");
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

    #[test]
    fn features_are_read_with_their_names_as_they_were_written() {
        let folder = tempfile::tempdir().unwrap();
        let path = folder.path().join("out.geojson");
        let ring = |x: f64| LineString::from(vec![(x, 43.0), (x + 0.5, 43.0), (x + 0.5, 43.5), (x, 43.0)]);
        let feature = |name: &str, x: f64| AreaFeature {
            polygons: MultiPolygon(vec![Polygon::new(ring(x), Vec::new())]),
            properties: serde_json::Map::from_iter([
                ("name".to_owned(), json!(name)),
                ("volume_m3".to_owned(), json!(2.5)),
            ]),
        };
        let features = [feature("north", 5.0), feature("south", 6.25)];
        write(&path, &features, false).unwrap();
        assert!(matches!(write(&path, &features, false), Err(SaveError::Exists { .. })));
        let found = read_features(&path, None, Some("name")).unwrap();
        assert_eq!(found.crs, "EPSG:4326");
        for ((name, polygons), feature) in found.areas.iter().zip(&features) {
            assert_eq!((name.as_deref(), polygons), (feature.properties["name"].as_str(), &feature.polygons));
        }
        write(&path, &[], true).unwrap();
        assert!(read_features(&path, None, None).unwrap_err().to_string().contains("no polygon"));
    }
}
