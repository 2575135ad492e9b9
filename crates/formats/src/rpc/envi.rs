//! `rpc info = { … }` of an ENVI header.
//!
//! The block has 90 numbers in the order of RPC00B, then the tile's row and column offset and a
//! flag. Image coordinates are used as they are, as GDAL does. A tile offset other than 0 is
//! refused.

use super::draft::{Draft, Entry};
use super::error::Fault;
use super::names::RPC00B;
use super::rpc_file::Parsed;

const KEY: &str = "rpc info";

/// Whether an ENVI header has an RPC.
pub(super) fn recognise(text: &str) -> bool {
    text.trim_start().starts_with("ENVI") && position(text).is_some()
}

/// Reads the RPC.
pub(super) fn parse(text: &str) -> Result<Parsed, Fault> {
    let start = position(text).ok_or_else(|| Fault::Missing { key: KEY.to_owned() })?;
    let line = Some(1 + text.get(..start).unwrap_or_default().matches('\n').count());
    let block = text.get(start..).and_then(|t| t.split_once('{')).and_then(|(_, t)| t.split_once('}'));
    let Some((block, _)) = block else {
        return Err(Fault::Syntax {
            what: format!("{KEY} is not followed by a list in braces, expected {KEY} = {{ … }}"),
            line,
        });
    };
    let entry = Entry { key: KEY, text: block, line };
    let values: [f64; 93] = entry.numbers(true)?;
    let (model, tile) = values.split_at(90);
    if tile.iter().take(2).any(|offset| *offset != 0.0) {
        let what = format!("the tile offset of {KEY} is not zero: export the RPC of the whole image");
        return Err(Fault::Unsupported { what });
    }
    Ok(Parsed::certain(Draft::from_values(model, entry)?.finish(&RPC00B)?))
}

/// Returns the byte at which the first line with the key begins.
fn position(text: &str) -> Option<usize> {
    let mut start = 0;
    for line in text.split_inclusive('\n') {
        if line.trim_start().get(..KEY.len()).is_some_and(|k| k.eq_ignore_ascii_case(KEY)) {
            return Some(start);
        }
        start += line.len();
    }
    None
}
