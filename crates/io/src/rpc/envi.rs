//! `rpc info = { … }` of an ENVI header: 90 numbers in the order of RPC00B, then the tile's row and column offset
//! and a flag. Image coordinates are taken as they stand, as GDAL does; a tile offset other than 0 is refused.

use super::Parsed;
use super::draft::{Draft, Entry, POLYS, REQUIRED, RPC00B};
use super::error::Fault;

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
        return Err(Fault::Syntax { what: format!("{KEY} is not enclosed in braces"), line });
    };
    let entry = Entry { key: KEY, text: block, line };
    let values: [f64; 93] = entry.numbers(true)?;
    let (model, tile) = values.split_at(90);
    if tile.iter().take(2).any(|offset| *offset != 0.0) {
        let what = format!("the tile offset of {KEY} is not zero: export the RPC of the whole image");
        return Err(Fault::Unsupported { what });
    }
    Ok(Parsed { rpc: from_slice(model, entry)?.finish(&RPC00B)?, warnings: Vec::new() })
}

/// The ten scalars and eighty coefficients of RPC00B, in its order.
pub(super) fn from_slice(values: &[f64], entry: Entry<'_>) -> Result<Draft, Fault> {
    let mut draft = Draft::default();
    let mut values = values.iter();
    let mut next = || values.next().copied().ok_or_else(|| Fault::Missing { key: entry.key.to_owned() });
    for &scalar in REQUIRED {
        draft.set(scalar, next()?, Entry { key: RPC00B.scalar(scalar), ..entry })?;
    }
    for poly in POLYS {
        for i in 0..20 {
            let key = RPC00B.coefficient(poly, i);
            draft.set_coefficient(poly, i, next()?, Entry { key: &key, ..entry })?;
        }
    }
    Ok(draft)
}

/// Where a line begins with the key.
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
