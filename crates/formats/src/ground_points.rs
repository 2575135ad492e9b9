//! Reading ground control points and check points with their places in images: CSV or GeoJSON.
//!
//! CSV has a header line and one row for each place; the rows of a point repeat its name and
//! position. GeoJSON has one feature for each point, whose property `images` names the places:
//! `{"left.tif": [sample, line]}`. Columns and properties are found by name, in any letter case:
//!
//! - `name` (or `id`, `point`);
//! - the position: `lon`, `lat`, `height`, in degrees and metres above the WGS 84 ellipsoid; or
//!   `x`, `y`, `height` on the map that `crs` names. `crs` may also name a vertical datum
//!   (`EPSG:32631+5773`), for both kinds. In GeoJSON the position is that of the point, on the map
//!   that a `crs` of the file names;
//! - `accuracy_m`, or `horizontal_m` and `vertical_m`: standard deviations of the position along
//!   each axis;
//! - `pixel_px`: standard deviation of a place along each axis, pixels [0.5];
//! - `role`: `control`, or `check` for a point that only measures the result;
//! - in CSV the place: `image`, `sample`, `line`, where the centre of the upper-left pixel is 0, 0;
//! - `chip`: a small picture of the point's surroundings, which is searched for in the images that
//!   have no place. Its name is relative to the folder of the file. `chip_sample` and `chip_line`
//!   are the place of the point in it [its centre]. A point with a chip needs no places.
//!
//! Other columns are ignored. A row that cannot be used is an error that names it.

use std::collections::BTreeMap;
use std::ops::RangeInclusive;
use std::path::{Path, PathBuf};

use camera::ImagePoint;
use serde_json::Value;

use crate::format_error::FormatError;
use crate::positions::records;
use crate::regular::read_regular;

/// Largest file that is read, bytes.
const SIZE_LIMIT: u64 = 256 << 20;
/// Standard deviations that mean something, metres or pixels.
const DEVIATIONS: RangeInclusive<f64> = 1e-3..=1e4;
/// Heights on Earth with a wide margin, metres.
const HEIGHTS_M: RangeInclusive<f64> = -2e4..=2e4;
/// Standard deviation of a place that was marked by hand, pixels.
const PIXEL_PX: f64 = 0.5;

/// A ground point with a known position.
#[derive(Debug, Clone, PartialEq)]
pub struct GroundPoint {
    /// Its name.
    pub name: String,
    /// Longitude in degrees, or easting on the map of `crs`.
    pub x: f64,
    /// Latitude in degrees, or northing on the map of `crs`.
    pub y: f64,
    /// Height above the ellipsoid, or above the datum that `crs` names, metres.
    pub height_m: f64,
    /// Reference system; `None` for WGS 84 with ellipsoidal heights.
    pub crs: Option<String>,
    /// Standard deviation along each horizontal axis, metres.
    pub horizontal_m: f64,
    /// Standard deviation of the height, metres.
    pub vertical_m: f64,
    /// Standard deviation of the places along each axis, pixels.
    pub pixel_px: f64,
    /// Whether the point only measures the result.
    pub is_check: bool,
    /// Its places in images.
    pub seen: Vec<ImagePlace>,
    /// A picture of its surroundings.
    pub chip: Option<ImageChip>,
}

/// A small picture of the surroundings of a ground point.
#[derive(Debug, Clone, PartialEq)]
pub struct ImageChip {
    /// The picture.
    pub path: PathBuf,
    /// Place of the point in it; its centre when `None`.
    pub place: Option<ImagePoint>,
}

/// A place in an image.
#[derive(Debug, Clone, PartialEq)]
pub struct ImagePlace {
    /// Name or path of the image.
    pub image: String,
    /// Position, where the centre of the upper-left pixel is 0, 0.
    pub place: ImagePoint,
}

/// Reads ground points.
///
/// ```
/// # let folder = tempfile::tempdir()?;
/// let path = folder.path().join("points.csv");
/// let text = "name,lon,lat,height,accuracy_m,role,image,sample,line\n\
///             a,5.4,43.5,210.5,0.1,control,left.tif,120.25,88.5\n\
///             a,5.4,43.5,210.5,0.1,control,right.tif,131.5,90.0\n";
/// std::fs::write(&path, text)?;
/// let points = formats::ground_points::read_ground_points(&path)?;
/// assert_eq!((points.len(), points[0].seen.len(), points[0].is_check), (1, 2, false));
/// # Ok::<(), Box<dyn std::error::Error>>(())
/// ```
///
/// # Errors
/// [`FormatError`] when the system refuses, for a row that cannot be used, and for a chip that is
/// no file.
pub fn read_ground_points(path: &Path) -> Result<Vec<GroundPoint>, FormatError> {
    let unreadable = |source| FormatError::unreadable(path, "the ground points", source);
    let bytes = read_regular(path, SIZE_LIMIT).map_err(unreadable)?;
    let invalid = |what: String| FormatError::new(path, format_args!("cannot use the ground points ({what})"));
    let mut points = parse(&String::from_utf8_lossy(&bytes)).map_err(invalid)?;
    let folder = path.parent().unwrap_or(Path::new(""));
    for chip in points.iter_mut().filter_map(|point| point.chip.as_mut()) {
        chip.path = folder.join(&chip.path);
        if !chip.path.is_file() {
            return Err(invalid(format!("a chip is not a file: {}", chip.path.display())));
        }
    }
    Ok(points)
}

