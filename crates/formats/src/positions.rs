//! Reading lists of camera positions: CSV with a header line, or GeoJSON with points.
//!
//! Columns (properties in GeoJSON) are found by name, in any letter case: `lon` and `lat` (degrees;
//! in GeoJSON the coordinates of the point), and optionally `id` (or `name`), `heading` (degrees
//! clockwise from north) and `height_m` (of the camera, metres above the ellipsoid). Others are
//! ignored. A row that cannot be used carries the reason and the other rows are still read; a file
//! that is not a list is an error. CSV follows RFC 4180: commas, quotes doubled inside quotes.

use std::collections::HashSet;
use std::path::Path;

use serde_json::Value;

use crate::format_error::FormatError;
use crate::regular::read_regular;

/// Largest list that is read, bytes.
const SIZE_LIMIT: u64 = 1 << 30;
/// Longest id, bytes; the id becomes the name of a file.
const ID_LIMIT: usize = 200;

/// A camera position.
#[derive(Debug, Clone, PartialEq)]
pub struct Position {
    /// Longitude, degrees.
    pub lon_deg: f64,
    /// Latitude, degrees.
    pub lat_deg: f64,
    /// Viewing direction, degrees clockwise from north, if given.
    pub heading_deg: Option<f64>,
    /// Height of the camera, metres above the ellipsoid, if given.
    pub height_m: Option<f64>,
}

/// A row of a list.
#[derive(Debug, Clone, PartialEq)]
pub struct PositionRow {
    /// Its id, or `row_N` counted from 1. It is unique in the list and can be the name of a file.
    pub id: String,
    /// The position, or the reason why the row cannot be used.
    pub position: Result<Position, String>,
}

/// Reads a list of positions.
///
/// ```
/// # let folder = tempfile::tempdir()?;
/// let path = folder.path().join("cameras.csv");
/// std::fs::write(&path, "id,lon,lat,heading\ndoor,4.36,52.01,90\nroof,east,52.01,0\n")?;
///
/// let rows = formats::positions::read_positions(&path)?;
/// assert_eq!(rows[0].id, "door");
/// assert_eq!(rows[0].position.as_ref().map(|p| p.heading_deg), Ok(Some(90.0)));
/// assert!(rows[1].position.is_err());
/// # Ok::<(), Box<dyn std::error::Error>>(())
/// ```
///
/// # Errors
/// [`FormatError`] when the system refuses, for a file larger than 1 GiB, without rows or without a
/// required column, for two rows with the same id, and for an id that cannot be the name of a file.
pub fn read_positions(path: impl AsRef<Path>) -> Result<Vec<PositionRow>, FormatError> {
    let path = path.as_ref();
    let unreadable = |source| FormatError::unreadable(path, "the list of positions", source);
    let size = std::fs::metadata(path).map_err(unreadable)?.len();
    let rows = if size > SIZE_LIMIT {
        Err(format!("it has {size} bytes, expected at most {SIZE_LIMIT}"))
    } else {
        let bytes = read_regular(path, SIZE_LIMIT).map_err(unreadable)?;
        parse(&String::from_utf8_lossy(&bytes))
    };
    rows.map_err(|what| FormatError::new(path, format_args!("not a list of positions ({what})")))
}

fn parse(text: &str) -> Result<Vec<PositionRow>, String> {
    let text = text.strip_prefix('\u{feff}').unwrap_or(text);
    let rows = if text.trim_start().starts_with('{') { from_geojson(text)? } else { from_csv(text)? };
    if rows.is_empty() {
        return Err("it has no rows, expected at least one".to_owned());
    }
    let mut seen = HashSet::new();
    for row in &rows {
        check_id(&row.id)?;
        // Some file systems ignore letter case.
        if !seen.insert(row.id.to_lowercase()) {
            return Err(format!("the id {:?} occurs twice, expected one row per id", row.id));
        }
    }
    Ok(rows)
}

