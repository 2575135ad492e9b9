//! Reads PLY meshes, text and binary: the positions of `vertex` and the polygons of `face`.
//!
//! Two comments are read: `origin x y z`, which the positions are relative to, and `crs EPSG:n`.
//! When a file has both, as the files of this toolkit do, the property `class` of a face is the
//! class of its surface. Everything else is skipped.
//!
//! Counts are checked against the size of the file before anything is allocated.

use city::{CrsReference, DefectCode, Geometry, GeometryKind, ModelPoint, ObjectKind, SurfaceClass, SurfacePolygon};

use super::builder::Builder;
use super::crs_name::crs_reference;
use super::error::CityFault;
use super::format::{CityFormat, Parsed};

/// Returns whether a file begins like a PLY file.
pub(super) fn looks_like(bytes: &[u8]) -> bool {
    bytes.starts_with(b"ply\n") || bytes.starts_with(b"ply\r")
}

pub(super) fn parse(bytes: &[u8]) -> Result<Parsed, CityFault> {
    let header = header(bytes)?;
    let (origin, crs) = (header.origin(), header.crs());
    let mut reader = Reader {
        body: Body { bytes, at: header.end, encoding: header.encoding },
        builder: Builder::default(),
        origin: origin.unwrap_or_default(),
        has_classes: origin.is_some() && crs.is_some(),
    };
    reader.builder.set_crs(crs.unwrap_or_default());
    let object = reader.builder.object("model", ObjectKind::BUILDING);
    reader.builder.object_mut(object).geometries.push(Geometry::new(None, GeometryKind::MultiSurface));
    for element in &header.elements {
        reader.element(element, object)?;
    }
    let (model, defects) = reader.builder.finish();
    Ok(Parsed { model, format: CityFormat::Ply, defects })
}

/// The points of a file, and its comments.
#[derive(Debug)]
pub(crate) struct PlyPoints {
    pub(crate) positions: Vec<[f64; 3]>,
    pub(crate) comments: Vec<String>,
    /// Whether the file has polygons too.
    pub(crate) has_faces: bool,
}

/// Reads the vertices of a cloud, without adding an origin. A position that is not finite is a
/// fault.
pub(crate) fn points(bytes: &[u8]) -> Result<PlyPoints, CityFault> {
    let header = header(bytes)?;
    let mut body = Body { bytes, at: header.end, encoding: header.encoding };
    let has_faces = header.elements.iter().any(|element| element.name == "face" && element.count > 0);
    let mut positions = Vec::new();
    for element in header.elements.iter().take_while(|element| element.name != "face") {
        let axes = body.check(element)?;
        let is_vertex = element.name == "vertex";
        for number in 0..if axes.is_empty() { 0 } else { element.count } {
            let point = body.record(element, &axes)?;
            if is_vertex && !point.iter().all(|c| c.is_finite()) {
                return Err(CityFault::invalid(
                    format!("the position {point:?} is not finite"),
                    format!("vertex {number}"),
                ));
            }
            if is_vertex {
                positions.push(point);
            }
        }
    }
    Ok(PlyPoints { positions, comments: header.comments, has_faces })
}

#[derive(Debug, Clone, Copy, PartialEq, Eq)]
enum Encoding {
    Ascii,
    Little,
    Big,
}

/// Type of a number.
#[derive(Debug, Clone, Copy, PartialEq, Eq)]
enum Number {
    Int { bytes: usize, signed: bool },
    Float { bytes: usize },
}

#[derive(Debug)]
struct Property {
    name: String,
    /// Type of the count, if the property is a list.
    count: Option<Number>,
    value: Number,
}

#[derive(Debug)]
struct Element {
    name: String,
    count: u64,
    properties: Vec<Property>,
}

#[derive(Debug)]
struct Header {
    encoding: Encoding,
    elements: Vec<Element>,
    comments: Vec<String>,
    /// Byte offset of the data.
    end: usize,
}

impl Header {
    /// Returns the value of a comment that begins with `key`.
    fn comment(&self, key: &str) -> Option<&str> {
        self.comments.iter().find_map(|comment| comment.strip_prefix(key)).map(str::trim)
    }

    /// Returns the origin of the positions.
    fn origin(&self) -> Option<[f64; 3]> {
        let numbers = self.comment("origin ")?.split_whitespace().map(|word| word.parse::<f64>().ok());
        let numbers = <[f64; 3]>::try_from(numbers.collect::<Option<Vec<_>>>()?).ok()?;
        numbers.iter().all(|c| c.is_finite()).then_some(numbers)
    }

    /// Returns the reference system. The name `unknown` stands for none.
    fn crs(&self) -> Option<CrsReference> {
        let name = self.comment("crs ")?;
        Some(if name == "unknown" { CrsReference::default() } else { crs_reference(name) })
    }
}