fn parse(text: &str) -> Result<Vec<GroundPoint>, String> {
    let text = text.strip_prefix('\u{feff}').unwrap_or(text);
    let rows = if text.trim_start().starts_with('{') { from_geojson(text)? } else { from_csv(text)? };
    let mut points: Vec<GroundPoint> = Vec::new();
    let mut numbers: BTreeMap<String, usize> = BTreeMap::new();
    for row in &rows {
        let point = row.point()?;
        let Some(&number) = numbers.get(&point.name) else {
            numbers.insert(point.name.clone(), points.len());
            points.push(point);
            continue;
        };
        let known = &mut points[number];
        if (GroundPoint { seen: Vec::new(), ..known.clone() }) != (GroundPoint { seen: Vec::new(), ..point.clone() }) {
            return Err(format!(
                "{}: the point {} has two positions, accuracies, roles or chips",
                row.label, point.name
            ));
        }
        known.seen.extend(point.seen);
    }
    if points.is_empty() {
        return Err("it has no points, expected at least one".to_owned());
    }
    Ok(points)
}

/// A row by the names of its columns in lower case.
struct Row {
    label: String,
    fields: BTreeMap<String, String>,
    seen: Vec<ImagePlace>,
}

impl Row {
    /// Finds the first column of some names that is not empty.
    fn named(&self, names: &[&str]) -> Option<(&str, &str)> {
        let found = names.iter().filter_map(|name| self.fields.get_key_value(*name));
        found.map(|(name, text)| (name.as_str(), text.trim())).find(|(_, text)| !text.is_empty())
    }

    fn text(&self, names: &[&str]) -> Option<&str> {
        self.named(names).map(|(_, text)| text)
    }

    fn number(&self, names: &[&str]) -> Result<Option<f64>, String> {
        let Some((name, text)) = self.named(names) else { return Ok(None) };
        match text.parse::<f64>() {
            Ok(value) if value.is_finite() => Ok(Some(value)),
            _ => {
                let short: String = text.chars().take(40).collect();
                Err(format!("{}: {name} is {short:?}, expected a finite number", self.label))
            }
        }
    }

    fn needed(&self, names: &[&str]) -> Result<f64, String> {
        self.number(names)?.ok_or_else(|| format!("{}: {} is missing", self.label, names[0]))
    }

    /// Reads a standard deviation.
    fn deviation(&self, names: &[&str]) -> Result<Option<f64>, String> {
        let found = self.number(names)?;
        match found.zip(self.named(names)) {
            Some((value, (name, _))) if !DEVIATIONS.contains(&value) => {
                Err(format!("{}: {name} is {value}, expected a deviation of 0.001 to 10000", self.label))
            }
            _ => Ok(found),
        }
    }

    fn point(&self) -> Result<GroundPoint, String> {
        let name = self.text(&["name", "id", "point"]).ok_or_else(|| format!("{}: name is missing", self.label))?;
        let crs = self.text(&["crs", "epsg"]).map(str::to_owned);
        let is_map = self.text(&["x", "easting", "east"]).is_some();
        if is_map && crs.is_none() {
            return Err(format!(
                "{}: x and y are given without crs, which names their map, such as EPSG:32631",
                self.label
            ));
        }
        let (x, y) = if is_map {
            (self.needed(&["x", "easting", "east"])?, self.needed(&["y", "northing", "north"])?)
        } else {
            (self.needed(&["lon", "longitude", "lon_deg"])?, self.needed(&["lat", "latitude", "lat_deg"])?)
        };
        if !is_map && (x.abs() > 360.0 || y.abs() > 90.0) {
            return Err(format!("{}: longitude {x}, latitude {y} is not on the Earth, expected degrees", self.label));
        }
        let missing = || format!("{}: accuracy_m is missing, expected the deviation of the position", self.label);
        let is_check = match self.text(&["role", "use", "type"]).map(str::to_lowercase).as_deref() {
            None | Some("control" | "gcp") => false,
            Some("check" | "checkpoint") => true,
            Some(other) => return Err(format!("{}: role is {other:?}, expected control or check", self.label)),
        };
        let height_m = self.needed(&["height", "height_m", "h", "z", "altitude", "elevation"])?;
        if !HEIGHTS_M.contains(&height_m) {
            return Err(format!("{}: height is {height_m}, expected metres on Earth", self.label));
        }
        Ok(GroundPoint {
            name: name.to_owned(),
            x,
            y,
            height_m,
            crs,
            horizontal_m: self.deviation(&["horizontal_m", "accuracy_m", "accuracy"])?.ok_or_else(missing)?,
            vertical_m: self.deviation(&["vertical_m", "accuracy_m", "accuracy"])?.ok_or_else(missing)?,
            pixel_px: self.deviation(&["pixel_px"])?.unwrap_or(PIXEL_PX),
            is_check,
            seen: self.seen.clone(),
            chip: self.chip()?,
        })
    }