fn check_id(id: &str) -> Result<(), String> {
    let unsafe_character = |c: char| c.is_control() || "/\\:*?\"<>|".contains(c);
    if id.is_empty() || id.len() > ID_LIMIT || id.starts_with('.') || id.contains(unsafe_character) {
        let short: String = id.chars().take(60).collect();
        return Err(format!("the id {short:?} cannot be the name of a file"));
    }
    Ok(())
}

fn from_csv(text: &str) -> Result<Vec<PositionRow>, String> {
    let mut records = records(text).into_iter();
    let header: Vec<String> = records.next().unwrap_or_default().iter().map(|h| h.trim().to_lowercase()).collect();
    let column = |names: &[&str]| header.iter().position(|h| names.contains(&h.as_str()));
    let missing = |name: &str| format!("its first line has no column {name:?}, expected at least lon and lat");
    let lon = column(&["lon", "longitude", "lon_deg"]).ok_or_else(|| missing("lon"))?;
    let lat = column(&["lat", "latitude", "lat_deg"]).ok_or_else(|| missing("lat"))?;
    let (id, heading, height) = (column(&["id", "name"]), column(&["heading", "heading_deg"]), column(&["height_m"]));
    let row = |(number, fields): (usize, Vec<String>)| {
        let field = |at: usize| fields.get(at).map(|f| f.trim()).unwrap_or_default();
        let number_in = |at: usize| {
            field(at).parse::<f64>().map_err(|_| format!("{:?} in column {:?} is not a number", field(at), header[at]))
        };
        let if_there = |at: Option<usize>| at.filter(|&at| !field(at).is_empty()).map(number_in).transpose();
        let position = || {
            let position = Position {
                lon_deg: number_in(lon)?,
                lat_deg: number_in(lat)?,
                heading_deg: if_there(heading)?,
                height_m: if_there(height)?,
            };
            usable(position)
        };
        let id = id.map(field).filter(|id| !id.is_empty());
        PositionRow { id: id.map_or_else(|| format!("row_{number}"), str::to_owned), position: position() }
    };
    Ok((1..).zip(records).map(row).collect())
}

/// Splits a CSV text into records of fields, without empty lines.
pub(crate) fn records(text: &str) -> Vec<Vec<String>> {
    let (mut records, mut fields, mut field) = (Vec::new(), Vec::new(), String::new());
    let mut quoted = false;
    let mut characters = text.chars().peekable();
    let mut end_record = |fields: &mut Vec<String>, field: &mut String| {
        fields.push(std::mem::take(field));
        if fields.iter().any(|f| !f.trim().is_empty()) {
            records.push(std::mem::take(fields));
        }
        fields.clear();
    };
    while let Some(c) = characters.next() {
        match c {
            '"' if quoted && characters.peek() == Some(&'"') => {
                field.push('"');
                characters.next();
            }
            '"' => quoted = !quoted,
            ',' if !quoted => fields.push(std::mem::take(&mut field)),
            '\r' | '\n' if !quoted => end_record(&mut fields, &mut field),
            other => field.push(other),
        }
    }
    end_record(&mut fields, &mut field);
    records
}

fn from_geojson(text: &str) -> Result<Vec<PositionRow>, String> {
    let value: Value = serde_json::from_str(text).map_err(|error| error.to_string())?;
    let features = match value["type"].as_str() {
        Some("FeatureCollection") => value["features"].as_array().ok_or("its features are not a list")?.as_slice(),
        Some("Feature") => std::slice::from_ref(&value),
        other => {
            return Err(format!("its type is {}, expected FeatureCollection or Feature", other.unwrap_or("missing")));
        }
    };
    Ok((1..).zip(features).map(|(number, feature)| from_feature(number, feature)).collect())
}

