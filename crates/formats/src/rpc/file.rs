//! Reading RPC text from disk: regular files up to a limit, in UTF-8 or Latin-1.

use std::fs::File;
use std::io::Read;
use std::path::Path;

use super::error::RpcReadError;

/// The largest text that is read, bytes. The largest known one (a WorldView XML) has less than 1
/// MB.
pub const TEXT_LIMIT: u64 = 64 * 1024 * 1024;

/// Bytes at the start of a file that decide whether it is text.
const HEAD: usize = 4096;
/// First bytes of NITF files, whose header is text and longer than [`HEAD`].
const NITF: [&[u8]; 2] = [b"NITF0", b"NSIF0"];

/// The content of a file.
pub(super) enum Content {
    Text(String),
    /// A file with NUL bytes or the first bytes of NITF, such as an image.
    Binary,
    /// A text of this size, bytes, which is above the limit.
    TooLarge(u64),
}

/// Reads a file if it is text.
pub(super) fn content(path: &Path) -> Result<Content, RpcReadError> {
    let io = |source| RpcReadError::Io { path: path.to_owned(), source };
    // The type is checked first because opening a pipe would block.
    let metadata = std::fs::metadata(path).map_err(io)?;
    if !metadata.is_file() {
        return Err(RpcReadError::NotAFile { path: path.to_owned() });
    }
    let mut file = File::open(path).map_err(io)?;
    let mut bytes = Vec::new();
    file.by_ref().take(HEAD as u64).read_to_end(&mut bytes).map_err(io)?;
    if bytes.contains(&0) || NITF.iter().any(|magic| bytes.starts_with(magic)) {
        return Ok(Content::Binary);
    }
    if metadata.len() > TEXT_LIMIT {
        return Ok(Content::TooLarge(metadata.len()));
    }
    file.take(TEXT_LIMIT + 1 - bytes.len() as u64).read_to_end(&mut bytes).map_err(io)?;
    if bytes.len() as u64 > TEXT_LIMIT {
        return Ok(Content::TooLarge(bytes.len() as u64));
    }
    Ok(Content::Text(decode(bytes)))
}

/// Decodes UTF-8 without its byte order mark, else Latin-1, in which every byte is a character.
fn decode(bytes: Vec<u8>) -> String {
    let text = String::from_utf8(bytes).unwrap_or_else(|e| e.as_bytes().iter().copied().map(char::from).collect());
    match text.strip_prefix('\u{feff}') {
        Some(rest) => rest.to_owned(),
        None => text,
    }
}
