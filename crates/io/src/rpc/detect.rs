//! Which text format a file has, by its content and not by its name.

use super::error::{Attempt, Fault};
use super::{Parsed, RpcFormat, alos, digital_globe, dimap, envi, gdal_xml, geom, json, key_value, rpb, xml};

/// A format's test and reader.
struct Reader {
    format: RpcFormat,
    /// The name of the root element, for the XML formats that fix it.
    root: Option<&'static str>,
    markup: bool,
    recognise: fn(&str) -> bool,
    parse: fn(&str) -> Result<Parsed, Fault>,
    /// What a file needs to be this.
    needs: &'static str,
}

impl Reader {
    const fn plain(format: RpcFormat, recognise: fn(&str) -> bool, parse: fn(&str) -> Result<Parsed, Fault>) -> Self {
        Self { format, root: None, markup: false, recognise, parse, needs: "" }
    }
}

/// In the order in which they are tried: the specific before the general.
const READERS: [Reader; 10] = [
    Reader {
        root: Some("VRTDataset"),
        markup: true,
        needs: "no VRTDataset with metadata of the domain RPC",
        ..Reader::plain(RpcFormat::Vrt, gdal_xml::recognise, gdal_xml::parse)
    },
    Reader {
        root: Some("PAMDataset"),
        markup: true,
        needs: "no PAMDataset with metadata of the domain RPC",
        ..Reader::plain(RpcFormat::AuxXml, gdal_xml::recognise, gdal_xml::parse)
    },
    Reader {
        root: Some("Dimap_Document"),
        markup: true,
        needs: "no Dimap_Document with a Global_RFM (give the RPC_*.XML, not the DIM_*.XML)",
        ..Reader::plain(RpcFormat::Dimap, dimap::recognise, dimap::parse)
    },
    Reader {
        markup: true,
        needs: "no RPB element",
        ..Reader::plain(RpcFormat::DigitalGlobeXml, digital_globe::recognise, digital_globe::parse)
    },
    Reader {
        needs: "no JSON object with rpcm's or GeoTIFF's names",
        ..Reader::plain(RpcFormat::Json, json::recognise, json::parse)
    },
    Reader {
        needs: "no ENVI header with rpc info",
        ..Reader::plain(RpcFormat::EnviHeader, envi::recognise, envi::parse)
    },
    Reader {
        needs: "no polynomial_format or line_num_coeff_00",
        ..Reader::plain(RpcFormat::OssimGeom, geom::recognise, geom::parse)
    },
    Reader { needs: "no lineNumCoef", ..Reader::plain(RpcFormat::Rpb, rpb::recognise, rpb::parse) },
    Reader { needs: "no LINE_OFF", ..Reader::plain(RpcFormat::Text, key_value::recognise, key_value::parse) },
    Reader { needs: "no digits in columns", ..Reader::plain(RpcFormat::Alos, alos::recognise, alos::parse) },
];

/// A recognised format; its reader's verdict is final.
pub(super) struct Found {
    pub(super) format: RpcFormat,
    pub(super) result: Result<Parsed, Fault>,
    /// The formats ruled out before.
    pub(super) tried: Vec<Attempt>,
}

/// Whether the text is XML or JSON.
pub(super) fn is_markup(text: &str) -> bool {
    text.trim_start().starts_with(['<', '{', '['])
}

/// Finds the format of a text and reads it; the error says why it is none of them.
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
        tried.push(Attempt::new(reader.format, reader.needs));
    }
    Err(tried)
}
