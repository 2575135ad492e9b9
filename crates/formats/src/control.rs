//! Reading tables of control positions as CSV: the surveyed positions of images (GPS) or of points
//! of a model.
//!
//! The first line names the columns. Commas, semicolons or tabs separate them, letter case does not
//! matter, and further columns are ignored:
//!
//! - the subject: `name` (or `image`, `file`, `filename`), or `x`, `y`, `z` in the frame of the
//!   model;
//! - its position: `lon`, `lat`, `height` (or `longitude`, `latitude`, `altitude`, `alt`, `h`),
//!   degrees and metres; or `easting`, `northing`, `height` on a map.
//!
//! Empty lines and lines that begin with `#` are ignored.

use std::path::Path;

use geodesy::{LonLatHeight, MapPoint};

use crate::format_error::FormatError;
use crate::regular::read_regular;

/// Largest file that is read, bytes.
const SIZE_LIMIT: u64 = 256 << 20;

/// The thing whose position is known.
#[derive(Debug, Clone, PartialEq)]
pub enum Subject {
    /// The image with this name.
    Image(String),
    /// The point with these coordinates in the frame of the model.
    Model([f64; 3]),
}

/// A surveyed position.
#[derive(Debug, Clone, Copy, PartialEq)]
pub enum Place {
    /// A geographic position. The height is above the vertical datum of the table, which the caller
    /// knows.
    Geographic(LonLatHeight),
    /// A position on a map.
    Map {
        /// Easting and northing.
        point: MapPoint,
        /// Height above the vertical datum of the table, metres.
        height_m: f64,
    },
}

/// A row of the table.
#[derive(Debug, Clone, PartialEq)]
pub struct ControlPosition {
    /// The thing whose position is known.
    pub subject: Subject,
    /// Its position.
    pub place: Place,
}

/// Reads a table of positions.
///
/// # Errors
/// [`FormatError`] when the system refuses, for a file larger than 256 MiB, a missing column, a
/// value that is not a finite number, an empty name, or a latitude beyond the poles.
pub fn read(path: &Path) -> Result<Vec<ControlPosition>, FormatError> {
    let unreadable = |source| FormatError::unreadable(path, "the file", source);
    let invalid = |(line, what): Fault| FormatError::new(path, format_args!("{what} (line {line})"));
    let size = std::fs::metadata(path).map_err(unreadable)?.len();
    if size > SIZE_LIMIT {
        let what = format!("the file has {size} bytes, expected at most {SIZE_LIMIT}");
        return Err(invalid((1, what)));
    }
    let bytes = read_regular(path, SIZE_LIMIT).map_err(unreadable)?;
    parse(&String::from_utf8_lossy(&bytes)).map_err(invalid)
}

/// A defect: the number of the line, and the text found and expected.
type Fault = (usize, String);

fn parse(text: &str) -> Result<Vec<ControlPosition>, Fault> {
    let text = text.strip_prefix('\u{feff}').unwrap_or(text);
    let lines = (1..).zip(text.lines()).filter(|(_, line)| !line.trim().is_empty() && !line.starts_with('#'));
    let mut lines = lines.peekable();
    let (number, first) = lines
        .next()
        .ok_or_else(|| (1, "the table is empty, expected a line with the names of the columns".to_owned()))?;
    let separator = [';', '\t'].into_iter().find(|&s| first.contains(s)).unwrap_or(',');
    let columns = Columns::of(&fields(first, separator)).map_err(|what| (number, what))?;
    lines.map(|(number, line)| columns.position(&fields(line, separator)).map_err(|what| (number, what))).collect()
}

/// Splits a line into fields. A separator inside quotes does not count, and a quote inside quotes
/// is doubled.
fn fields(line: &str, separator: char) -> Vec<String> {
    let (mut fields, mut quoted) = (vec![String::new()], false);
    let mut characters = line.chars().peekable();
    while let Some(c) = characters.next() {
        let last = fields.len() - 1;
        match c {
            '"' if quoted && characters.peek() == Some(&'"') => {
                characters.next();
                fields[last].push('"');
            }
            '"' => quoted = !quoted,
            c if c == separator && !quoted => fields.push(String::new()),
            c => fields[last].push(c),
        }
    }
    fields.iter().map(|field| field.trim().to_owned()).collect()
}

/// Indices of the columns.
/// Which columns of the table hold what.
struct Columns {
    subject: SubjectColumns,
    /// Whether places are longitudes and latitudes, and not map coordinates.
    geographic: bool,
    /// Longitude, latitude and height, or easting, northing and height.
    place: [usize; 3],
}

/// The columns that say what a row is the position of.
enum SubjectColumns {
    /// The name of an image.
    Name(usize),
    /// Coordinates x, y and z in the model.
    Model([usize; 3]),
}

