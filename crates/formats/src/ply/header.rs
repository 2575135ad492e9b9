//! The header of a PLY file.

use std::io::Write;

/// Longest line of a header, bytes: a file without line ends is not searched to its end.
const LINE_LIMIT: usize = 4096;

/// What is wrong with a PLY file, and where.
#[derive(Debug, Clone, PartialEq, Eq, thiserror::Error)]
#[error("{what} ({place})")]
pub struct PlyFault {
    /// What was found, and what was expected.
    pub what: String,
    /// Place in the file: `line 7`, `byte 1234`, or `header`.
    pub place: String,
    /// Whether the file may be valid, but is of a kind that is not read.
    pub is_unsupported: bool,
}

impl PlyFault {
    /// Creates a fault for a file that breaks the rules of the format.
    pub fn new(what: impl Into<String>, place: impl Into<String>) -> Self {
        Self { what: what.into(), place: place.into(), is_unsupported: false }
    }
}

/// How numbers are written.
#[derive(Debug, Clone, Copy, PartialEq, Eq)]
pub enum PlyEncoding {
    /// As text, between spaces.
    Ascii,
    /// Binary, the lowest byte first.
    LittleEndian,
    /// Binary, the highest byte first.
    BigEndian,
}

/// Type of a number.
#[derive(Debug, Clone, Copy, PartialEq, Eq)]
pub enum PlyNumber {
    /// `char`
    I8,
    /// `uchar`
    U8,
    /// `short`
    I16,
    /// `ushort`
    U16,
    /// `int`
    I32,
    /// `uint`
    U32,
    /// `float`
    F32,
    /// `double`
    F64,
}

impl PlyNumber {
    fn from_name(name: &str) -> Option<Self> {
        Some(match name {
            "char" | "int8" => Self::I8,
            "uchar" | "uint8" => Self::U8,
            "short" | "int16" => Self::I16,
            "ushort" | "uint16" => Self::U16,
            "int" | "int32" => Self::I32,
            "uint" | "uint32" => Self::U32,
            "float" | "float32" => Self::F32,
            "double" | "float64" => Self::F64,
            _ => return None,
        })
    }

    /// Whether the type is one of floating-point numbers.
    pub fn is_float(self) -> bool {
        matches!(self, Self::F32 | Self::F64)
    }

    /// Returns the size of a binary number, bytes.
    pub fn bytes(self) -> usize {
        match self {
            Self::I8 | Self::U8 => 1,
            Self::I16 | Self::U16 => 2,
            Self::I32 | Self::U32 | Self::F32 => 4,
            Self::F64 => 8,
        }
    }

    /// Returns the value of the little-endian number with which `from` begins.
    ///
    /// # Panics
    /// If `from` is shorter than the number.
    pub fn value(self, from: &[u8]) -> f64 {
        fn first<const N: usize>(from: &[u8]) -> [u8; N] {
            std::array::from_fn(|i| from[i])
        }
        match self {
            Self::I8 => f64::from(i8::from_le_bytes(first(from))),
            Self::U8 => f64::from(from[0]),
            Self::I16 => f64::from(i16::from_le_bytes(first(from))),
            Self::U16 => f64::from(u16::from_le_bytes(first(from))),
            Self::I32 => f64::from(i32::from_le_bytes(first(from))),
            Self::U32 => f64::from(u32::from_le_bytes(first(from))),
            Self::F32 => f64::from(f32::from_le_bytes(first(from))),
            Self::F64 => f64::from_le_bytes(first(from)),
        }
    }
}

/// A property of an element.
#[derive(Debug, Clone, PartialEq, Eq)]
pub struct PlyProperty {
    /// Its name.
    pub name: String,
    /// Type of the count, if the property is a list.
    pub count: Option<PlyNumber>,
    /// Type of its value, or of the values of the list.
    pub value: PlyNumber,
}

/// An element: records with the same properties.
#[derive(Debug, Clone, PartialEq, Eq)]
pub struct PlyElement {
    /// Its name.
    pub name: String,
    /// Number of records.
    pub count: u64,
    /// The properties, in the order of a record.
    pub properties: Vec<PlyProperty>,
}

impl PlyElement {
    /// Returns the size of a binary record, bytes; `None` where a list makes it vary.
    pub fn record_bytes(&self) -> Option<usize> {
        self.properties.iter().map(|property| property.count.is_none().then(|| property.value.bytes())).sum()
    }

    /// Returns the byte offset within a binary record, and the type, of a property that is a number
    /// behind no list.
    pub fn column(&self, name: &str) -> Option<(usize, PlyNumber)> {
        let mut at = 0;
        for property in self.properties.iter().take_while(|property| property.count.is_none()) {
            if property.name == name {
                return Some((at, property.value));
            }
            at += property.value.bytes();
        }
        None
    }
}

/// The header of a file.
#[derive(Debug, Clone, PartialEq, Eq)]
pub struct PlyHeader {
    /// How the numbers are written.
    pub encoding: PlyEncoding,
    /// The elements in the order of the file.
    pub elements: Vec<PlyElement>,
    /// The comments, without the word that makes them one.
    pub comments: Vec<String>,
    /// Byte offset of the data.
    pub end: usize,
}

