//! GeoParquet files: the polygons and the names of their features (GeoParquet 1.0 and 1.1).
//!
//! The file is read here and not through GDAL, whose driver needs Apache Arrow and is missing from
//! most packages. Geometries are well-known binary; columns are plain, Snappy or gzip. A file of
//! another kind is an error that says what was found and what to convert it to. Coordinates are
//! easting and northing, or longitude and latitude: GeoParquet stores x before y in every system.

use std::panic::{AssertUnwindSafe, catch_unwind};
use std::path::Path;

use bytes::Bytes;
use geo::{Coord, LineString, Polygon};
use parquet::column::reader::{ColumnReader, ColumnReaderImpl};
use parquet::data_type::{ByteArray, ByteArrayType, DataType};
use parquet::file::reader::{FileReader, RowGroupReader, SerializedFileReader};
use serde_json::Value;

use crate::regular::read_regular;

/// Largest file that is read, and largest size of its columns in memory, bytes.
const SIZE_LIMIT: u64 = 256 << 20;
/// Most corners of all polygons.
const CORNERS_MAX: usize = 10_000_000;
/// System of files that name none (OGC:CRS84, longitude and latitude).
const LONGITUDE_LATITUDE: &str = "EPSG:4326";
/// What to do with a file of another kind.
const INSTEAD: &str = "write it as GeoPackage (ogr2ogr out.gpkg in.parquet, or to_file of GeoPandas)";

/// A feature: its name, where the field has one, and its polygons.
pub(crate) type ParquetFeature = (Option<String>, Vec<Polygon<f64>>);

/// Reads the reference system and all features. `field` holds the names; no names when empty.
///
/// # Errors
/// A sentence for a file that is damaged, no GeoParquet, or of a kind that is not read.
pub(crate) fn read(path: &Path, field: &str) -> Result<(String, Vec<ParquetFeature>), String> {
    let bytes = Bytes::from(read_regular(path, SIZE_LIMIT).map_err(|e| e.to_string())?);
    // The reader of the format checks what it reads, but a damaged file that it has not foreseen
    // must not end the program.
    catch_unwind(AssertUnwindSafe(|| features(bytes, field)))
        .unwrap_or_else(|_| Err(format!("the file is damaged; {INSTEAD}")))
}

fn features(bytes: Bytes, field: &str) -> Result<(String, Vec<ParquetFeature>), String> {
    let damaged = |e: parquet::errors::ParquetError| format!("{e}; {INSTEAD}");
    let file = SerializedFileReader::new(bytes).map_err(damaged)?;
    let metadata = file.metadata().file_metadata();
    let entries = metadata.key_value_metadata().into_iter().flatten();
    let geo = entries.into_iter().find(|entry| entry.key == "geo").and_then(|entry| entry.value.as_deref());
    let geo = geo.ok_or_else(|| format!("it is Parquet without geometry (no metadata \"geo\"); {INSTEAD}"))?;
    let geo: Value = serde_json::from_str(geo).map_err(|e| format!("its metadata \"geo\" are broken: {e}"))?;
    let geometry = geo["primary_column"].as_str().ok_or("its metadata name no primary_column")?;
    let column = &geo["columns"][geometry];
    match column["encoding"].as_str() {
        Some("WKB") => {}
        other => {
            let found = other.unwrap_or("none");
            return Err(format!("its geometry has the encoding {found}, expected WKB; {INSTEAD}"));
        }
    }
    let crs = system(column.get("crs"))?;
    let columns: Vec<String> = metadata.schema_descr().columns().iter().map(|column| column.path().string()).collect();
    let position = |wanted: &str| columns.iter().position(|name| name == wanted);
    let shapes = position(geometry).ok_or_else(|| format!("it has no column {geometry}"))?;
    let names = match field {
        "" => None,
        _ => Some(position(field).ok_or_else(|| format!("the layer has no field {field}"))?),
    };
    let mut found = Vec::new();
    let mut budget = CORNERS_MAX;
    for number in 0..file.num_row_groups() {
        let group = file.get_row_group(number).map_err(damaged)?;
        let sizes = [Some(shapes), names].into_iter().flatten().map(|at| group.metadata().column(at));
        let size: i64 = sizes.map(|column| column.uncompressed_size().max(0)).fold(0, i64::saturating_add);
        if size.unsigned_abs() > SIZE_LIMIT {
            return Err(format!("a group of its rows has {size} bytes, expected at most {SIZE_LIMIT}; {INSTEAD}"));
        }
        let ColumnReader::ByteArrayColumnReader(reader) = group.get_column_reader(shapes).map_err(damaged)? else {
            return Err(format!("its column {geometry} holds no geometry"));
        };
        let shapes = values::<ByteArrayType>(reader, &*group).map_err(damaged)?;
        let names = match names {
            None => vec![None; shapes.len()],
            Some(at) => texts(group.get_column_reader(at).map_err(damaged)?, &*group, field)?,
        };
        for (shape, name) in shapes.into_iter().zip(names) {
            let polygons = shape.map_or(Ok(Vec::new()), |shape| polygons(shape.data(), &mut budget))?;
            found.push((name, polygons));
        }
    }
    Ok((crs, found))
}