    fn chip(&self) -> Result<Option<ImageChip>, String> {
        let Some(path) = self.text(&["chip"]) else { return Ok(None) };
        let place = match (self.number(&["chip_sample"])?, self.number(&["chip_line"])?) {
            (Some(sample), Some(line)) => Some(ImagePoint::new(sample, line)),
            (None, None) => None,
            _ => return Err(format!("{}: chip_sample and chip_line are given one without the other", self.label)),
        };
        Ok(Some(ImageChip { path: PathBuf::from(path), place }))
    }
}

fn from_csv(text: &str) -> Result<Vec<Row>, String> {
    let mut records = records(text).into_iter();
    let header: Vec<String> = records.next().unwrap_or_default().iter().map(|h| h.trim().to_lowercase()).collect();
    let row = |(number, record): (usize, Vec<String>)| {
        let fields = header.iter().cloned().zip(record).collect();
        let mut row = Row { label: format!("row {number}"), fields, seen: Vec::new() };
        let image = match row.text(&["image", "file", "filename"]) {
            Some(image) => image.to_owned(),
            None if row.text(&["chip"]).is_some() => return Ok(row),
            None => return Err(format!("{}: image is missing, or chip", row.label)),
        };
        let place = ImagePoint::new(row.needed(&["sample", "column", "col"])?, row.needed(&["line", "row"])?);
        row.seen.push(ImagePlace { image, place });
        Ok(row)
    };
    (1..).zip(records).map(row).collect()
}

fn from_geojson(text: &str) -> Result<Vec<Row>, String> {
    let value: Value = serde_json::from_str(text).map_err(|error| error.to_string())?;
    let features = value["features"].as_array().ok_or("it has no features, expected a FeatureCollection")?;
    let crs = value["crs"]["properties"]["name"].as_str().and_then(map_of);
    (1..).zip(features).map(|(number, feature)| from_feature(number, feature, crs.as_deref())).collect()
}

/// Returns the code of a CRS that a file names in the way of the first GeoJSON
/// (`urn:ogc:def:crs:EPSG::32631`); `None` for longitude and latitude.
fn map_of(name: &str) -> Option<String> {
    let code = name.rsplit(':').next().filter(|code| *code != "4326" && *code != "CRS84")?;
    Some(format!("EPSG:{code}"))
}

fn from_feature(number: usize, feature: &Value, crs: Option<&str>) -> Result<Row, String> {
    let label = format!("feature {number}");
    let mut fields = BTreeMap::new();
    let mut seen = Vec::new();
    for (key, value) in feature["properties"].as_object().into_iter().flatten() {
        match value {
            Value::Object(images) if key.eq_ignore_ascii_case("images") => {
                for (image, place) in images {
                    let at = |i: usize| {
                        let wrong = || format!("{label}: the place in {image} is {place}, expected [sample, line]");
                        place[i].as_f64().ok_or_else(wrong)
                    };
                    seen.push(ImagePlace { image: image.clone(), place: ImagePoint::new(at(0)?, at(1)?) });
                }
            }
            Value::Null => {}
            Value::String(text) => drop(fields.insert(key.to_lowercase(), text.clone())),
            other => drop(fields.insert(key.to_lowercase(), other.to_string())),
        }
    }
    if let Some(id) = Some(&feature["id"]).filter(|id| !id.is_null()) {
        let plain = id.as_str().map_or_else(|| id.to_string(), str::to_owned);
        fields.entry("id".to_owned()).or_insert(plain);
    }
    let mut position = vec![if crs.is_some() { "x" } else { "lon" }, if crs.is_some() { "y" } else { "lat" }];
    position.push("height");
    for (i, name) in position.into_iter().enumerate() {
        if let Some(value) = feature["geometry"]["coordinates"][i].as_f64() {
            fields.insert(name.to_owned(), value.to_string());
        }
    }
    if let Some(crs) = crs {
        fields.entry("crs".to_owned()).or_insert_with(|| crs.to_owned());
    }
    Ok(Row { label, fields, seen })
}

#[cfg(test)]
mod tests {
    use super::*;
    use proptest::prelude::*;