fn from_feature(number: usize, feature: &Value) -> PositionRow {
    let property = |names: &[&str]| {
        let all = feature["properties"].as_object()?;
        all.iter()
            .find(|(key, _)| names.contains(&key.to_lowercase().as_str()))
            .map(|(_, v)| v)
            .filter(|v| !v.is_null())
    };
    let number_in = |names: &[&str]| {
        let as_number =
            |v: &Value| v.as_f64().ok_or_else(|| format!("the property {:?} is {v}, expected a number", names[0]));
        property(names).map(as_number).transpose()
    };
    let position = || {
        if feature["geometry"]["type"] != "Point" {
            return Err(format!("its geometry is {}, expected a Point", feature["geometry"]["type"]));
        }
        let at = |i: usize| feature["geometry"]["coordinates"][i].as_f64().ok_or("its coordinates are not numbers");
        let position = Position {
            lon_deg: at(0)?,
            lat_deg: at(1)?,
            heading_deg: number_in(&["heading", "heading_deg"])?,
            height_m: number_in(&["height_m"])?,
        };
        usable(position)
    };
    let plain = |v: &Value| v.as_str().map_or_else(|| v.to_string(), str::to_owned);
    let own = Some(&feature["id"]).filter(|v| !v.is_null()).or_else(|| property(&["id", "name"])).map(plain);
    PositionRow { id: own.unwrap_or_else(|| format!("row_{number}")), position: position() }
}

/// Checks that a position is on the Earth and finite.
fn usable(position: Position) -> Result<Position, String> {
    let Position { lon_deg, lat_deg, heading_deg, height_m } = position;
    if !(lon_deg.abs() <= 360.0 && lat_deg.abs() <= 90.0) {
        return Err(format!("longitude {lon_deg}, latitude {lat_deg} is not on the Earth, expected degrees"));
    }
    match [heading_deg, height_m].into_iter().flatten().find(|v| !v.is_finite()) {
        Some(odd) => Err(format!("a heading or height is {odd}, expected a finite number")),
        None => Ok(position),
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    fn at(lon_deg: f64, lat_deg: f64, heading_deg: Option<f64>, height_m: Option<f64>) -> Position {
        Position { lon_deg, lat_deg, heading_deg, height_m }
    }

    #[test]
    fn csv_is_read_with_quotes_empty_fields_and_bad_rows() {
        let text = "\u{feff}ID,Lon,lat,heading,note\r\na,4.5,52,37,\"x, \"\"y\"\"\"\r\n\r\n\
                    \"b c\",4.6,52.1,,\nd,east,52,1,\n,5,95,1,\n";
        let rows = parse(text).unwrap();
        assert_eq!(rows[0], PositionRow { id: "a".into(), position: Ok(at(4.5, 52.0, Some(37.0), None)) });
        assert_eq!(rows[1], PositionRow { id: "b c".into(), position: Ok(at(4.6, 52.1, None, None)) });
        assert_eq!(rows[2].position, Err("\"east\" in column \"lon\" is not a number".into()));
        assert_eq!((rows[3].id.as_str(), rows[3].position.is_err(), rows.len()), ("row_4", true, 4));
    }

    #[test]
    fn geojson_is_read_with_properties_and_bad_features() {
        let text = r#"{"type": "FeatureCollection", "features": [
            {"type": "Feature", "id": 7, "geometry": {"type": "Point", "coordinates": [4.5, 52.0, 3.0]},
             "properties": {"heading": -90, "height_m": 45.5}},
            {"type": "Feature", "geometry": {"type": "Point", "coordinates": [4.5, "a"]}, "properties": null},
            {"type": "Feature", "geometry": null, "properties": {"name": "x"}}]}"#;
        let rows = parse(text).unwrap();
        assert_eq!(rows[0], PositionRow { id: "7".into(), position: Ok(at(4.5, 52.0, Some(-90.0), Some(45.5))) });
        assert!(rows[1].id == "row_2" && rows[1].position.is_err());
        assert!(rows[2].id == "x" && rows[2].position.is_err());
    }

    #[test]
    fn lists_that_are_none_are_refused() {
        for (text, what) in [
            ("", "lon"),
            ("lon,lat\n", "no rows"),
            ("lon,height\n1,2\n", "lat"),
            ("id,lon,lat\na,1,2\nA,1,2\n", "twice"),
            ("id,lon,lat\n../a,1,2\n", "name of a file"),
            ("{\"type\": \"Point\"}", "FeatureCollection"),
            ("{\"type\": ", "EOF"),
        ] {
            let error = parse(text).unwrap_err();
            assert!(error.contains(what), "{text:?}: {error}");
        }
    }
}
