//! `KEY: value unit` lines: `_RPC.TXT` and its many relatives.
//!
//! The keys are the names of RPC00B, and image coordinates are counted from 0. Known entries that
//! are not part of the projection are ignored: the ground-from-image coefficients of "extended
//! IKONOS" files, the satellite's name. Unknown entries are ignored with a warning.

use super::draft::{Draft, Entry};
use super::error::Fault;
use super::names::{Field, RPC00B};
use super::rpc_file::Parsed;

/// Prefixes of the keys of RPC files that are not part of the projection.
const IGNORED: [&str; 10] = [
    "LON_NUM_COEFF",
    "LON_DEN_COEFF",
    "LAT_NUM_COEFF",
    "LAT_DEN_COEFF",
    "MIN_LONG",
    "MAX_LONG",
    "MIN_LAT",
    "MAX_LAT",
    "SATID",
    "BANDID",
];

/// Whether some line of the text is an RPC00B entry.
pub(super) fn recognise(text: &str) -> bool {
    text.lines().filter_map(split).any(|(key, _)| RPC00B.field(key) != Field::Unknown)
}

/// Reads the RPC.
pub(super) fn parse(text: &str) -> Result<Parsed, Fault> {
    let mut draft = Draft::default();
    let mut warnings = Vec::new();
    for (i, content) in text.lines().enumerate() {
        if content.trim().is_empty() || content.trim_start().starts_with('#') {
            continue;
        }
        let line = Some(i + 1);
        let Some((key, value)) = split(content) else {
            let what = format!("found {:?}, expected KEY: value", content.chars().take(40).collect::<String>());
            return Err(Fault::Syntax { what, line });
        };
        let known = draft.take(&RPC00B, Entry { key, text: value, line })?;
        if !known && !is_ignored(key) {
            warnings.push(format!("{key} (line {}) is not an entry of an RPC and was ignored", i + 1));
        }
    }
    Ok(Parsed { rpc: draft.finish(&RPC00B)?, warnings })
}

/// Whether a known key is not part of the projection.
fn is_ignored(key: &str) -> bool {
    IGNORED.iter().any(|p| key.get(..p.len()).is_some_and(|head| head.eq_ignore_ascii_case(p)))
}

/// Splits a line into key and value at a colon or an equals sign.
fn split(line: &str) -> Option<(&str, &str)> {
    let (key, value) = line.split_once([':', '='])?;
    let key = key.trim();
    (!key.is_empty() && !key.contains(char::is_whitespace)).then(|| (key, value.trim()))
}