    #[test]
    fn csv_and_geojson_give_the_same_points() {
        let csv = "Name,X,Y,Height,CRS,horizontal_m,vertical_m,role,image,sample,line\n\
                   p,400000.5,5e6,12,EPSG:32631+5773,0.1,0.2,check,a.tif,1.5,2\n\
                   p,400000.5,5e6,12,EPSG:32631+5773,0.1,0.2,check,b.tif,3,4\n";
        let json = r#"{"type": "FeatureCollection", "crs": {"properties": {"name": "urn:ogc:def:crs:EPSG::32631"}},
            "features": [{"id": "p", "geometry": {"type": "Point", "coordinates": [400000.5, 5000000, 12]},
            "properties": {"crs": "EPSG:32631+5773", "horizontal_m": 0.1, "vertical_m": 0.2, "Role": "check",
                           "images": {"a.tif": [1.5, 2], "b.tif": [3, 4]}}}]}"#;
        let points = parse(csv).unwrap();
        assert_eq!(points, parse(json).unwrap());
        assert_eq!((points[0].x, points[0].pixel_px, points[0].is_check), (400_000.5, PIXEL_PX, true));
        assert_eq!(points[0].seen[1].place, ImagePoint::new(3.0, 4.0));
    }

    #[test]
    fn what_is_wrong_is_named_with_its_row() {
        let header = "name,lon,lat,height,accuracy_m,image,sample,line";
        for (rows, expected) in [
            ("", "no points"),
            ("a,1,2,3,0.1,,5,6", "row 1: image is missing"),
            ("a,1,2,3,0,b,5,6", "accuracy_m is 0"),
            ("a,1,2,1e9,1,b,5,6", "height is 1000000000"),
            ("a,1,2,3,,b,5,6", "accuracy_m is missing"),
            ("a,1,95,3,0.1,b,5,6", "not on the Earth"),
            ("a,1,2,nan,0.1,b,5,6", "height is \"nan\""),
            ("a,1,2,3,0.1,b,5,6\na,1,2,4,0.1,c,5,6", "row 2: the point a has two positions"),
            ("a,1,2,3,0.1,b,5", "row 1: line is missing"),
        ] {
            let error = parse(&format!("{header}\n{rows}\n")).unwrap_err();
            assert!(error.contains(expected), "{rows:?}: {error}");
        }
        let error = parse("name,x,y,height,accuracy_m,image,sample,line\na,1,2,3,1,b,5,6\n").unwrap_err();
        assert!(error.contains("without crs"), "{error}");
    }

    #[test]
    fn chips_stand_for_places() {
        let folder = tempfile::tempdir().unwrap();
        std::fs::write(folder.path().join("a.tif"), "picture").unwrap();
        let read = |name: &str, text: &str| {
            std::fs::write(folder.path().join(name), text).unwrap();
            read_ground_points(&folder.path().join(name)).map_err(|error| error.to_string())
        };
        let header = "name,lon,lat,height,accuracy_m,image,sample,line,chip,chip_sample,chip_line\n";
        let row = |row: &str| read("points.csv", &format!("{header}{row}\n"));
        let points = row("p,1,2,3,0.1,,,,a.tif,20,21.5\nq,1,2,3,0.1,left.tif,5,6,a.tif,,").unwrap();
        let path = folder.path().join("a.tif");
        assert_eq!(points[0].chip, Some(ImageChip { path: path.clone(), place: Some(ImagePoint::new(20.0, 21.5)) }));
        assert_eq!((points[1].chip.clone(), points[1].seen.len()), (Some(ImageChip { path, place: None }), 1));
        let json = r#"{"features": [{"id": "p", "geometry": {"coordinates": [1, 2, 3]}, "properties":
            {"accuracy_m": 0.1, "chip": "a.tif", "chip_sample": 20, "chip_line": 21.5}}]}"#;
        assert_eq!(read("points.json", json).unwrap(), points[..1]);
        assert!(row("p,1,2,3,0.1,,,,a.tif,20,").unwrap_err().contains("one without the other"));
        for name in ["none.tif", "/vsicurl/http://example.org/a.tif", "http://example.org/a.tif", "."] {
            let refused = row(&format!("p,1,2,3,0.1,,,,{name},,")).unwrap_err();
            assert!(refused.contains("a chip is not a file"), "{refused}");
        }
    }

    proptest! {
        #[test]
        fn no_text_makes_the_reader_panic(text in "\\PC{0,200}", lines in "[a-z,;\"\\n0-9.-]{0,200}") {
            let _ = parse(&text);
            let _ = parse(&format!("name,lon,lat,height,accuracy_m,image,sample,line\n{lines}"));
            let _ = parse(&format!("{{\"features\": [{{\"properties\": {{\"images\": {{\"{lines}\": 1}}}}}}]}}"));
        }
    }
}