impl Columns {
    /// Finds the columns by their names, in any case. The error says which columns are missing.
    fn of(header: &[String]) -> Result<Self, String> {
        let find = |names: &[&str]| header.iter().position(|h| names.iter().any(|n| h.eq_ignore_ascii_case(n)));
        let all =
            |names: [&[&str]; 3]| -> Option<[usize; 3]> { Some([find(names[0])?, find(names[1])?, find(names[2])?]) };
        let name = find(&["name", "image", "file", "filename", "image_name"]);
        let model = all([&["x"], &["y"], &["z"]]);
        let subject = match (name, model) {
            (Some(name), _) => SubjectColumns::Name(name),
            (None, Some(model)) => SubjectColumns::Model(model),
            _ => {
                return Err("the columns have neither name nor x, y and z, expected one of the two".to_owned());
            }
        };
        let height: &[&str] = &["height", "height_m", "altitude", "alt", "h", "elevation", "up"];
        let geographic = all([&["lon", "longitude", "lon_deg", "lng"], &["lat", "latitude", "lat_deg"], height]);
        let map = all([&["easting", "east", "easting_m"], &["northing", "north", "northing_m"], height]);
        match (geographic, map) {
            (Some(place), _) => Ok(Self { subject, geographic: true, place }),
            (None, Some(place)) => Ok(Self { subject, geographic: false, place }),
            _ => Err(format!(
                "the columns are {}, expected lon, lat and height, or easting, northing and height",
                header.join(", ")
            )),
        }
    }

    fn position(&self, fields: &[String]) -> Result<ControlPosition, String> {
        let text = |column: usize| fields.get(column).map(String::as_str).unwrap_or_default();
        let number = |column: usize| match text(column).parse::<f64>() {
            Ok(value) if value.is_finite() => Ok(value),
            _ => Err(format!("{:?} is not a finite number", text(column).chars().take(40).collect::<String>())),
        };
        let three =
            |columns: [usize; 3]| Ok::<_, String>([number(columns[0])?, number(columns[1])?, number(columns[2])?]);
        let subject = match self.subject {
            SubjectColumns::Name(column) if text(column).is_empty() => {
                return Err("the name is empty, expected the name of an image".to_owned());
            }
            SubjectColumns::Name(column) => Subject::Image(text(column).to_owned()),
            SubjectColumns::Model(columns) => Subject::Model(three(columns)?),
        };
        let [a, b, height] = three(self.place)?;
        if self.geographic && (b.abs() > 90.0 || a.abs() > 360.0) {
            return Err(format!("longitude {a} and latitude {b} are not on the Earth, expected degrees"));
        }
        let place = if self.geographic {
            Place::Geographic(LonLatHeight::new(a, b, height))
        } else {
            Place::Map { point: MapPoint { x: a, y: b }, height_m: height }
        };
        Ok(ControlPosition { subject, place })
    }
}

#[cfg(test)]
mod tests {
    use super::*;
    use proptest::prelude::*;

    #[test]
    fn names_and_points_on_earth_and_on_maps() {
        let table = "\u{feff}# drone\nImage, Latitude,longitude,note,ALT\n\"a,\"\"b\"\".jpg\", 43.5,5.4,x,180.25\n\n\
                     c.jpg,44,6,,1\n";
        let gps = parse(table).unwrap();
        assert_eq!(gps.len(), 2);
        assert_eq!(gps[0].subject, Subject::Image("a,\"b\".jpg".to_owned()));
        assert_eq!(gps[0].place, Place::Geographic(LonLatHeight::new(5.4, 43.5, 180.25)));
        let pairs = parse("x;y;z;easting;northing;height\n1;2;3;400000.5;5e6;-3\n").unwrap();
        assert_eq!(pairs[0].subject, Subject::Model([1.0, 2.0, 3.0]));
        assert_eq!(pairs[0].place, Place::Map { point: MapPoint { x: 400_000.5, y: 5e6 }, height_m: -3.0 });
    }

    #[test]
    fn what_is_wrong_is_said_with_its_line() {
        for (text, line, words) in [
            ("", 1, "empty"),
            ("lon,lat,height\n", 1, "neither name nor x"),
            ("name,lon,lat\n", 1, "expected lon, lat and height"),
            ("name,lon,lat,height\na,1,2,3\n\nb,1,x,3\n", 4, "\"x\" is not a finite number"),
            ("name,lon,lat,height\na,1,2\n", 2, "\"\" is not a finite number"),
            ("name,lon,lat,height\na,1,2,nan\n", 2, "not a finite number"),
            ("name,lon,lat,height\na,1,92,3\n", 2, "not on the Earth"),
            ("name,lon,lat,height\n,1,2,3\n", 2, "the name is empty"),
        ] {
            let (found, what) = parse(text).unwrap_err();
            assert!(found == line && what.contains(words), "{text:?}: {what} ({found})");
        }
    }

    proptest! {
        #[test]
        fn no_text_makes_the_reader_panic(text in "\\PC{0,200}", lines in "[a-z,;\"\\n0-9.-]{0,200}") {
            let _ = parse(&text);
            let _ = parse(&format!("name,lon,lat,height\n{lines}"));
        }
    }
}
