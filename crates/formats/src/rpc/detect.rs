//! Finding the text format of a file by its content, not by its name.

use super::error::{Attempt, Fault};
use super::format::RpcFormat;
use super::rpc_file::Parsed;
use super::{alos, digital_globe, dimap, envi, gdal_xml, geom, json, key_value, rpb, xml};

/// Test and reader of one format.
struct Reader {
    format: RpcFormat,
    /// The name of the root element, for XML formats with a fixed one.
    root: Option<&'static str>,
    /// Whether the format is XML.
    markup: bool,
    recognise: fn(&str) -> bool,
    parse: fn(&str) -> Result<Parsed, Fault>,
    /// Why a file is not in this format when `recognise` refuses it.
    reason: &'static str,
}

impl Reader {
    const fn plain(format: RpcFormat, recognise: fn(&str) -> bool, parse: fn(&str) -> Result<Parsed, Fault>) -> Self {
        Self { format, root: None, markup: false, recognise, parse, reason: "" }
    }
}

/// All formats in the order in which they are tried: the specific before the general.
const READERS: [Reader; 10] = [
    Reader {
        root: Some("VRTDataset"),
        markup: true,
        reason: "no VRTDataset with metadata of the domain RPC",
        ..Reader::plain(RpcFormat::Vrt, gdal_xml::recognise, gdal_xml::parse)
    },
    Reader {
        root: Some("PAMDataset"),
        markup: true,
        reason: "no PAMDataset with metadata of the domain RPC",
        ..Reader::plain(RpcFormat::AuxXml, gdal_xml::recognise, gdal_xml::parse)
    },
    Reader {
        root: Some("Dimap_Document"),
        markup: true,
        reason: "no Dimap_Document with a Global_RFM (give the RPC_*.XML, not the DIM_*.XML)",
        ..Reader::plain(RpcFormat::Dimap, dimap::recognise, dimap::parse)
    },
    Reader {
        markup: true,
        reason: "no RPB element",
        ..Reader::plain(RpcFormat::DigitalGlobeXml, digital_globe::recognise, digital_globe::parse)
    },
    Reader {
        reason: "no JSON object with rpcm's or GeoTIFF's names",
        ..Reader::plain(RpcFormat::Json, json::recognise, json::parse)
    },
    Reader {
        reason: "no ENVI header with rpc info",
        ..Reader::plain(RpcFormat::EnviHeader, envi::recognise, envi::parse)
    },
    Reader {
        reason: "no polynomial_format or line_num_coeff_00",
        ..Reader::plain(RpcFormat::OssimGeom, geom::recognise, geom::parse)
    },
    Reader { reason: "no lineNumCoef", ..Reader::plain(RpcFormat::Rpb, rpb::recognise, rpb::parse) },
    Reader { reason: "no LINE_OFF", ..Reader::plain(RpcFormat::Text, key_value::recognise, key_value::parse) },
    Reader { reason: "no digits in columns", ..Reader::plain(RpcFormat::Alos, alos::recognise, alos::parse) },
];

/// A recognised format with the result of its reader. No further format is tried when the reader
/// fails.
pub(super) struct Found {
    pub(super) format: RpcFormat,
    pub(super) result: Result<Parsed, Fault>,
    /// The formats tried before.
    pub(super) tried: Vec<Attempt>,
}

/// Whether the text is XML or JSON.
pub(super) fn is_markup(text: &str) -> bool {
    text.trim_start().starts_with(['<', '{', '['])
}

/// Finds the format of a text and reads it. The error lists every format with the reason why the
/// text is not in it.
pub(super) fn detect(text: &str) -> Result<Found, Vec<Attempt>> {
    let text_start = text.trim_start();
    let is_xml = text_start.starts_with('<');
    let root = if is_xml { xml::root(text) } else { None };
    let mut tried = Vec::new();
    for reader in READERS.iter().filter(|r| r.markup == is_xml) {
        let root_fits = reader.root.is_none_or(|name| root.as_deref() == Some(name));
        if root_fits && (reader.recognise)(text_start) {
            return Ok(Found { format: reader.format, result: (reader.parse)(text), tried });
        }
        tried.push(Attempt::new(reader.format, reader.reason));
    }
    Err(tried)
}
