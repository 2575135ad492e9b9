//! `KEY: value unit` lines: `_RPC.TXT` and its many relatives.
//!
//! The names are those of RPC00B, image coordinates count from 0. Entries that are no part of the model (the ground
//! from image coefficients of "extended IKONOS" files, a satellite's name) are passed over; unknown ones with a warning.

use super::Parsed;
use super::draft::{Draft, Entry, Field, RPC00B};
use super::error::Fault;

/// Starts of names that belong to RPC files without being part of the projection.
const PASSED_OVER: [&str; 10] = [
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
        if !known && !is_passed_over(key) {
            warnings.push(format!("{key} (line {}) is not known and was passed over", i + 1));
        }
    }
    Ok(Parsed { rpc: draft.finish(&RPC00B)?, warnings })
}

/// Whether a name of RPC metadata says nothing about the projection.
pub(super) fn is_passed_over(key: &str) -> bool {
    PASSED_OVER.iter().any(|p| key.get(..p.len()).is_some_and(|head| head.eq_ignore_ascii_case(p)))
}

/// Key and value of a line; the separator is a colon or an equals sign.
fn split(line: &str) -> Option<(&str, &str)> {
    let (key, value) = line.split_once([':', '='])?;
    let key = key.trim();
    (!key.is_empty() && !key.contains(char::is_whitespace)).then(|| (key, value.trim()))
}
