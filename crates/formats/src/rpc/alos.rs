//! RPC of ALOS PRISM and AVNIR-2: one line of 1026 characters in columns of fixed width, without
//! separators.
//!
//! The line has offsets and scales in the order of RPC00B, then 4 × 20 coefficients of 12
//! characters. Image coordinates are used as they are, as GDAL does.

use super::draft::{Draft, Entry};
use super::error::Fault;
use super::names::{POLYS, REQUIRED, RPC00B};
use super::rpc_file::Parsed;

/// Widths of the columns of the ten scalars, characters.
const WIDTHS: [usize; 10] = [6, 5, 8, 9, 5, 6, 5, 8, 9, 5];
const COEFFICIENT_WIDTH: usize = 12;
const LENGTH: usize = 66 + 80 * COEFFICIENT_WIDTH;

/// Whether the text is one long run of digits, signs, points and exponents, starting with the
/// scalars.
pub(super) fn recognise(text: &str) -> bool {
    let text = text.trim_end();
    text.len() > 66
        && text.bytes().all(|b| b.is_ascii_digit() || b"+-.eE ".contains(&b))
        && !text.get(..66).unwrap_or_default().contains(' ')
}

/// Reads the RPC.
pub(super) fn parse(text: &str) -> Result<Parsed, Fault> {
    let text = text.trim_end();
    if text.len() != LENGTH {
        let what = format!("the line has {} characters, expected {LENGTH}", text.len());
        return Err(Fault::Syntax { what, line: Some(1) });
    }
    let mut draft = Draft::default();
    let mut start = 0;
    let mut column = |width: usize| {
        let field = text.get(start..start + width).unwrap_or_default().trim();
        start += width;
        field
    };
    for (scalar, width) in REQUIRED.iter().copied().zip(WIDTHS) {
        let entry = Entry { key: RPC00B.scalar(scalar), text: column(width), line: Some(1) };
        draft.set(scalar, entry.number()?, entry)?;
    }
    for poly in POLYS {
        for i in 0..20 {
            let key = RPC00B.coefficient(poly, i);
            let entry = Entry { key: &key, text: column(COEFFICIENT_WIDTH), line: Some(1) };
            draft.set_coefficient(poly, i, entry.number()?, entry)?;
        }
    }
    Ok(Parsed::certain(draft.finish(&RPC00B)?))
}
