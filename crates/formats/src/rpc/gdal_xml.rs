//! The `RPC` metadata domain in GDAL's own XML: virtual rasters and `.aux.xml`.
//!
//! Only the document itself is read: sources named in it are not opened. Image coordinates are
//! counted from 0 as in RPC00B. The RPC of a virtual raster usually has the coordinates of the
//! raster's own pixels, so nothing is shifted.

use super::draft::{Draft, Entry};
use super::error::Fault;
use super::names::RPC00B;
use super::rpc_file::Parsed;
use super::xml;

/// Whether the document has an RPC domain.
pub(super) fn recognise(text: &str) -> bool {
    text.contains("domain=\"RPC\"") || text.contains("domain='RPC'")
}

/// Reads the RPC.
pub(super) fn parse(text: &str) -> Result<Parsed, Fault> {
    let mut draft = Draft::default();
    xml::walk(text, |leaf| {
        if let [_, domain, item] = leaf.path
            && domain.name == "Metadata"
            && domain.attribute("domain") == Some("RPC")
            && let Some(key) = item.attribute("key")
        {
            draft.take(&RPC00B, Entry { key, text: leaf.text, line: Some(leaf.line) })?;
        }
        Ok(())
    })?;
    Ok(Parsed::certain(draft.finish(&RPC00B)?))
}
