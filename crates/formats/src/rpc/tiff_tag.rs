//! TIFF tag 50844 (RPCCoefficientTag): 92 doubles, read without GDAL.
//!
//! The tag has ERR_BIAS and ERR_RAND, then offsets, scales and coefficients in the order of RPC00B.
//! Read here, the doubles keep all their bits; GDAL reports them as text with 15 digits.

use std::io::BufReader;
use std::path::Path;

use tiff::decoder::Decoder;
use tiff::tags::Tag;

use super::draft::{Draft, Entry};
use super::error::{Fault, RpcReadError};
use super::names::{RPC00B, Scalar};
use super::rpc_file::Parsed;
use crate::regular;

const RPC_COEFFICIENT_TAG: u16 = 50844;
/// Numbers in the tag.
const COUNT: usize = 92;

/// Reads the RPC of the tag; `None` when the file is not a TIFF that can be read or does not have
/// the tag.
pub(super) fn read(path: &Path) -> Result<Option<Result<Parsed, Fault>>, RpcReadError> {
    let file = regular::open(path).map_err(|source| RpcReadError::Io { path: path.to_owned(), source })?;
    let Ok(mut decoder) = Decoder::new(BufReader::new(file)) else { return Ok(None) };
    let Ok(Some(value)) = decoder.find_tag(Tag::Unknown(RPC_COEFFICIENT_TAG)) else { return Ok(None) };
    let wrong_type =
        Fault::Unsupported { what: "TIFF tag 50844 does not hold doubles, expected 92 doubles".to_owned() };
    Ok(Some(value.into_f64_vec().map_err(|_| wrong_type).and_then(|values| parse(&values))))
}

fn parse(values: &[f64]) -> Result<Parsed, Fault> {
    let entry = Entry { key: "TIFF tag 50844", text: "", line: None };
    let [bias, rand, model @ ..] = values else { return Err(count(entry, values.len())) };
    if values.len() != COUNT {
        return Err(count(entry, values.len()));
    }
    let mut draft = Draft::from_values(model, entry)?;
    for (scalar, value) in [(Scalar::ErrBias, *bias), (Scalar::ErrRand, *rand)] {
        draft.set(scalar, value, Entry { key: RPC00B.scalar(scalar), ..entry })?;
    }
    Ok(Parsed::certain(draft.finish(&RPC00B)?))
}

fn count(entry: Entry<'_>, found: usize) -> Fault {
    Fault::Count { key: entry.key.to_owned(), line: None, found, expected: COUNT }
}