impl Number {
    fn from_name(name: &str) -> Option<Self> {
        Some(match name {
            "char" | "int8" => Self::Int { bytes: 1, signed: true },
            "uchar" | "uint8" => Self::Int { bytes: 1, signed: false },
            "short" | "int16" => Self::Int { bytes: 2, signed: true },
            "ushort" | "uint16" => Self::Int { bytes: 2, signed: false },
            "int" | "int32" => Self::Int { bytes: 4, signed: true },
            "uint" | "uint32" => Self::Int { bytes: 4, signed: false },
            "float" | "float32" => Self::Float { bytes: 4 },
            "double" | "float64" => Self::Float { bytes: 8 },
            _ => return None,
        })
    }

    fn bytes(self) -> usize {
        match self {
            Self::Int { bytes, .. } | Self::Float { bytes } => bytes,
        }
    }
}

fn header(bytes: &[u8]) -> Result<Header, CityFault> {
    let (mut encoding, mut elements, mut comments, mut at) = (None, Vec::<Element>::new(), Vec::new(), 0);
    for number in 1.. {
        let place = format!("line {number}");
        let rest = &bytes[at..];
        // The limit keeps a file without line ends from being searched to its end.
        let end = rest.iter().take(4096).position(|&b| b == b'\n');
        let end = end.ok_or_else(|| CityFault::invalid("the header has no end_header line", place.clone()))?;
        let line = String::from_utf8_lossy(&rest[..end]).into_owned();
        at += end + 1;
        let words: Vec<&str> = line.split_whitespace().collect();
        match words[..] {
            ["format", name, _] => {
                encoding = Some(match name {
                    "ascii" => Encoding::Ascii,
                    "binary_little_endian" => Encoding::Little,
                    "binary_big_endian" => Encoding::Big,
                    _ => {
                        return Err(CityFault::unsupported(
                            "the format is not one of ascii, binary_little_endian and binary_big_endian",
                            place,
                        ));
                    }
                });
            }
            ["element", name, count] => {
                let count = count
                    .parse()
                    .map_err(|_| CityFault::invalid("the number of elements is not a whole number", place))?;
                elements.push(Element { name: name.to_owned(), count, properties: Vec::new() });
            }
            ["property", ..] => {
                let found = property(&words).zip(elements.last_mut());
                let (property, element) = found.ok_or_else(|| {
                    CityFault::invalid("the property is not valid in PLY, or stands before the first element", place)
                })?;
                element.properties.push(property);
            }
            ["comment", ..] => comments.push(words[1..].join(" ")),
            ["end_header"] => break,
            _ => {}
        }
    }
    let encoding = encoding.ok_or_else(|| CityFault::invalid("the header has no format line", "header"))?;
    Ok(Header { encoding, elements, comments, end: at })
}

fn property(words: &[&str]) -> Option<Property> {
    match *words {
        [_, "list", count, value, name] => {
            let count = Number::from_name(count).filter(|number| matches!(number, Number::Int { .. }))?;
            Some(Property { name: name.to_owned(), count: Some(count), value: Number::from_name(value)? })
        }
        [_, value, name] => Some(Property { name: name.to_owned(), count: None, value: Number::from_name(value)? }),
        _ => None,
    }
}

/// Reads elements into a model.
struct Reader<'a> {
    body: Body<'a>,
    builder: Builder,
    origin: [f64; 3],
    /// Whether the `class` of a face is the class of a surface.
    has_classes: bool,
}

impl Reader<'_> {
    fn element(&mut self, element: &Element, object: usize) -> Result<(), CityFault> {
        let axes = self.body.check(element)?;
        let is_vertex = element.name == "vertex";
        for number in 0..element.count {
            let mut point = [0.0; 3];
            let (mut ring, mut class) = (None, SurfaceClass::Unclassified);
            for (property, axis) in element.properties.iter().zip(&axes) {
                let corners = element.name == "face" && matches!(&*property.name, "vertex_indices" | "vertex_index");
                match (property.count, axis) {
                    (Some(count), _) => {
                        let list = self.body.list(count, property.value, corners)?;
                        if corners {
                            ring = Some(list);
                        }
                    }
                    (None, &Some(axis)) => point[axis] = self.body.number(property.value)?,
                    (None, None) => {
                        let value = self.body.number(property.value)?;
                        if self.has_classes && property.name == "class" {
                            class = SurfaceClass::from_number(value as u8).unwrap_or_default();
                        }
                    }
                }
            }
            if let Some(ring) = ring {
                self.face(ring, class, number, object);
            }
            if is_vertex {
                let point = [0, 1, 2].map(|i| point[i] + self.origin[i]);
                let added = self.builder.vertex(ModelPoint::from(point));
                added.ok_or_else(|| {
                    CityFault::unsupported("the model has more than 2^32 vertices, cut it into tiles", "header")
                })?;
            }
        }
        Ok(())
    }

    fn face(&mut self, corners: Vec<f64>, class: SurfaceClass, number: u64, object: usize) {
        let count = self.builder.vertex_count();
        let place = || format!("face {number}");
        let index = |corner: f64| (corner >= 0.0 && corner < count as f64).then_some(corner as u32).ok_or(corner);
        match corners.into_iter().map(index).collect::<Result<Vec<u32>, f64>>() {
            Err(corner) => {
                let detail = format!("vertex {corner}, {count} vertices so far");
                self.builder.dropped(DefectCode::VertexOutOfRange, object, place(), detail);
            }
            Ok(ring) if !ring.iter().all(|&vertex| self.builder.is_usable(vertex)) => {
                self.builder.dropped(DefectCode::CoordinateOutOfRange, object, place(), "");
            }
            Ok(ring) => {
                let surface = SurfacePolygon::new(vec![ring], class);
                self.builder.object_mut(object).geometries[0].surfaces.push(surface);
            }
        }
    }
}

