//! Finding the RPC of a file or of an image.

use std::path::Path;

use gdal::Dataset;

use super::detect::{self, Found};
use super::error::{Attempt, Fault, RpcReadError};
use super::file::{self, Content};
use super::format::RpcFormat;
use super::rpc_file::{Parsed, RpcFile};
use super::text_file::{self, finish, not_rpc, too_large};
use super::{image, sidecar, tiff_tag};
use crate::raster::{RasterError, open_address};
use crate::stac::{StacError, is_item_name, read_item};

/// Reads the RPC of a file: an RPC file, metadata that contains one, or an image (as
/// [`read_for_image`]).
///
/// ```
/// # let folder = tempfile::tempdir()?;
/// let path = folder.path().join("scene_RPC.TXT");
/// let scalars = "LINE_OFF: 100\nSAMP_OFF: 200\nLAT_OFF: 45\nLONG_OFF: 7\nHEIGHT_OFF: 300\n\
///                LINE_SCALE: 100\nSAMP_SCALE: 200\nLAT_SCALE: 0.01\nLONG_SCALE: 0.02\n\
///                HEIGHT_SCALE: 500\n";
/// // Lines fall with the latitude (term 3 of RPC00B), samples grow with the longitude (term 2).
/// let ones = [("LINE_NUM", 3, -1), ("LINE_DEN", 1, 1), ("SAMP_NUM", 2, 1), ("SAMP_DEN", 1, 1)];
/// let mut text = scalars.to_owned();
/// for (name, term, value) in ones {
///     for i in 1..=20 {
///         text += &format!("{name}_COEFF_{i}: {}\n", if i == term { value } else { 0 });
///     }
/// }
/// std::fs::write(&path, text)?;
///
/// let file = formats::rpc::read(&path)?;
/// assert_eq!((file.format, file.rpc.line_off), (formats::rpc::RpcFormat::Text, 100.0));
/// # Ok::<(), Box<dyn std::error::Error>>(())
/// ```
///
/// # Errors
/// Every variant of [`RpcReadError`].
pub fn read(path: &Path) -> Result<RpcFile, RpcReadError> {
    if is_gdal_virtual(path) {
        return read_for_image(path);
    }
    if is_item_name(path)
        && let Some(file) = read_for_item(path)?
    {
        return Ok(file);
    }
    match file::content(path)? {
        Content::Binary => read_for_image(path),
        Content::TooLarge(bytes) => Err(too_large(path, bytes)),
        Content::Text(text) => match detect::detect(&text) {
            Ok(found) => finish(path, found),
            Err(tried) if detect::is_markup(&text) => Err(not_rpc(path, tried)),
            Err(tried) => read_raw_image(path, tried),
        },
    }
}

/// Finds the RPC of an image: GDAL's `RPC` metadata, TIFF tag 50844, the text of a virtual raster,
/// then files beside it. Of an image that a STAC item names the item's own RPC file comes last. Of
/// an image at an address only what is inside it is read.
///
/// # Errors
/// Every variant of [`RpcReadError`] but [`RpcReadError::TooLarge`] for the image itself. A broken
/// RPC in one place is an error, even where another place has a sound one.
pub fn read_for_image(path: &Path) -> Result<RpcFile, RpcReadError> {
    if is_item_name(path)
        && let Some(file) = read_for_item(path)?
    {
        return Ok(file);
    }
    if let Some(opened) = open_address(path) {
        return read_address(path, opened);
    }
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
                    // GDAL 3.6 counts the pixels of Pléiades Neo from the first of the RPC's
                    // domain, which may lie outside of the image, and from 1 without a domain.
                    let beside = match sidecar::is_first_tile(path) {
                        true => sidecar::read(path, Some(&opened), &mut tried)?,
                        false => None,
                    };
                    return Ok(beside.unwrap_or(file));
                }
                tried.push(no_metadata());
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

/// Returns every RPC of an image that can be read: TIFF tag 50844, and those of the files beside
/// it. [`read_for_image`] takes one of them; where they differ, the image may have the wrong one.
/// An image at an address, or in one of GDAL's virtual file systems, has none here.
pub fn all_of_image(path: &Path) -> Vec<RpcFile> {
    if is_gdal_virtual(path) || !path.is_file() {
        return Vec::new();
    }
    let item = is_item_name(path).then(|| read_item(path).ok()).flatten();
    let path = item.as_ref().map_or(path, |item| item.image.as_path());
    let inside = tag_alone(path).ok().flatten().and_then(|found| found.ok());
    let inside = inside.map(|parsed| RpcFile::new(path, RpcFormat::TiffTag, parsed));
    inside.into_iter().chain(sidecar::all(path)).collect()
}

/// Reads the RPC of the image that a STAC item names, or the item's RPC file where the image has
/// none; `None` for JSON that is no item, which may be an RPC itself.
fn read_for_item(path: &Path) -> Result<Option<RpcFile>, RpcReadError> {
    let item = match read_item(path) {
        Ok(item) => item,
        Err(StacError::NotAnItem { .. } | StacError::Unreadable(_)) => return Ok(None),
        Err(error) => return Err(not_rpc(path, vec![Attempt::new("the STAC item", error.to_string())])),
    };
    match (read_for_image(&item.image), item.rpc) {
        (Err(RpcReadError::NotRpc { .. }), Some(rpc)) => text_file::read(&rpc).map(Some),
        (found, _) => found.map(Some),
    }
}

/// Reads the RPC inside an image at an address that the user named. Nothing beside it is fetched.
fn read_address(path: &Path, opened: Result<Dataset, RasterError>) -> Result<RpcFile, RpcReadError> {
    let not_read = |why: String| not_rpc(path, vec![Attempt::new(RpcFormat::GdalMetadata, why)]);
    let dataset = opened.map_err(|error| not_read(error.to_string()))?;
    image::read(path, &dataset)?.ok_or_else(|| {
        not_read("the image has no RPC inside, and files beside an address are not fetched: copy both here".to_owned())
    })
}

/// Reads tag 50844 of a TIFF that GDAL does not open.
fn tag_alone(path: &Path) -> Result<Option<Result<Parsed, Fault>>, RpcReadError> {
    if is_gdal_virtual(path) { Ok(None) } else { tiff_tag::read(path) }
}

/// Reads an image that looks like text because its first bytes have no NUL; its header tells GDAL
/// that it is raw.
fn read_raw_image(path: &Path, mut tried: Vec<Attempt>) -> Result<RpcFile, RpcReadError> {
    match image::open(path) {
        Ok(dataset) => match image::read(path, &dataset)? {
            Some(file) => return Ok(file),
            None => tried.push(no_metadata()),
        },
        Err(attempt) => tried.push(attempt),
    }
    Err(not_rpc(path, tried))
}

fn no_metadata() -> Attempt {
    Attempt::new(RpcFormat::GdalMetadata, "the image has no RPC metadata")
}

/// Whether the path is in one of GDAL's virtual file systems, which the caller asked for by name.
fn is_gdal_virtual(path: &Path) -> bool {
    path.to_str().is_some_and(|p| p.starts_with("/vsi"))
}
