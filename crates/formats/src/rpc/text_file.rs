//! Reading the RPC of one text file, in any of the text formats.

use std::path::Path;

use super::detect::{self, Found};
use super::error::{Attempt, RpcReadError};
use super::file::{self, Content, TEXT_LIMIT};
use super::rpc_file::RpcFile;

/// Reads a text file and does not look at any other file.
///
/// # Errors
/// Every variant of [`RpcReadError`]; [`RpcReadError::NotRpc`] also for a binary file.
pub(super) fn read(path: &Path) -> Result<RpcFile, RpcReadError> {
    match file::content(path)? {
        Content::Text(text) => match detect::detect(&text) {
            Ok(found) => finish(path, found),
            Err(tried) => Err(not_rpc(path, tried)),
        },
        Content::Binary => Err(not_rpc(path, vec![Attempt::new("text", "the file is binary")])),
        Content::TooLarge(bytes) => Err(too_large(path, bytes)),
    }
}

/// Turns the reader's result into that of the file.
pub(super) fn finish(path: &Path, found: Found) -> Result<RpcFile, RpcReadError> {
    let Found { format, result, tried } = found;
    result
        .map(|parsed| RpcFile::new(path, format, parsed))
        .map_err(|fault| RpcReadError::invalid(path, format, fault, tried))
}

pub(super) fn not_rpc(path: &Path, tried: Vec<Attempt>) -> RpcReadError {
    RpcReadError::NotRpc { path: path.to_owned(), tried }
}

pub(super) fn too_large(path: &Path, bytes: u64) -> RpcReadError {
    RpcReadError::TooLarge { path: path.to_owned(), bytes, limit: TEXT_LIMIT }
}