/// A cursor over the data after the header.
struct Body<'a> {
    bytes: &'a [u8],
    at: usize,
    encoding: Encoding,
}

impl Body<'_> {
    /// Returns the number of bytes left.
    fn room(&self) -> usize {
        self.bytes.len() - self.at
    }

    /// Checks that the rest of the file can hold all of an element, and returns per property the
    /// axis that it is.
    fn check(&self, element: &Element) -> Result<Vec<Option<usize>>, CityFault> {
        if element.count == 0 {
            return Ok(Vec::new());
        }
        let (smallest, room) = (self.smallest(element), self.room());
        if smallest == 0 || element.count > (room / smallest) as u64 {
            let what = format!("the header announces {} of {}, {room} bytes are left", element.count, element.name);
            return Err(CityFault::invalid(what, "header"));
        }
        let axis_of = |p: &Property| ["x", "y", "z"].iter().position(|axis| *axis == p.name && p.count.is_none());
        let axes: Vec<Option<usize>> = element.properties.iter().map(axis_of).collect();
        if element.name == "vertex" && (0..3).any(|axis| !axes.contains(&Some(axis))) {
            return Err(CityFault::invalid("the vertices do not have the properties x, y and z", "header"));
        }
        Ok(axes)
    }

    /// Reads the position of an element, and skips its other properties.
    fn record(&mut self, element: &Element, axes: &[Option<usize>]) -> Result<[f64; 3], CityFault> {
        let mut point = [0.0; 3];
        for (property, axis) in element.properties.iter().zip(axes) {
            match (property.count, axis) {
                (Some(count), _) => drop(self.list(count, property.value, false)?),
                (None, &Some(axis)) => point[axis] = self.number(property.value)?,
                (None, None) => drop(self.number(property.value)?),
            }
        }
        Ok(point)
    }

    /// Returns the smallest size of an element, bytes: a number takes at least one byte in text.
    fn smallest(&self, element: &Element) -> usize {
        let each = |p: &Property| match self.encoding {
            Encoding::Ascii => 1,
            _ => p.count.unwrap_or(p.value).bytes(),
        };
        element.properties.iter().map(each).sum()
    }

    fn ends(&self) -> CityFault {
        CityFault::invalid("the file ends in the middle of its data", format!("byte {}", self.at))
    }

    /// Reads a list. Returns its numbers only with `keep`.
    fn list(&mut self, count: Number, value: Number, keep: bool) -> Result<Vec<f64>, CityFault> {
        let count = self.number(count)?;
        let least = if self.encoding == Encoding::Ascii { 1 } else { value.bytes() };
        if !(count >= 0.0 && count <= (self.room() / least) as f64) {
            return Err(self.ends());
        }
        let mut list = Vec::with_capacity(if keep { count as usize } else { 0 });
        for _ in 0..count as u64 {
            let number = self.number(value)?;
            if keep {
                list.push(number);
            }
        }
        Ok(list)
    }

    fn number(&mut self, kind: Number) -> Result<f64, CityFault> {
        if self.encoding == Encoding::Ascii {
            return self.word();
        }
        let end = self.at + kind.bytes();
        let mut bytes = [0u8; 8];
        let found = self.bytes.get(self.at..end).ok_or_else(|| self.ends())?;
        bytes[..found.len()].copy_from_slice(found);
        if self.encoding == Encoding::Big {
            bytes[..found.len()].reverse();
        }
        self.at = end;
        let unsigned = u64::from_le_bytes(bytes);
        Ok(match kind {
            Number::Float { bytes: 4 } => f64::from(f32::from_bits(unsigned as u32)),
            Number::Float { .. } => f64::from_bits(unsigned),
            Number::Int { signed: false, .. } => unsigned as f64,
            Number::Int { bytes: 1, .. } => f64::from(unsigned as i8),
            Number::Int { bytes: 2, .. } => f64::from(unsigned as i16),
            Number::Int { .. } => f64::from(unsigned as i32),
        })
    }

    fn word(&mut self) -> Result<f64, CityFault> {
        let rest = &self.bytes[self.at..];
        let start = rest.iter().position(|b| !b.is_ascii_whitespace()).ok_or_else(|| self.ends())?;
        let length = rest[start..].iter().position(u8::is_ascii_whitespace).unwrap_or(rest.len() - start);
        let word = std::str::from_utf8(&rest[start..start + length]).unwrap_or_default();
        let place = format!("byte {}", self.at + start);
        let number = word.parse().map_err(|_| {
            CityFault::invalid(
                format!("found {:?}, expected a number", word.chars().take(20).collect::<String>()),
                place,
            )
        })?;
        self.at += start + length;
        Ok(number)
    }
}
