//! The containers in which an RPC can be found.

use std::fmt;

use serde::{Deserialize, Serialize};

/// A container of RPC coefficients.
///
/// `Display` gives a name for people, serde a name in kebab case for programs.
#[derive(Debug, Clone, Copy, PartialEq, Eq, Hash, PartialOrd, Ord, Serialize, Deserialize)]
#[serde(rename_all = "kebab-case")]
#[non_exhaustive]
pub enum RpcFormat {
    /// `KEY: value unit` lines: `_RPC.TXT`, `_rpc.txt`, `.rpc` of DigitalGlobe, IKONOS, Planet,
    /// SkySat, EROS, KOMPSAT, OrbView.
    Text,
    /// DigitalGlobe's `.RPB`.
    Rpb,
    /// The `RPB` block of DigitalGlobe's `.XML`.
    DigitalGlobeXml,
    /// DIMAP 2 and 3: `RPC_*.XML` of Pléiades, SPOT 6/7 and Pléiades Neo.
    Dimap,
    /// ALOS PRISM and AVNIR-2: 1026 characters in columns of fixed width.
    Alos,
    /// OSSIM's and OTB's `.geom`.
    OssimGeom,
    /// JSON with rpcm's or GeoTIFF's names, at the top level or under `rpc`.
    Json,
    /// The `RPC` metadata domain of a GDAL virtual raster.
    Vrt,
    /// The `RPC` metadata domain of GDAL's `.aux.xml`.
    AuxXml,
    /// `rpc info` of an ENVI header.
    EnviHeader,
    /// TIFF tag 50844.
    TiffTag,
    /// The `RPC` metadata domain that a GDAL driver reports.
    GdalMetadata,
}

impl RpcFormat {
    /// All values with the names that people give them, and their meanings.
    pub const CHOICES: [(&'static str, Self, &'static str); 4] = [
        ("text", Self::Text, "`KEY: value` lines, as _RPC.TXT"),
        ("rpb", Self::Rpb, "DigitalGlobe's RPB"),
        ("json", Self::Json, "JSON with rpcm's names"),
        ("tif", Self::TiffTag, "the image again, with the RPC in TIFF tag 50844"),
    ];
}

impl fmt::Display for RpcFormat {
    fn fmt(&self, f: &mut fmt::Formatter<'_>) -> fmt::Result {
        f.write_str(match self {
            Self::Text => "RPC text (KEY: value)",
            Self::Rpb => "RPB",
            Self::DigitalGlobeXml => "DigitalGlobe XML",
            Self::Dimap => "DIMAP XML",
            Self::Alos => "ALOS fixed-width",
            Self::OssimGeom => "OSSIM geom",
            Self::Json => "JSON",
            Self::Vrt => "GDAL VRT",
            Self::AuxXml => "GDAL aux.xml",
            Self::EnviHeader => "ENVI header",
            Self::TiffTag => "TIFF tag 50844",
            Self::GdalMetadata => "GDAL RPC metadata",
        })
    }
}
