//! Reads Wavefront OBJ: vertices and polygons.
//!
//! Objects and groups become city objects. Materials with the names of CityGML's surfaces (`usemtl
//! RoofSurface`) become classes. Material files are not opened, lines and curves are skipped. A
//! comment `# crs EPSG:n` at the top names the reference system.

use std::collections::HashMap;

use city::{CrsReference, DefectCode, Geometry, GeometryKind, ModelPoint, ObjectKind, SurfaceClass, SurfacePolygon};

use super::builder::Builder;
use super::crs_name::crs_reference;
use super::error::CityFault;
use super::format::{CityFormat, Parsed};

/// Keywords at the beginning of a line.
const KEYWORDS: [&str; 12] = ["v", "vt", "vn", "vp", "f", "o", "g", "s", "l", "p", "mtllib", "usemtl"];

/// Returns whether the first line that is neither empty nor a comment begins with a keyword of OBJ.
pub(super) fn looks_like(text: &[u8]) -> bool {
    let head = String::from_utf8_lossy(&text[..text.len().min(100_000)]);
    let mut words = head.lines().filter_map(|line| line.split_whitespace().next());
    words.find(|word| !word.starts_with('#')).is_some_and(|word| KEYWORDS.contains(&word))
}

pub(super) fn parse(text: &[u8]) -> Result<Parsed, CityFault> {
    let text = std::str::from_utf8(text)
        .map_err(|error| CityFault::invalid("the text is not UTF-8", format!("byte {}", error.valid_up_to())))?;
    let mut reader = Reader::default();
    reader.builder.set_crs(stated_crs(text));
    let (mut number, mut joined) = (0, String::new());
    for (index, line) in text.lines().enumerate() {
        if joined.is_empty() {
            number = index + 1;
        }
        // A backslash at the end of a line continues it on the next line.
        if let Some(head) = line.trim_end().strip_suffix('\\') {
            joined.push_str(head);
            joined.push(' ');
            continue;
        }
        if joined.is_empty() {
            reader.line(line, number)?;
        } else {
            joined.push_str(line);
            reader.line(&std::mem::take(&mut joined), number)?;
        }
    }
    reader.line(&joined, number)?;
    let (model, defects) = reader.builder.finish();
    Ok(Parsed { model, format: CityFormat::Obj, defects })
}

/// Returns the reference system in a comment `# crs EPSG:n` at the top, as
/// [`write_mesh`](super::write_mesh) writes it.
fn stated_crs(text: &str) -> CrsReference {
    let comments = text.lines().map_while(|line| line.strip_prefix('#'));
    let name = comments.filter_map(|line| line.trim().strip_prefix("crs ")).next().unwrap_or("unknown");
    if name == "unknown" { CrsReference::default() } else { crs_reference(name) }
}

#[derive(Default)]
struct Reader {
    builder: Builder,
    /// Object that the next faces belong to.
    object: Option<usize>,
    /// Objects by name.
    object_of: HashMap<String, usize>,
    class: SurfaceClass,
}

impl Reader {
    /// Reads a line.
    fn line(&mut self, line: &str, number: usize) -> Result<(), CityFault> {
        let line = line.split('#').next().unwrap_or_default();
        let mut words = line.split_whitespace();
        match words.next() {
            Some("v") => self.vertex(words, number),
            Some("f") => {
                self.face(words, number);
                Ok(())
            }
            Some("o" | "g") => {
                let name = words.collect::<Vec<_>>().join(" ");
                self.object = Some(self.object(if name.is_empty() { "model" } else { &name }));
                Ok(())
            }
            Some("usemtl") => {
                let class = SurfaceClass::from_name(words.next().unwrap_or_default());
                self.class = if class == SurfaceClass::Other { SurfaceClass::Unclassified } else { class };
                Ok(())
            }
            _ => Ok(()),
        }
    }

    /// Returns the object with a name, and adds it if it is new.
    fn object(&mut self, name: &str) -> usize {
        if let Some(&object) = self.object_of.get(name) {
            return object;
        }
        let object = self.builder.object(name, ObjectKind::BUILDING);
        self.builder.object_mut(object).geometries.push(Geometry::new(None, GeometryKind::MultiSurface));
        self.object_of.insert(name.to_owned(), object);
        object
    }

    /// Adds a vertex.
    fn vertex<'a>(&mut self, words: impl Iterator<Item = &'a str>, number: usize) -> Result<(), CityFault> {
        let place = || format!("line {number}");
        let mut point = [0.0; 3];
        let mut words = words;
        for coordinate in &mut point {
            let word =
                words.next().ok_or_else(|| CityFault::invalid("a vertex has fewer than three coordinates", place()))?;
            *coordinate = word.parse().map_err(|_| {
                let word: String = word.chars().take(20).collect();
                CityFault::invalid(format!("found {word:?}, expected a coordinate"), place())
            })?;
        }
        let added = self.builder.vertex(ModelPoint::from(point));
        added
            .map(drop)
            .ok_or_else(|| CityFault::unsupported("the model has more than 2^32 vertices, cut it into tiles", place()))
    }

    /// Adds a polygon to the current object.
    fn face<'a>(&mut self, words: impl Iterator<Item = &'a str>, number: usize) {
        let object = match self.object {
            Some(object) => object,
            None => self.object("model"),
        };
        let count = self.builder.vertex_count();
        let ring: Result<Vec<u32>, &str> = words.map(|word| index(word, count).ok_or(word)).collect();
        let place = || format!("line {number}");
        match ring {
            Err(word) => {
                let word: String = word.chars().take(40).collect();
                let detail = format!("vertex {word:?}, {count} vertices so far");
                self.builder.dropped(DefectCode::VertexOutOfRange, object, place(), detail);
            }
            Ok(ring) if !ring.iter().all(|&vertex| self.builder.is_usable(vertex)) => {
                self.builder.dropped(DefectCode::CoordinateOutOfRange, object, place(), "");
            }
            Ok(ring) => {
                let surface = SurfacePolygon::new(vec![ring], self.class);
                self.builder.object_mut(object).geometries[0].surfaces.push(surface);
            }
        }
    }
}

/// Returns the index, from 0, of the vertex in `7`, `7/1/2` (counted from 1) or `-1` (counted from
/// the last vertex).
fn index(word: &str, count: usize) -> Option<u32> {
    let number: i64 = word.split('/').next()?.parse().ok()?;
    let index = if number < 0 { number.checked_add(i64::try_from(count).ok()?)? } else { number - 1 };
    u32::try_from(index).ok().filter(|&index| (index as usize) < count)
}
