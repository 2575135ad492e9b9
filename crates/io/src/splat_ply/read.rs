//! Splats in. Properties are found by name, so files of other programs are read as well; what is not known is passed over.

use std::collections::HashMap;
use std::path::Path;

use gaussian::Splat;

use super::{LocalOrigin, SH_C0, SplatFile, SplatForm, SplatLayout, SplatPlyError, invalid};

/// Longest header that is searched for its end.
const HEADER_LIMIT: usize = 1 << 20;
/// Thickness of a disc, in parts of its smaller scale.
const DISC_THICKNESS: f32 = 1e-3;

/// Where the numbers of one splat are.
struct Header {
    count: u64,
    /// Byte offset and size of each float property of a row.
    floats: HashMap<String, (usize, usize)>,
    row: usize,
    body: usize,
}

/// Reads splats and the origin beside them.
///
/// # Errors
/// A file that cannot be read, is no little-endian binary PLY of Gaussians, or is shorter than its header says; a splat with
/// numbers that make none; an origin that is none.
pub fn read(path: &Path) -> Result<SplatFile, SplatPlyError> {
    let bytes = std::fs::read(path).map_err(|source| SplatPlyError::Unreadable { path: path.to_owned(), source })?;
    let header = header(&bytes).map_err(|what| invalid(path, what))?;
    let room = (bytes.len() - header.body) / header.row.max(1);
    if header.row == 0 || header.count > room as u64 {
        let what = format!("{} splats are announced, and the file has room for {room}", header.count);
        return Err(invalid(path, what));
    }
    let columns = Columns::of(&header).map_err(|what| invalid(path, what))?;
    let rows = bytes[header.body..].chunks_exact(header.row).take(header.count as usize);
    let mut splats = Vec::with_capacity(header.count as usize);
    for (index, row) in rows.enumerate() {
        let splat = columns.splat(row);
        splat.validate().map_err(|defect| invalid(path, format!("splat {index}: {defect}")))?;
        splats.push(splat);
    }
    Ok(SplatFile { splats, layout: columns.layout, origin: LocalOrigin::read_beside(path)? })
}

fn header(bytes: &[u8]) -> Result<Header, String> {
    let text = &bytes[..bytes.len().min(HEADER_LIMIT)];
    let mark = b"end_header\n";
    let end = text.windows(mark.len()).position(|w| w == mark).ok_or("no PLY header was found")?;
    let text = std::str::from_utf8(&text[..end]).map_err(|_| "the PLY header is no text")?;
    let mut lines = text.lines();
    if lines.next().map(str::trim) != Some("ply") {
        return Err("the file does not begin with \"ply\"".to_owned());
    }
    let mut header = Header { count: 0, floats: HashMap::new(), row: 0, body: end + mark.len() };
    let (mut binary, mut element) = (false, None);
    for line in lines {
        let words: Vec<&str> = line.split_whitespace().collect();
        match words[..] {
            ["format", name, _] => binary = name == "binary_little_endian",
            ["element", name, count] => {
                if element.is_none() {
                    header.count = count.parse().map_err(|_| format!("the count {count:?} is no number"))?;
                    element = Some(name == "vertex");
                } else {
                    element = Some(false);
                }
            }
            ["property", kind, name] if element == Some(true) => header.property(kind, name)?,
            ["property", ..] if element == Some(true) => return Err("a vertex has a list, splats have none".to_owned()),
            _ => {}
        }
    }
    if !binary {
        return Err("the PLY is not binary_little_endian".to_owned());
    }
    Ok(header)
}

impl Header {
    fn property(&mut self, kind: &str, name: &str) -> Result<(), String> {
        let size = match kind {
            "char" | "uchar" | "int8" | "uint8" => 1,
            "short" | "ushort" | "int16" | "uint16" => 2,
            "int" | "uint" | "int32" | "uint32" | "float" | "float32" => 4,
            "double" | "float64" => 8,
            _ => return Err(format!("{kind:?} is no type of PLY")),
        };
        if matches!(kind, "float" | "float32" | "double" | "float64") {
            self.floats.insert(name.to_owned(), (self.row, size));
        }
        self.row += size;
        Ok(())
    }
}

/// Where each number of a splat stands in a row.
struct Columns {
    position: [(usize, usize); 3],
    colour: [(usize, usize); 3],
    opacity: (usize, usize),
    scale: [(usize, usize); 3],
    rotation: [(usize, usize); 4],
    layout: SplatLayout,
}

impl Columns {
    fn of(header: &Header) -> Result<Self, String> {
        let column = |name: &str| {
            let missing = || format!("the vertices have no float property {name:?}: not a file of splats");
            header.floats.get(name).copied().ok_or_else(missing)
        };
        let numbered = |name: &str, i: usize| column(&format!("{name}_{i}"));
        let (first, second) = (numbered("scale", 0)?, numbered("scale", 1)?);
        let third = numbered("scale", 2).ok();
        let rest = header.floats.keys().filter(|name| name.starts_with("f_rest_")).count();
        let degree = (0..=super::SH_DEGREE_MAX)
            .find(|&sh_degree| SplatLayout { sh_degree, ..SplatLayout::default() }.rest() == rest)
            .ok_or_else(|| format!("{rest} f_rest properties are no degree of harmonics"))?;
        Ok(Self {
            position: [column("x")?, column("y")?, column("z")?],
            colour: [numbered("f_dc", 0)?, numbered("f_dc", 1)?, numbered("f_dc", 2)?],
            opacity: column("opacity")?,
            scale: [first, second, third.unwrap_or(first)],
            rotation: [numbered("rot", 0)?, numbered("rot", 1)?, numbered("rot", 2)?, numbered("rot", 3)?],
            layout: SplatLayout {
                form: if third.is_some() { SplatForm::Ellipsoids } else { SplatForm::Discs },
                sh_degree: degree,
            },
        })
    }

    fn splat(&self, row: &[u8]) -> Splat {
        let value = |(at, size): (usize, usize)| match *row[at..at + size].as_ref() {
            [a, b, c, d] => f64::from(f32::from_le_bytes([a, b, c, d])),
            [a, b, c, d, e, f, g, h] => f64::from_le_bytes([a, b, c, d, e, f, g, h]),
            _ => f64::NAN,
        };
        let rotation = self.rotation.map(value);
        // Trainers keep quaternions of any length and bring them to 1 when they use them.
        let length = rotation.iter().map(|q| q * q).sum::<f64>().sqrt();
        let mut scale_m = self.scale.map(|s| value(s).exp() as f32);
        if self.layout.form == SplatForm::Discs {
            scale_m[2] = DISC_THICKNESS * scale_m[0].min(scale_m[1]);
        }
        let opacity = 1.0 / (1.0 + (-value(self.opacity)).exp());
        Splat {
            position: self.position.map(|p| value(p) as f32),
            scale_m,
            rotation: rotation.map(|q| (q / length) as f32),
            colour: self.colour.map(|c| (0.5 + SH_C0 * value(c)) as f32),
            // Logits beyond ±17 round to 0 or 1 in f32, which have none.
            opacity: (opacity as f32).clamp(f32::MIN_POSITIVE, 1.0 - f32::EPSILON),
        }
    }
}
