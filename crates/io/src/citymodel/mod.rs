//! City models in files: CityJSON, CityJSONSeq, CityGML, OBJ and PLY.
//!
//! [`read`] finds the format by the content. What a file says becomes a [`CityModel`]; a surface that cannot be used is left
//! out and listed among the [`Defect`]s, a file that breaks its format is refused with a number of the catalogue and a
//! place ([`CityFault`]). Coordinates stay in the reference system of the file. Nothing named inside a file is opened.

mod builder;
mod citygml;
mod cityjson;
mod crs_name;
mod error;
mod export;
mod obj;
mod placement;
mod ply;

use std::fmt;
use std::path::{Path, PathBuf};

use city::{CityModel, Defect};

pub use cityjson::{CityJsonOptions, write_cityjson};
pub use error::{CityError, CityFault};
pub use export::{Footprints, MeshFormat, write_footprints, write_mesh};
pub(crate) use ply::points as ply_points;

/// City models are read up to this size, bytes.
pub const SIZE_LIMIT: u64 = 2 << 30;

/// A city model and how it came out of its file.
#[derive(Debug, Clone)]
pub struct CityFile {
    /// The model.
    pub model: CityModel,
    /// The format of the file.
    pub format: CityFormat,
    /// What was wrong with parts of it; the objects are those of the model.
    pub defects: Vec<Defect>,
    /// The file.
    pub source: PathBuf,
}

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

/// What a format's reader makes of the bytes of a file.
#[derive(Debug)]
struct Parsed {
    model: CityModel,
    format: CityFormat,
    defects: Vec<Defect>,
}

/// Reads a city model.
///
/// # Errors
/// A file that cannot be read, is too large, is of no known format, or breaks the rules of its format.
pub fn read(path: &Path) -> Result<CityFile, CityError> {
    let bytes = content(path)?;
    let parsed = parse(&bytes).map_err(|fault| fault.at(path))?;
    let Parsed { model, format, defects } = parsed;
    Ok(CityFile { model, format, defects, source: path.to_owned() })
}

fn parse(bytes: &[u8]) -> Result<Parsed, CityFault> {
    let text = bytes.strip_prefix(b"\xef\xbb\xbf").unwrap_or(bytes).trim_ascii_start();
    if ply::looks_like(bytes) {
        return ply::parse(bytes);
    }
    match text.first() {
        None => Err(CityFault::invalid("the file is empty", "line 1")),
        Some(b'{') => cityjson::parse(text),
        Some(b'<') => citygml::parse(text),
        Some(_) if obj::looks_like(text) => obj::parse(bytes),
        Some(_) => Err(CityFault::unsupported("found none of CityJSON, CityGML, OBJ and PLY", "line 1")),
    }
}

pub(crate) fn content(path: &Path) -> Result<Vec<u8>, CityError> {
    let unreadable = |source| CityError::Unreadable { path: path.to_owned(), source };
    let found = std::fs::metadata(path).map_err(unreadable)?;
    if !found.is_file() {
        return Err(unreadable(std::io::Error::new(std::io::ErrorKind::InvalidInput, "not a regular file")));
    }
    if found.len() > SIZE_LIMIT {
        return Err(CityError::TooLarge { path: path.to_owned(), bytes: found.len(), limit: SIZE_LIMIT });
    }
    std::fs::read(path).map_err(unreadable)
}
