//! Reading RPC text from disk: only regular files, only up to a limit, in UTF-8 or Latin-1.

use std::fs::File;
use std::io::Read;
use std::path::Path;

use super::RpcReadError;

/// The largest text that is read, bytes. The largest real one (a WorldView XML) has under 1 MB.
pub const TEXT_LIMIT: u64 = 64 * 1024 * 1024;

/// How much of a file decides whether it is text.
const HEAD: usize = 4096;
/// A NITF header is text for longer than that.
const NITF: [&[u8]; 2] = [b"NITF0", b"NSIF0"];

/// The content of a file as far as RPC readers care.
pub(super) enum Content {
    Text(String),
    /// Something with NUL bytes or the first letters of NITF: an image, or rubbish.
    Binary,
    /// More bytes than are read as text.
    TooLarge(u64),
}

/// Reads a text file, or finds that it is none.
pub(super) fn content(path: &Path) -> Result<Content, RpcReadError> {
    let io = |source| RpcReadError::Io { path: path.to_owned(), source };
    // A pipe would block on opening, so look before.
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

/// UTF-8 without its byte order mark, else Latin-1, in which every byte is a character.
fn decode(bytes: Vec<u8>) -> String {
    let text = String::from_utf8(bytes).unwrap_or_else(|e| e.as_bytes().iter().copied().map(char::from).collect());
    match text.strip_prefix('\u{feff}') {
        Some(rest) => rest.to_owned(),
        None => text,
    }
}