/// Returns the definition of the system that a column states.
fn system(crs: Option<&Value>) -> Result<String, String> {
    match crs {
        None => Ok(LONGITUDE_LATITUDE.to_owned()),
        Some(Value::Object(projjson)) => {
            let id = projjson.get("id");
            let part = |name: &str| id.and_then(|id| id.get(name));
            Ok(match (part("authority").and_then(Value::as_str), part("code")) {
                (Some("EPSG"), Some(code)) => format!("EPSG:{}", code.to_string().trim_matches('"')),
                (Some("OGC"), Some(Value::String(code))) if code == "CRS84" => LONGITUDE_LATITUDE.to_owned(),
                // PROJ reads the JSON of a system as it is.
                _ => Value::Object(projjson.clone()).to_string(),
            })
        }
        Some(_) => Err("the layer has no reference system: set it in the program that wrote the file".to_owned()),
    }
}

/// Reads a column without lists: a value or none for each row.
fn values<T: DataType>(
    mut reader: ColumnReaderImpl<T>,
    group: &dyn RowGroupReader,
) -> parquet::errors::Result<Vec<Option<T::T>>> {
    let rows = usize::try_from(group.metadata().num_rows()).unwrap_or(0);
    let (mut found, mut levels) = (Vec::new(), Vec::new());
    let mut records = 0;
    while records < rows {
        let (read, _, _) = reader.read_records(rows - records, Some(&mut levels), None, &mut found)?;
        if read == 0 {
            break;
        }
        records += read;
    }
    // A column that must not be empty has no levels.
    if levels.is_empty() {
        return Ok(found.into_iter().map(Some).collect());
    }
    let mut found = found.into_iter();
    let highest = levels.iter().copied().max().unwrap_or(0);
    Ok(levels.into_iter().map(|level| if level == highest && level > 0 { found.next() } else { None }).collect())
}

/// Reads a column of texts or whole numbers.
fn texts(reader: ColumnReader, group: &dyn RowGroupReader, field: &str) -> Result<Vec<Option<String>>, String> {
    let damaged = |e: parquet::errors::ParquetError| format!("{e}; {INSTEAD}");
    fn shown<T: ToString>(values: Vec<Option<T>>) -> Vec<Option<String>> {
        values.into_iter().map(|value| value.map(|value| value.to_string())).collect()
    }
    match reader {
        ColumnReader::ByteArrayColumnReader(reader) => {
            let text = |value: ByteArray| String::from_utf8_lossy(value.data()).into_owned();
            let found = values::<ByteArrayType>(reader, group).map_err(damaged)?;
            Ok(found.into_iter().map(|value| value.map(text)).collect())
        }
        ColumnReader::Int32ColumnReader(reader) => values(reader, group).map(shown).map_err(damaged),
        ColumnReader::Int64ColumnReader(reader) => values(reader, group).map(shown).map_err(damaged),
        _ => Err(format!("the field {field} holds neither texts nor whole numbers")),
    }
}

