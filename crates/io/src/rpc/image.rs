//! The RPC that GDAL reports for an image.
//!
//! GDAL gives RPC metadata in the convention of RPC00B, whatever the driver: the centre of the upper-left pixel is (0, 0).
//! Drivers that follow references inside a file, or talk to a network, are not used: an input file cannot make this
//! reader fetch anything. Where a TIFF's tag 50844 and GDAL's metadata agree, the tag's doubles are taken, since GDAL prints
//! them with 15 digits; where they differ (GDAL prefers files beside the image), GDAL's are, with a warning.

use std::path::Path;

use camera::Rpc;
use gdal::{Dataset, DatasetOptions, DriverManager, GdalOpenFlags, Metadata};

use crate::raster::{prepare_gdal, with_gdal};

use super::draft::{Draft, Entry, RPC00B};
use super::error::{Attempt, Fault};
use super::{Parsed, RpcFile, RpcFormat, RpcReadError, tiff_tag};

/// Drivers that open other files or collections that a file names; those of networks are taken out by [`with_gdal`].
const FOLLOWS_REFERENCES: [&str; 10] =
    ["VRT", "DERIVED", "GTI", "RasterLite", "SQLite", "GPKG", "TileDB", "PDF", "KMLSUPEROVERLAY", "RPFTOC"];

/// What GDAL's answer may differ by from the tag it was printed from.
const PRINTED_TOLERANCE: f64 = 1e-13;

/// Opens an image read-only; the attempt says why it cannot be.
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

/// The RPC of an opened image; `None` when it has none.
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
            let what = "TIFF tag 50844 differs from the RPC beside the image, which is used as GDAL does";
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
    Ok(Parsed { rpc: draft.finish(&RPC00B)?, warnings: Vec::new() })
}

/// Whether two RPCs have the same numbers up to printing.
fn agree(a: &Rpc, b: &Rpc) -> bool {
    let close = |x: f64, y: f64| (x - y).abs() <= PRINTED_TOLERANCE * x.abs().max(y.abs());
    super::numbers(a).zip(super::numbers(b)).all(|(x, y)| close(x, y))
}
