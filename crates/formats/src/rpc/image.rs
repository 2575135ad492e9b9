//! The RPC that GDAL reports for an image.
//!
//! GDAL gives RPC metadata in the convention of RPC00B, whatever the driver: the centre of the
//! upper-left pixel is (0, 0). Drivers that follow references inside a file or use a network are
//! disabled, so an input file cannot make this reader fetch anything. Where TIFF tag 50844 and
//! GDAL's metadata agree, the tag's doubles are used, because GDAL prints them with 15 digits.
//! Where they differ (GDAL prefers files beside the image), GDAL's numbers are used, with a
//! warning.

use std::path::Path;

use camera::Rpc;
use gdal::{Dataset, DatasetOptions, DriverManager, GdalOpenFlags, Metadata};

use super::draft::{Draft, Entry};
use super::error::{Attempt, Fault, RpcReadError};
use super::format::RpcFormat;
use super::names::RPC00B;
use super::rpc_file::{Parsed, RpcFile};
use super::tiff_tag;
use crate::raster::{prepare_gdal, with_gdal};

/// Drivers that open other files named in a file. [`with_gdal`] removes the drivers that use a
/// network.
const FOLLOWS_REFERENCES: [&str; 10] =
    ["VRT", "DERIVED", "GTI", "RasterLite", "SQLite", "GPKG", "TileDB", "PDF", "KMLSUPEROVERLAY", "RPFTOC"];

/// Largest relative difference between a number and GDAL's print of it with 15 digits.
const PRINTED_TOLERANCE: f64 = 1e-13;

/// Opens an image for reading. The error has GDAL's reason.
pub(super) fn open(path: &Path) -> Result<Dataset, Attempt> {
    prepare_gdal();
    let names: Vec<String> = DriverManager::all().map(|d| d.short_name()).collect();
    let is_allowed = |n: &&str| !FOLLOWS_REFERENCES.iter().any(|f| f.eq_ignore_ascii_case(n));
    let allowed: Vec<&str> = names.iter().map(String::as_str).filter(is_allowed).collect();
    let options = DatasetOptions {
        open_flags: GdalOpenFlags::GDAL_OF_READONLY | GdalOpenFlags::GDAL_OF_RASTER,
        allowed_drivers: Some(&allowed),
        ..DatasetOptions::default()
    };
    with_gdal(|| Dataset::open_ex(path, options)).map_err(|reason| Attempt::new(RpcFormat::GdalMetadata, reason))
}

/// Reads the RPC of an opened image; `None` when it has none.
pub(super) fn read(path: &Path, dataset: &Dataset) -> Result<Option<RpcFile>, RpcReadError> {
    let tag = if path.is_file() { tiff_tag::read(path)? } else { None };
    let invalid = |format, fault| RpcReadError::invalid(path, format, fault, Vec::new());
    let file = |format, parsed: Parsed| RpcFile::new(path, format, parsed);
    let metadata = dataset.metadata_domain("RPC").filter(|items| !items.is_empty());
    let Some(items) = metadata else {
        return match tag {
            Some(Ok(parsed)) => Ok(Some(file(RpcFormat::TiffTag, parsed))),
            Some(Err(fault)) => Err(invalid(RpcFormat::TiffTag, fault)),
            None => Ok(None),
        };
    };
    let mut reported = parse(&items).map_err(|fault| invalid(RpcFormat::GdalMetadata, fault))?;
    match tag {
        Some(Ok(tag)) if agree(&tag.rpc, &reported.rpc) => Ok(Some(file(RpcFormat::TiffTag, tag))),
        Some(_) => {
            let what = "TIFF tag 50844 differs from the RPC beside the image: the latter is used, as GDAL does";
            reported.warnings.push(what.to_owned());
            Ok(Some(file(RpcFormat::GdalMetadata, reported)))
        }
        None => Ok(Some(file(RpcFormat::GdalMetadata, reported))),
    }
}

fn parse(items: &[String]) -> Result<Parsed, Fault> {
    let mut draft = Draft::default();
    for (key, text) in items.iter().filter_map(|item| item.split_once('=')) {
        draft.take(&RPC00B, Entry { key, text, line: None })?;
    }
    Ok(Parsed::certain(draft.finish(&RPC00B)?))
}

/// Whether two RPCs have the same numbers up to GDAL's 15 digits.
fn agree(a: &Rpc, b: &Rpc) -> bool {
    let close = |x: f64, y: f64| (x - y).abs() <= PRINTED_TOLERANCE * x.abs().max(y.abs());
    a.numbers().zip(b.numbers()).all(|(x, y)| close(x, y))
}
