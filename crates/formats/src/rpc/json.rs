//! RPC in JSON, at the top level or under `rpc`.
//!
//! The keys are rpcm's names (`row_offset`, `col_num`, …) or GeoTIFF's (`LINE_OFF`, …). Image
//! coordinates are counted from 0. Values are numbers, lists of numbers, or strings as GDAL writes
//! them.

use std::fmt;

use serde::de::{Deserialize, Deserializer, Error, MapAccess, SeqAccess, Visitor};

use super::draft::{Draft, Entry};
use super::error::Fault;
use super::names::{Field, Names, RPC00B};
use super::rpc_file::Parsed;

/// The names of rpcm's dictionary.
pub(super) const RPCM: Names = Names {
    scalars: [
        "row_offset",
        "col_offset",
        "lat_offset",
        "lon_offset",
        "alt_offset",
        "row_scale",
        "col_scale",
        "lat_scale",
        "lon_scale",
        "alt_scale",
        "err_bias",
        "err_rand",
    ],
    polys: ["row_num", "row_den", "col_num", "col_den"],
    separator: "_",
    first: 1,
};

/// Whether the text starts like a JSON object and names an RPC.
pub(super) fn recognise(text: &str) -> bool {
    text.starts_with('{') && ["\"rpc\"", "\"row_", "\"col_", "\"LINE_", "\"SAMP_"].iter().any(|k| text.contains(k))
}

/// Reads the RPC.
pub(super) fn parse(text: &str) -> Result<Parsed, Fault> {
    let document: Node = serde_json::from_str(text)
        .map_err(|e| Fault::Syntax { what: format!("broken JSON: {e}"), line: Some(e.line()).filter(|l| *l > 0) })?;
    let Node::Object(entries) = document else {
        return Err(Fault::Syntax { what: "found a JSON value, expected an object".to_owned(), line: None });
    };
    let nested = entries.iter().find_map(|(key, node)| match node {
        Node::Object(inner) if key == "rpc" => Some(inner),
        _ => None,
    });
    let entries = nested.unwrap_or(&entries);
    let has = |names: &Names| entries.iter().any(|(key, _)| names.field(key) != Field::Unknown);
    let names = if has(&RPCM) { &RPCM } else { &RPC00B };
    let mut draft = Draft::default();
    for (key, node) in entries {
        take(&mut draft, names, key, node)?;
    }
    Ok(Parsed::certain(draft.finish(names)?))
}

fn take(draft: &mut Draft, names: &Names, key: &str, node: &Node) -> Result<(), Fault> {
    let at = |text| Entry { key, text, line: None };
    let wrong = |node: &Node| Fault::NotANumber { key: key.to_owned(), line: None, text: node.kind().to_owned() };
    match (names.field(key), node) {
        (Field::Unknown, _) => Ok(()),
        (_, Node::Text(text)) => draft.take(names, at(text)).map(|_| ()),
        (Field::Scalar(s), Node::Number(value)) => draft.set(s, *value, at("")),
        (Field::Coefficient(p, i), Node::Number(value)) => draft.set_coefficient(p, i, *value, at("")),
        (Field::Beyond, _) => Err(Fault::Extra { key: key.to_owned(), line: None }),
        (Field::List(p), Node::Array(items)) => {
            let mut values = [0.0; 20];
            if items.len() != values.len() {
                return Err(Fault::Count { key: key.to_owned(), line: None, found: items.len(), expected: 20 });
            }
            for (value, item) in values.iter_mut().zip(items) {
                let Node::Number(number) = item else { return Err(wrong(item)) };
                *value = *number;
            }
            draft.set_list(p, values, at(""))
        }
        (_, other) => Err(wrong(other)),
    }
}

/// Items of a list that are kept: one more than a polynomial has, which is enough to see that a
/// list is too long.
const ITEMS_KEPT: usize = 21;

/// A JSON value that keeps repeated keys, which a map would lose.
enum Node {
    Object(Vec<(String, Node)>),
    Array(Vec<Node>),
    Number(f64),
    Text(String),
    Other,
}

impl Node {
    fn kind(&self) -> &'static str {
        match self {
            Self::Object(_) => "an object",
            Self::Array(_) => "a list",
            Self::Number(_) => "a number",
            Self::Text(_) => "a string",
            Self::Other => "null or a boolean",
        }
    }
}

impl<'de> Deserialize<'de> for Node {
    fn deserialize<D: Deserializer<'de>>(deserializer: D) -> Result<Self, D::Error> {
        deserializer.deserialize_any(NodeVisitor)
    }
}

struct NodeVisitor;

impl<'de> Visitor<'de> for NodeVisitor {
    type Value = Node;

    fn expecting(&self, f: &mut fmt::Formatter<'_>) -> fmt::Result {
        f.write_str("a JSON value")
    }

    fn visit_bool<E: Error>(self, _: bool) -> Result<Node, E> {
        Ok(Node::Other)
    }

    fn visit_unit<E: Error>(self) -> Result<Node, E> {
        Ok(Node::Other)
    }

    fn visit_f64<E: Error>(self, value: f64) -> Result<Node, E> {
        Ok(Node::Number(value))
    }

    fn visit_i64<E: Error>(self, value: i64) -> Result<Node, E> {
        Ok(Node::Number(value as f64))
    }

    fn visit_u64<E: Error>(self, value: u64) -> Result<Node, E> {
        Ok(Node::Number(value as f64))
    }

    fn visit_str<E: Error>(self, value: &str) -> Result<Node, E> {
        Ok(Node::Text(value.to_owned()))
    }

    fn visit_seq<A: SeqAccess<'de>>(self, mut items: A) -> Result<Node, A::Error> {
        let mut list = Vec::new();
        while let Some(item) = items.next_element()? {
            if list.len() < ITEMS_KEPT {
                list.push(item);
            }
        }
        Ok(Node::Array(list))
    }

    fn visit_map<A: MapAccess<'de>>(self, mut map: A) -> Result<Node, A::Error> {
        let mut entries = Vec::new();
        while let Some(entry) = map.next_entry()? {
            entries.push(entry);
        }
        Ok(Node::Object(entries))
    }
}