/// Returns the polygons of a geometry in well-known binary; none for points and lines. `budget` is
/// the number of corners that may still come.
fn polygons(wkb: &[u8], budget: &mut usize) -> Result<Vec<Polygon<f64>>, String> {
    let mut reader = Wkb { bytes: wkb, budget };
    let header = reader.header()?;
    match header.kind {
        POLYGON => Ok(vec![reader.polygon(header)?]),
        MULTIPOLYGON => {
            let count = reader.count(header.is_little)?;
            (0..count)
                .map(|_| match reader.header()? {
                    part if part.kind == POLYGON => reader.polygon(part),
                    part => Err(format!("a part of a multipolygon is of kind {}, expected {POLYGON}", part.kind)),
                })
                .collect()
        }
        _ => Ok(Vec::new()),
    }
}

/// Codes of the geometries that have an area.
const POLYGON: u32 = 3;
const MULTIPOLYGON: u32 = 6;

/// What a geometry begins with.
#[derive(Clone, Copy)]
struct WkbHeader {
    is_little: bool,
    kind: u32,
    /// Numbers of a corner: 2, with z or m 3, with both 4.
    numbers: usize,
}

/// Reads well-known binary: that of ISO (1001, 2001, 3001) and that of PostGIS (flags).
struct Wkb<'a> {
    bytes: &'a [u8],
    budget: &'a mut usize,
}