/// Returns whether a file begins like a PLY file.
pub fn looks_like_ply(bytes: &[u8]) -> bool {
    bytes.starts_with(b"ply\n") || bytes.starts_with(b"ply\r")
}

impl PlyHeader {
    /// Reads the header of a file.
    ///
    /// # Errors
    /// [`PlyFault`] for a file that does not begin like PLY, has no format or an unknown one, or a
    /// header that breaks off or names a property or a number of elements that PLY does not know.
    ///
    /// ```
    /// use formats::ply::{PlyEncoding, PlyHeader};
    ///
    /// let text = b"ply\nformat ascii 1.0\ncomment origin 10 20 3\nelement vertex 1\nproperty float x\nend_header\n7\n";
    /// let header = PlyHeader::parse(text)?;
    /// assert_eq!((header.encoding, header.elements[0].count), (PlyEncoding::Ascii, 1));
    /// assert_eq!((header.origin(), header.end), (Some([10.0, 20.0, 3.0]), text.len() - 2));
    /// # Ok::<(), Box<dyn std::error::Error>>(())
    /// ```
    pub fn parse(bytes: &[u8]) -> Result<Self, PlyFault> {
        if !looks_like_ply(bytes) {
            return Err(PlyFault::new("the file does not begin with \"ply\"", "line 1"));
        }
        let (mut encoding, mut elements, mut comments, mut at) = (None, Vec::<PlyElement>::new(), Vec::new(), 0);
        for number in 1.. {
            let place = format!("line {number}");
            let rest = &bytes[at..];
            let end = rest.iter().take(LINE_LIMIT).position(|&b| b == b'\n');
            let end = end.ok_or_else(|| PlyFault::new("the header has no end_header line", place.clone()))?;
            let line = String::from_utf8_lossy(&rest[..end]).into_owned();
            at += end + 1;
            let words: Vec<&str> = line.split_whitespace().collect();
            match words[..] {
                ["format", name, _] => {
                    encoding = Some(match name {
                        "ascii" => PlyEncoding::Ascii,
                        "binary_little_endian" => PlyEncoding::LittleEndian,
                        "binary_big_endian" => PlyEncoding::BigEndian,
                        _ => {
                            let what =
                                "the format is not one of ascii, binary_little_endian and binary_big_endian".to_owned();
                            return Err(PlyFault { what, place, is_unsupported: true });
                        }
                    });
                }
                ["element", name, count] => {
                    let not_whole = |_| PlyFault::new("the number of elements is not a whole number", place);
                    let count = count.parse().map_err(not_whole)?;
                    elements.push(PlyElement { name: name.to_owned(), count, properties: Vec::new() });
                }
                ["property", ..] => {
                    let (property, element) = property(&words).zip(elements.last_mut()).ok_or_else(|| {
                        PlyFault::new("the property is not valid in PLY, or stands before the first element", place)
                    })?;
                    element.properties.push(property);
                }
                ["comment", ..] => comments.push(words[1..].join(" ")),
                ["end_header"] => break,
                _ => {}
            }
        }
        let encoding = encoding.ok_or_else(|| PlyFault::new("the header has no format line", "header"))?;
        Ok(Self { encoding, elements, comments, end: at })
    }

    /// Returns the origin of the positions, if a comment says it.
    pub fn origin(&self) -> Option<[f64; 3]> {
        let numbers = self.comment("origin ")?.split_whitespace().map(|word| word.parse::<f64>().ok());
        let numbers = <[f64; 3]>::try_from(numbers.collect::<Option<Vec<_>>>()?).ok()?;
        numbers.iter().all(|c| c.is_finite()).then_some(numbers)
    }

    /// Returns the definition of the reference system, if a comment says it.
    pub fn crs(&self) -> Option<&str> {
        self.comment("crs ")
    }

    /// Returns the value of a comment that begins with `key`.
    fn comment(&self, key: &str) -> Option<&str> {
        self.comments.iter().find_map(|comment| comment.strip_prefix(key)).map(str::trim)
    }
}

fn property(words: &[&str]) -> Option<PlyProperty> {
    match *words {
        [_, "list", count, value, name] => {
            let count = PlyNumber::from_name(count).filter(|number| !number.is_float())?;
            Some(PlyProperty { name: name.to_owned(), count: Some(count), value: PlyNumber::from_name(value)? })
        }
        [_, value, name] => {
            Some(PlyProperty { name: name.to_owned(), count: None, value: PlyNumber::from_name(value)? })
        }
        _ => None,
    }
}

/// Writes the header of a binary little-endian file: its comments, and per element the name, the
/// number of records and the properties as `float x` or `list uchar int vertex_indices`. Of a
/// comment, characters that would break the header are left out.
///
/// # Errors
/// Those of the writer.
pub fn write_header(
    out: &mut dyn Write,
    comments: &[String],
    elements: &[(&str, usize, &[&str])],
) -> std::io::Result<()> {
    writeln!(out, "ply\nformat binary_little_endian 1.0")?;
    for comment in comments {
        let line: String = comment.chars().filter(|c| !c.is_control()).collect();
        writeln!(out, "comment {line}")?;
    }
    for (name, count, properties) in elements {
        writeln!(out, "element {name} {count}")?;
        properties.iter().try_for_each(|property| writeln!(out, "property {property}"))?;
    }
    writeln!(out, "end_header")
}
