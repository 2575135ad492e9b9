//! The files that a virtual raster names, which must be files: a pipe would wait for ever, and a
//! device never ends.
//!
//! GDAL opens the sources of a VRT at the first read, by their names, at any depth. So the text of
//! a VRT is searched before it is opened: every piece that could be the name of a pipe or of a
//! device is refused, also inside escaped XML (a VRT as the name of a source) and behind a prefix
//! such as `vrt://`. The text is not parsed as XML, because GDAL's parser takes more than others.

use std::collections::HashSet;
use std::io::Read;
use std::path::{Path, PathBuf};

use crate::raster::error::RasterError;

/// Bytes at the beginning of a file in which GDAL looks for the root of a VRT.
const HEAD: u64 = 1024;
/// Largest VRT that is searched, bytes; one of 100,000 tiles has about 50 MB.
const TEXT_LIMIT: u64 = 256 << 20;
/// Deepest escaping that is undone.
const ESCAPES_MAX: usize = 16;
/// Longest name of a file, bytes (`PATH_MAX`).
const NAME_MAX: usize = 4096;

/// Refuses a virtual raster that names a pipe or a device, itself or through other virtual rasters.
/// Other files pass.
///
/// # Errors
/// [`RasterError::NotAFile`] with the name, [`RasterError::Unreadable`].
pub(in crate::raster) fn refuse_named_devices(path: &Path) -> Result<(), RasterError> {
    let mut waiting = vec![path.to_owned()];
    let mut known = HashSet::new();
    while let Some(path) = waiting.pop() {
        let Some(mut text) = text_of_virtual(&path)? else { continue };
        let folder = path.parent().unwrap_or(Path::new(""));
        for _ in 0..ESCAPES_MAX {
            for name in names(&text) {
                for candidate in [folder.join(name), PathBuf::from(name)] {
                    if known.insert(candidate.clone()) && is_regular(&candidate)? {
                        waiting.push(candidate);
                    }
                }
            }
            match unescaped(&text) {
                Some(inner) => text = inner,
                None => break,
            }
        }
    }
    Ok(())
}

/// Whether a name is that of a file. A folder and a name of nothing are none.
fn is_regular(path: &Path) -> Result<bool, RasterError> {
    match std::fs::metadata(path) {
        Ok(found) if found.is_file() => Ok(true),
        Ok(found) if !found.is_dir() => Err(RasterError::NotAFile { path: path.to_owned() }),
        _ => Ok(false),
    }
}

/// Returns the text of a file if GDAL would read it as a VRT.
fn text_of_virtual(path: &Path) -> Result<Option<String>, RasterError> {
    let unreadable = |source| RasterError::Unreadable { path: path.to_owned(), source };
    let mut head = Vec::new();
    let file = std::fs::File::open(path).map_err(unreadable)?;
    file.take(HEAD).read_to_end(&mut head).map_err(unreadable)?;
    if !String::from_utf8_lossy(&head).contains("<VRT") {
        return Ok(None);
    }
    let bytes = crate::read_regular(path, TEXT_LIMIT).map_err(unreadable)?;
    Ok(Some(String::from_utf8_lossy(&bytes).into_owned()))
}

/// Returns every piece of a text that could be the name of a file.
fn names(text: &str) -> impl Iterator<Item = &str> {
    let pieces = text.split(['<', '>', '"', '\'']).map(str::trim);
    let pieces = pieces.filter(|piece| !piece.is_empty() && piece.len() <= NAME_MAX);
    pieces.flat_map(|piece| {
        let parts = piece.split([':', '?', ',', '=', '{', '}']);
        let inner =
            parts.map(|part| part.strip_prefix("//").unwrap_or(part)).flat_map(|part| [part, behind_prefix(part)]);
        std::iter::once(piece).chain(inner.filter(move |part| *part != piece && !part.is_empty()))
    })
}

/// Returns what a file system of GDAL's is given: the rest behind the last `/vsi…/`.
fn behind_prefix(name: &str) -> &str {
    let Some(at) = name.rfind("/vsi") else { return name };
    name[at + 1..].split_once('/').map_or("", |(_, rest)| rest)
}

/// Undoes one level of XML's escaping; `None` if there is none.
fn unescaped(text: &str) -> Option<String> {
    let mut out = String::with_capacity(text.len());
    let mut rest = text;
    let mut found = false;
    while let Some((before, behind)) = rest.split_once('&') {
        out.push_str(before);
        match behind.split_once(';').and_then(|(entity, after)| Some((character(entity)?, after))) {
            Some((character, after)) => {
                out.push(character);
                rest = after;
                found = true;
            }
            None => {
                out.push('&');
                rest = behind;
            }
        }
    }
    out.push_str(rest);
    found.then_some(out)
}

/// Returns the character that an entity of XML stands for.
fn character(entity: &str) -> Option<char> {
    match entity {
        "lt" => Some('<'),
        "gt" => Some('>'),
        "amp" => Some('&'),
        "quot" => Some('"'),
        "apos" => Some('\''),
        _ => {
            let number = entity.strip_prefix('#')?;
            let code = match number.strip_prefix(['x', 'X']) {
                Some(hexadecimal) => u32::from_str_radix(hexadecimal, 16),
                None => number.parse(),
            };
            char::from_u32(code.ok()?)
        }
    }
}
