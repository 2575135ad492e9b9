//! RPC files: every container in which providers and tools keep the RPC of an image.
//!
//! [`read`] takes any file and finds its format by the content; [`read_for_image`] also looks at the files beside an
//! image. Whatever a format's convention, the [`Rpc`] that comes out has the centre of the upper-left pixel at (0, 0),
//! degrees, and metres above the ellipsoid.
//!
//! A file without an RPC is an error that lists the formats tried; a file whose format is recognised and whose content is
//! missing, repeated, not finite or of the wrong length is an error that names the key, and the line in text formats.
//! Text is read up to [`TEXT_LIMIT`], XML with a DTD is refused, and no file named inside another is opened.

mod alos;
mod detect;
mod digital_globe;
mod dimap;
mod draft;
mod envi;
mod error;
mod file;
mod format;
mod gdal_xml;
mod geom;
mod image;
mod json;
mod key_value;
mod rpb;
mod sidecar;
mod tiff_tag;
mod write;
mod xml;

use std::path::{Path, PathBuf};

use camera::Rpc;

pub use error::{Attempt, Fault, RpcReadError, RpcWriteError};
pub use file::TEXT_LIMIT;
pub use format::RpcFormat;
pub use write::{to_text, write};

use detect::Found;
use file::Content;

/// An RPC and where it came from.
#[derive(Debug, Clone, PartialEq)]
pub struct RpcFile {
    /// The model; the centre of the upper-left pixel is (0, 0).
    pub rpc: Rpc,
    /// The container.
    pub format: RpcFormat,
    /// The file that holds it: the one asked for, or one beside it. GDAL does not say which file its metadata is from; then it
    /// is the image.
    pub source: PathBuf,
    /// What the user should know: conventions that had to be guessed, entries passed over, sources that disagree.
    pub warnings: Vec<String>,
}

/// What a format's reader makes of a text.
#[derive(Debug)]
struct Parsed {
    rpc: Rpc,
    warnings: Vec<String>,
}

impl RpcFile {
    fn new(path: &Path, format: RpcFormat, parsed: Parsed) -> Self {
        Self { rpc: parsed.rpc, format, source: path.to_owned(), warnings: parsed.warnings }
    }
}

/// Reads the RPC of a file: an RPC file, metadata that contains one, or an image (as [`read_for_image`]).
///
/// # Errors
/// A file that cannot be read, is too large for text, has no RPC, or has a broken one.
pub fn read(path: &Path) -> Result<RpcFile, RpcReadError> {
    if is_gdal_virtual(path) {
        return read_for_image(path);
    }
    match file::content(path)? {
        Content::Binary => read_for_image(path),
        Content::TooLarge(bytes) => Err(RpcReadError::TooLarge { path: path.to_owned(), bytes, limit: TEXT_LIMIT }),
        Content::Text(text) => match detect::detect(&text) {
            Ok(found) => finish(path, found),
            Err(tried) if detect::is_markup(&text) => Err(not_rpc(path, tried)),
            Err(tried) => read_raw_image(path, tried),
        },
    }
}

/// Finds the RPC of an image: GDAL's `RPC` metadata, TIFF tag 50844, the text of a virtual raster, then files beside it.
///
/// # Errors
/// As [`read`]. A broken RPC in one place is an error, even where another place has a sound one.
pub fn read_for_image(path: &Path) -> Result<RpcFile, RpcReadError> {
    let mut tried = Vec::new();
    let mut dataset = None;
    let mut markup = false;
    if !is_gdal_virtual(path)
        && let Content::Text(text) = file::content(path)?
    {
        markup = detect::is_markup(&text);
        match detect::detect(&text) {
            Ok(found) => return finish(path, found),
            Err(formats) => tried = formats,
        }
    }
    if !markup {
        match image::open(path) {
            Ok(opened) => {
                if let Some(file) = image::read(path, &opened)? {
                    return Ok(file);
                }
                tried.push(Attempt::new(RpcFormat::GdalMetadata, "the image has none"));
                dataset = Some(opened);
            }
            Err(attempt) => {
                tried.push(attempt);
                if let Some(result) = tag_alone(path)? {
                    return finish(path, Found { format: RpcFormat::TiffTag, result, tried });
                }
            }
        }
    }
    if !is_gdal_virtual(path)
        && let Some(file) = sidecar::read(path, dataset.as_ref(), &mut tried)?
    {
        return Ok(file);
    }
    Err(not_rpc(path, tried))
}

/// Tag 50844 of a TIFF that GDAL does not open.
fn tag_alone(path: &Path) -> Result<Option<Result<Parsed, Fault>>, RpcReadError> {
    if is_gdal_virtual(path) { Ok(None) } else { tiff_tag::read(path) }
}

/// Reads a text file in any of the formats, and nothing else.
fn read_text_file(path: &Path) -> Result<RpcFile, RpcReadError> {
    match file::content(path)? {
        Content::Text(text) => match detect::detect(&text) {
            Ok(found) => finish(path, found),
            Err(tried) => Err(not_rpc(path, tried)),
        },
        Content::Binary => Err(not_rpc(path, vec![Attempt::new("text", "the file is binary")])),
        Content::TooLarge(bytes) => Err(RpcReadError::TooLarge { path: path.to_owned(), bytes, limit: TEXT_LIMIT }),
    }
}

/// A raw image without any NUL in its first bytes looks like text; its header tells GDAL what it is.
fn read_raw_image(path: &Path, mut tried: Vec<Attempt>) -> Result<RpcFile, RpcReadError> {
    match image::open(path) {
        Ok(dataset) => match image::read(path, &dataset)? {
            Some(file) => return Ok(file),
            None => tried.push(Attempt::new(RpcFormat::GdalMetadata, "the image has none")),
        },
        Err(attempt) => tried.push(attempt),
    }
    Err(not_rpc(path, tried))
}

fn finish(path: &Path, found: Found) -> Result<RpcFile, RpcReadError> {
    let Found { format, result, tried } = found;
    result
        .map(|parsed| RpcFile::new(path, format, parsed))
        .map_err(|fault| RpcReadError::invalid(path, format, fault, tried))
}

fn not_rpc(path: &Path, tried: Vec<Attempt>) -> RpcReadError {
    RpcReadError::NotRpc { path: path.to_owned(), tried }
}

/// Whether the path is one of GDAL's virtual file systems, which the caller asked for by name.
fn is_gdal_virtual(path: &Path) -> bool {
    path.to_str().is_some_and(|p| p.starts_with("/vsi"))
}

/// All numbers of the projection, in the order of RPC00B.
fn numbers(rpc: &Rpc) -> impl Iterator<Item = f64> + '_ {
    let scalars = [
        rpc.line_off,
        rpc.samp_off,
        rpc.lat_off,
        rpc.long_off,
        rpc.height_off,
        rpc.line_scale,
        rpc.samp_scale,
        rpc.lat_scale,
        rpc.long_scale,
        rpc.height_scale,
    ];
    scalars
        .into_iter()
        .chain([&rpc.line_num, &rpc.line_den, &rpc.samp_num, &rpc.samp_den].into_iter().flatten().copied())
}
