//! Reads CityGML 1.0, 2.0 and 3.0: objects, their surfaces, and the geometry of GML 3.
//!
//! The text is read in one pass, without a tree. A document with a DTD is refused, and only
//! predefined entities are expanded. Links (`xlink:href`) are followed only within the file, to a
//! limited depth and number. Boundary surfaces give polygons their class. A solid that links to
//! them becomes one geometry with classes. Implicit geometries are placed by their matrix and
//! reference point. Attributes, addresses, materials and textures are kept as CityJSON has them.
//! Curves and points are skipped.

mod appearance;
mod assemble;
mod attributes;
mod boundary;
mod implicit;
mod links;
mod open_polygon;
mod paint;
mod properties;
mod walker;

use std::borrow::Cow;

use quick_xml::Reader;
use quick_xml::events::Event;

use super::error::CityFault;
use super::format::{CityFormat, Parsed};
use attributes::Attributes;
use formats::lines::Lines;
use walker::Walker;

/// Limit of the depth of elements. Real files have about 25 levels.
const DEPTH_MAX: usize = 200;

pub(super) fn parse(bytes: &[u8]) -> Result<Parsed, CityFault> {
    let text = decode(bytes)?;
    let mut reader = Reader::from_str(&text);
    let mut lines = Lines::new(&text);
    let mut version = None;
    let mut walker = Walker::default();
    loop {
        let line = lines.at(reader.buffer_position());
        let event = reader.read_event().map_err(|e| CityFault::in_line(format!("invalid XML: {e}"), line))?;
        match event {
            Event::Start(e) => {
                let attributes = Attributes::read(&e, line)?;
                let name = e.local_name();
                if version.is_none() {
                    version = Some(check_root(name.as_ref(), &attributes, line)?);
                }
                if walker.depth() == DEPTH_MAX {
                    return Err(CityFault::in_line(
                        format!("XML elements are nested more than {DEPTH_MAX} deep"),
                        line,
                    ));
                }
                walker.start(name.as_ref(), &attributes, line)?;
            }
            Event::Empty(e) => {
                let attributes = Attributes::read(&e, line)?;
                let name = e.local_name();
                if version.is_none() {
                    version = Some(check_root(name.as_ref(), &attributes, line)?);
                }
                walker.start(name.as_ref(), &attributes, line)?;
                walker.end();
            }
            Event::End(_) => walker.end(),
            Event::Text(t) => walker.text(&t.xml10_content()),
            Event::CData(t) => walker.text(&t.xml10_content()),
            // An entity among numbers makes the ring invalid.
            Event::GeneralRef(e) => walker.text(&entity(&e)),
            Event::DocType(_) => return Err(CityFault::in_line("the XML has a DTD, remove it", line)),
            Event::Eof if walker.depth() > 0 => return Err(CityFault::in_line("the XML ends inside an element", line)),
            Event::Eof => break,
            _ => {}
        }
    }
    let version = version.ok_or_else(|| CityFault::in_line("the XML has no element", 1))?;
    let (model, defects) = walker.finish()?;
    Ok(Parsed { model, format: CityFormat::CityGml(version), defects })
}

/// Returns the character of a predefined entity or a character reference, and `&` for others.
fn entity(e: &quick_xml::events::BytesRef<'_>) -> String {
    if let Ok(Some(character)) = e.resolve_char_ref() {
        return character.to_string();
    }
    let name: &str = e.as_ref();
    match name {
        "lt" => "<",
        "gt" => ">",
        "quot" => "\"",
        "apos" => "'",
        _ => "&",
    }
    .to_owned()
}

/// Decodes the text: UTF-8, or Latin-1 if the XML declaration names it.
fn decode(bytes: &[u8]) -> Result<Cow<'_, str>, CityFault> {
    std::str::from_utf8(bytes).map(Cow::Borrowed).or_else(|error| {
        let head = String::from_utf8_lossy(&bytes[..bytes.len().min(200)]).to_ascii_lowercase();
        if head.contains("iso-8859-1") || head.contains("windows-1252") {
            return Ok(Cow::Owned(bytes.iter().map(|&byte| char::from(byte)).collect()));
        }
        Err(CityFault::invalid(
            "the text is neither UTF-8 nor declared as Latin-1",
            format!("byte {}", error.valid_up_to()),
        ))
    })
}

/// Checks that the root is a `CityModel`, and returns its version.
fn check_root(name: &str, attributes: &Attributes, line: usize) -> Result<String, CityFault> {
    if name != "CityModel" {
        let name: String = name.chars().take(40).collect();
        let what = format!("the root element is {name}, expected CityModel of CityGML");
        return Err(CityFault::unsupported(what, format!("line {line}")));
    }
    let spaces = attributes.namespaces().filter(|space| space.contains("citygml"));
    let mut versions = spaces.filter_map(|space| space.rsplit('/').next());
    let version = versions.find(|version| ["1.0", "2.0", "3.0"].contains(version));
    version.map(str::to_owned).ok_or_else(|| {
        CityFault::unsupported("the root declares no namespace of CityGML 1.0, 2.0 or 3.0", format!("line {line}"))
    })
}
