//! CityGML 1.0, 2.0 and 3.0: objects, their surfaces, and the geometry of GML 3.
//!
//! One pass over the text, without a tree. Documents with a DTD are refused, no entity but the predefined ones is expanded,
//! and links (`xlink:href`) are followed inside the file only, to a bounded depth and number. Boundary surfaces give
//! polygons their class; a solid that links to them becomes one geometry with classes. Implicit
//! geometries are placed where they say. Curves, points, appearance and attributes are passed over.

mod assemble;
mod implicit;
mod walker;

use std::borrow::Cow;

use quick_xml::Reader;
use quick_xml::events::{BytesStart, Event};

use super::{CityFault, CityFormat, Parsed};
use crate::lines::Lines;
use walker::Walker;

/// Real files are about 25 levels deep.
const DEPTH_MAX: usize = 200;
/// More attributes than any element of CityGML has; the root names its many namespaces.
const ATTRIBUTES_MAX: usize = 256;

pub(super) fn parse(bytes: &[u8]) -> Result<Parsed, CityFault> {
    let text = decode(bytes)?;
    let mut reader = Reader::from_str(&text);
    let mut lines = Lines::new(&text);
    let mut version = None;
    let mut walker = Walker::default();
    loop {
        let line = lines.at(reader.buffer_position());
        let event = reader.read_event().map_err(|e| fault(format!("broken XML: {e}"), line))?;
        match event {
            Event::Start(e) => {
                let attributes = attributes(&e, line)?;
                let name = e.local_name();
                if version.is_none() {
                    version = Some(check_root(name.as_ref(), &attributes, line)?);
                }
                if walker.depth() == DEPTH_MAX {
                    return Err(fault(format!("XML elements are nested more than {DEPTH_MAX} deep"), line));
                }
                walker.start(name.as_ref(), &attributes, line)?;
            }
            Event::Empty(e) => {
                let attributes = attributes(&e, line)?;
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
            // Numbers need no entities: one among them makes the ring unreadable, elsewhere text is not looked at.
            Event::GeneralRef(_) => walker.text("&"),
            Event::DocType(_) => return Err(fault("the XML has a DTD, which is refused", line)),
            Event::Eof if walker.depth() > 0 => return Err(fault("the XML ends inside an element", line)),
            Event::Eof => break,
            _ => {}
        }
    }
    let version = version.ok_or_else(|| fault("the XML has no element", 1))?;
    let (model, defects) = walker.finish()?;
    Ok(Parsed { model, format: CityFormat::CityGml(version), defects })
}

fn fault(what: impl Into<String>, line: usize) -> CityFault {
    CityFault::invalid(what, format!("line {line}"))
}

/// The text: UTF-8, or Latin-1 where the declaration says so.
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

/// The attributes of an element by their local names, namespaces by `xmlns`.
type Attributes = Vec<(String, String)>;

fn attributes(e: &BytesStart<'_>, line: usize) -> Result<Attributes, CityFault> {
    let mut found = Vec::new();
    // The reader's own check for repeated names is quadratic in their number.
    for attribute in e.attributes().with_checks(false) {
        if found.len() == ATTRIBUTES_MAX {
            return Err(fault(format!("an XML element has more than {ATTRIBUTES_MAX} attributes"), line));
        }
        let broken = |e: &dyn std::fmt::Display| fault(format!("broken XML attribute: {e}"), line);
        let attribute = attribute.map_err(|e| broken(&e))?;
        let value = attribute.normalized_value(quick_xml::XmlVersion::Implicit1_0).map_err(|e| broken(&e))?;
        let key: &str = attribute.key.as_ref();
        let name = if key.starts_with("xmlns") { "xmlns" } else { key.rsplit(':').next().unwrap_or(key) };
        found.push((name.to_owned(), value.into_owned()));
    }
    Ok(found)
}

/// The value of an attribute.
fn attribute<'a>(attributes: &'a Attributes, name: &str) -> Option<&'a str> {
    attributes.iter().find(|(known, _)| known == name).map(|(_, value)| value.as_str())
}

/// The version of a `CityModel`.
fn check_root(name: &str, attributes: &Attributes, line: usize) -> Result<String, CityFault> {
    if name != "CityModel" {
        let name: String = name.chars().take(40).collect();
        let what = format!("the root element is {name}, expected the CityModel of CityGML");
        return Err(CityFault::unsupported(what, format!("line {line}")));
    }
    let spaces = attributes.iter().filter(|(name, value)| name == "xmlns" && value.contains("citygml"));
    let mut versions = spaces.filter_map(|(_, space)| space.rsplit('/').next());
    let version = versions.find(|version| ["1.0", "2.0", "3.0"].contains(version));
    version.map(str::to_owned).ok_or_else(|| {
        CityFault::unsupported("no namespace of CityGML 1.0, 2.0 or 3.0 at the root", format!("line {line}"))
    })
}
