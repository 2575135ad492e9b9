//! A walk over the leaves of an XML document, with limits.
//!
//! Documents with a DTD are refused. Only the five predefined entities and character references are
//! expanded, and nothing is fetched. The depth is limited here, the size of the text by the caller.

use quick_xml::Reader;
use quick_xml::events::{BytesStart, Event};

use super::error::Fault;
use crate::lines::Lines;

/// Deepest nesting that is read; RPC documents have about six levels.
const DEPTH_MAX: usize = 64;
/// Most attributes of an element; no metadata format has that many.
const ATTRIBUTES_MAX: usize = 256;

/// An open element.
#[derive(Debug)]
pub(super) struct Element {
    pub(super) name: String,
    attributes: Vec<(String, String)>,
}

impl Element {
    /// The value of an attribute.
    pub(super) fn attribute(&self, name: &str) -> Option<&str> {
        self.attributes.iter().find(|(n, _)| n == name).map(|(_, v)| v.as_str())
    }
}

/// An element without children: its path (the root first, itself last), its text and its line.
#[derive(Debug)]
pub(super) struct Leaf<'a> {
    pub(super) path: &'a [Element],
    pub(super) text: &'a str,
    pub(super) line: usize,
}

impl Leaf<'_> {
    /// The names of the last `N` elements of the path.
    pub(super) fn tail<const N: usize>(&self) -> Option<[&str; N]> {
        let start = self.path.len().checked_sub(N)?;
        let mut names = [""; N];
        for (name, element) in names.iter_mut().zip(self.path.get(start..)?) {
            *name = &element.name;
        }
        Some(names)
    }

    /// The name of the leaf.
    pub(super) fn name(&self) -> &str {
        self.path.last().map_or("", |e| &e.name)
    }
}

/// Returns the name of the root element, if there is one.
pub(super) fn root(text: &str) -> Option<String> {
    let mut reader = Reader::from_str(text);
    loop {
        match reader.read_event() {
            Ok(Event::Start(e) | Event::Empty(e)) => return Some(local_name(&e)),
            Ok(Event::Eof) | Err(_) => return None,
            Ok(_) => {}
        }
    }
}

/// Calls `visit` for every leaf in document order.
pub(super) fn walk(text: &str, mut visit: impl FnMut(Leaf<'_>) -> Result<(), Fault>) -> Result<(), Fault> {
    let mut reader = Reader::from_str(text);
    let mut lines = Lines::new(text);
    let mut path: Vec<Element> = Vec::new();
    let mut content = String::new();
    let mut is_leaf = false;
    loop {
        let line = lines.at(reader.buffer_position());
        let event = reader.read_event().map_err(|e| syntax(format!("broken XML: {e}"), line))?;
        match event {
            Event::Start(e) => {
                path.push(element(&e, line)?);
                if path.len() > DEPTH_MAX {
                    return Err(syntax(format!("XML elements are nested more than {DEPTH_MAX} deep"), line));
                }
                content.clear();
                is_leaf = true;
            }
            Event::Empty(e) => {
                path.push(element(&e, line)?);
                visit(Leaf { path: &path, text: "", line })?;
                path.pop();
                is_leaf = false;
            }
            Event::End(_) => {
                if is_leaf {
                    visit(Leaf { path: &path, text: content.trim(), line })?;
                }
                path.pop();
                is_leaf = false;
            }
            Event::Text(t) if is_leaf => content.push_str(&t.xml10_content()),
            Event::CData(t) if is_leaf => content.push_str(&t.xml10_content()),
            Event::GeneralRef(r) => content.push(reference(&r.xml10_content(), line)?),
            Event::DocType(_) => {
                return Err(syntax("the XML has a DTD, which is refused: remove the DOCTYPE".to_owned(), line));
            }
            Event::Eof if path.is_empty() => return Ok(()),
            Event::Eof => return Err(syntax(format!("the XML ends inside <{}>", path[path.len() - 1].name), line)),
            _ => {}
        }
    }
}

fn syntax(what: String, line: usize) -> Fault {
    Fault::Syntax { what, line: Some(line) }
}

fn local_name(e: &BytesStart<'_>) -> String {
    e.local_name().as_ref().to_owned()
}

fn element(e: &BytesStart<'_>, line: usize) -> Result<Element, Fault> {
    let mut attributes = Vec::new();
    // The reader's check for repeated names takes quadratic time.
    for attribute in e.attributes().with_checks(false) {
        if attributes.len() == ATTRIBUTES_MAX {
            return Err(syntax(format!("an XML element has more than {ATTRIBUTES_MAX} attributes"), line));
        }
        let attribute = attribute.map_err(|e| syntax(format!("broken XML attribute: {e}"), line))?;
        let value = attribute
            .normalized_value(quick_xml::XmlVersion::Implicit1_0)
            .map_err(|e| syntax(format!("broken XML attribute: {e}"), line))?;
        attributes.push((attribute.key.as_ref().to_owned(), value.into_owned()));
    }
    Ok(Element { name: local_name(e), attributes })
}

/// Returns the character that `&name;` stands for.
fn reference(name: &str, line: usize) -> Result<char, Fault> {
    let code = |digits: &str, radix| u32::from_str_radix(digits, radix).ok().and_then(char::from_u32);
    let character = match name {
        "lt" => Some('<'),
        "gt" => Some('>'),
        "amp" => Some('&'),
        "apos" => Some('\''),
        "quot" => Some('"'),
        _ => match name.strip_prefix('#') {
            Some(n) => n.strip_prefix('x').map_or_else(|| code(n, 10), |hex| code(hex, 16)),
            None => None,
        },
    };
    character.ok_or_else(|| syntax(format!("unknown XML entity &{name}; in the text"), line))
}