impl Wkb<'_> {
    fn take<const N: usize>(&mut self) -> Result<[u8; N], String> {
        let (first, rest) = self.bytes.split_first_chunk().ok_or("a geometry ends too early")?;
        self.bytes = rest;
        Ok(*first)
    }

    fn count(&mut self, is_little: bool) -> Result<u32, String> {
        let bytes = self.take()?;
        Ok(if is_little { u32::from_le_bytes(bytes) } else { u32::from_be_bytes(bytes) })
    }

    fn header(&mut self) -> Result<WkbHeader, String> {
        const FLAGS: [(u32, usize); 3] = [(0x8000_0000, 1), (0x4000_0000, 1), (0x2000_0000, 0)];
        let is_little = match self.take()? {
            [0] => false,
            [1] => true,
            [other] => return Err(format!("a geometry begins with {other}, expected the byte order 0 or 1")),
        };
        let code = self.count(is_little)?;
        let flagged: usize = FLAGS.iter().filter(|(flag, _)| code & flag != 0).map(|(_, more)| more).sum();
        if code & FLAGS[2].0 != 0 {
            // The code of a system, which the metadata of the column state.
            self.take::<4>()?;
        }
        let plain = code & 0x1fff_ffff;
        let dimensions = match plain / 1000 {
            0 => 0,
            1 | 2 => 1,
            _ => 2,
        };
        Ok(WkbHeader { is_little, kind: plain % 1000, numbers: 2 + flagged + dimensions })
    }

    fn polygon(&mut self, header: WkbHeader) -> Result<Polygon<f64>, String> {
        let rings = self.count(header.is_little)?;
        let mut rings = (0..rings).map(|_| self.ring(header)).collect::<Result<Vec<_>, _>>()?.into_iter();
        let outer = rings.next().unwrap_or_else(|| LineString(Vec::new()));
        Ok(Polygon::new(outer, rings.collect()))
    }

    fn ring(&mut self, header: WkbHeader) -> Result<LineString<f64>, String> {
        let corners = self.count(header.is_little)? as usize;
        *self.budget = self.budget.checked_sub(corners).ok_or_else(|| format!("more than {CORNERS_MAX} corners"))?;
        (0..corners)
            .map(|_| {
                let mut corner = [0.0; 4];
                for number in corner.iter_mut().take(header.numbers) {
                    let bytes = self.take()?;
                    *number = if header.is_little { f64::from_le_bytes(bytes) } else { f64::from_be_bytes(bytes) };
                }
                Ok(Coord { x: corner[0], y: corner[1] })
            })
            .collect::<Result<Vec<_>, String>>()
            .map(LineString)
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    /// Written by GeoPandas 1.2: three features on EPSG:32631 with a hole, parts, an empty name
    /// and a point.
    const FILE: &[u8] = include_bytes!("../tests/data/areas.parquet");

    fn read_bytes(bytes: &[u8], field: &str) -> Result<(String, Vec<ParquetFeature>), String> {
        let folder = tempfile::tempdir().unwrap();
        let path = folder.path().join("areas.parquet");
        std::fs::write(&path, bytes).unwrap();
        read(&path, field)
    }

    #[test]
    fn files_of_geopandas_give_names_polygons_and_their_map() {
        let (crs, features) = read_bytes(FILE, "name").unwrap();
        assert_eq!(crs, "EPSG:32631");
        let shapes: Vec<_> = features
            .iter()
            .map(|(name, polygons)| {
                (name.as_deref(), polygons.len(), polygons.iter().map(|polygon| polygon.interiors().len()).sum())
            })
            .collect();
        assert_eq!(shapes, [(Some("north"), 1, 1), (Some("south"), 2, 0), (None, 0, 0)]);
        assert_eq!(features[0].1[0].exterior().0[1], Coord { x: 600_100.0, y: 4_800_000.0 });
        let (_, numbered) = read_bytes(FILE, "number").unwrap();
        assert_eq!(numbered[1].0.as_deref(), Some("2"));
        assert!(read_bytes(FILE, "colour").unwrap_err().contains("no field colour"));
    }

    #[test]
    fn systems_are_codes_json_or_degrees() {
        let json = |text: &str| serde_json::from_str::<Value>(text).unwrap();
        assert_eq!(system(None).unwrap(), "EPSG:4326");
        assert_eq!(system(Some(&json(r#"{"id": {"authority": "OGC", "code": "CRS84"}}"#))).unwrap(), "EPSG:4326");
        assert_eq!(system(Some(&json(r#"{"id": {"authority": "EPSG", "code": 2056}}"#))).unwrap(), "EPSG:2056");
        assert_eq!(system(Some(&json(r#"{"type": "ProjectedCRS"}"#))).unwrap(), r#"{"type":"ProjectedCRS"}"#);
        assert!(system(Some(&Value::Null)).unwrap_err().contains("no reference system"));
    }

    #[test]
    fn heights_and_codes_in_geometries_are_passed_over() {
        let ring = |numbers: usize| {
            let corners = [[0.0, 0.0], [1.0, 0.0], [1.0, 1.0], [0.0, 0.0]];
            let mut bytes = 4u32.to_le_bytes().to_vec();
            for corner in corners {
                corner.iter().chain([9.0, 9.0].iter()).take(numbers).for_each(|n: &f64| bytes.extend(n.to_le_bytes()));
            }
            bytes
        };
        for (code, numbers, srid) in [(3u32, 2, false), (1003, 3, false), (3003, 4, false), (0xa000_0003, 3, true)] {
            let mut wkb = vec![1];
            wkb.extend(code.to_le_bytes());
            wkb.extend(if srid { 4326u32.to_le_bytes().to_vec() } else { Vec::new() });
            wkb.extend(1u32.to_le_bytes());
            wkb.extend(ring(numbers));
            let found = polygons(&wkb, &mut 100).unwrap();
            assert_eq!(found[0].exterior().0[2], Coord { x: 1.0, y: 1.0 }, "{code}");
            assert!(polygons(&wkb, &mut 3).unwrap_err().contains("corners"));
            assert!(polygons(&wkb[..wkb.len() - 1], &mut 100).unwrap_err().contains("too early"));
        }
    }

    #[test]
    fn damaged_files_are_refused_or_read() {
        assert!(read_bytes(b"PAR1 and nothing", "").is_err());
        // A byte of every eleventh place in turn; the reader of the format may find nothing wrong.
        for at in (0..FILE.len()).step_by(11) {
            let mut bytes = FILE.to_vec();
            bytes[at] ^= 0xa5;
            let _ = read_bytes(&bytes, "name");
            if at % 16 == 0 {
                assert!(read_bytes(&FILE[..at], "name").is_err());
            }
        }
    }
}
