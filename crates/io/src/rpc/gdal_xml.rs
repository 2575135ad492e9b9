//! The `RPC` metadata domain in GDAL's own XML: virtual rasters and `.aux.xml`.
//!
//! Only the text of the document itself is read; sources named in it are not opened. Image coordinates count from 0
//! as in RPC00B. A virtual raster is commonly written for the coordinates of its own pixels, so nothing is shifted.

use super::Parsed;
use super::draft::{Draft, Entry, RPC00B};
use super::error::Fault;
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
    Ok(Parsed { rpc: draft.finish(&RPC00B)?, warnings: Vec::new() })
}
