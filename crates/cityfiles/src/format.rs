//! The formats of city models.

use std::fmt;

use city::{CityModel, Defect};

/// A format of city models, with its version where it has several.
#[derive(Debug, Clone, PartialEq, Eq)]
#[non_exhaustive]
pub enum CityFormat {
    /// CityJSON, with its version.
    CityJson(String),
    /// CityJSON text sequence, with the version of its first line.
    CityJsonSeq(String),
    /// CityGML, with its version.
    CityGml(String),
    /// Wavefront OBJ.
    Obj,
    /// Polygon file format, text or binary.
    Ply,
}

impl fmt::Display for CityFormat {
    fn fmt(&self, f: &mut fmt::Formatter<'_>) -> fmt::Result {
        match self {
            Self::CityJson(version) => write!(f, "CityJSON {version}"),
            Self::CityJsonSeq(version) => write!(f, "CityJSONSeq {version}"),
            Self::CityGml(version) => write!(f, "CityGML {version}"),
            Self::Obj => f.write_str("OBJ"),
            Self::Ply => f.write_str("PLY"),
        }
    }
}

/// The result of the reader of a format.
#[derive(Debug)]
pub(super) struct Parsed {
    pub(super) model: CityModel,
    pub(super) format: CityFormat,
    pub(super) defects: Vec<Defect>,
}
