//! Reads a city model of any known format.

use std::path::{Path, PathBuf};

use city::{CityModel, Defect};

use super::error::{CityError, CityFault};
use super::format::{CityFormat, Parsed};
use super::{citygml, cityjson, obj, ply};
use formats::ply::looks_like_ply;
use formats::read_regular;

/// Largest file that is read, bytes.
pub const SIZE_LIMIT: u64 = 2 << 30;

/// A city model from a file.
#[derive(Debug, Clone)]
pub struct CityFile {
    /// The model.
    pub model: CityModel,
    /// Format of the file.
    pub format: CityFormat,
    /// Defects of single surfaces and objects. They name objects by their index in the model.
    pub defects: Vec<Defect>,
    /// Path of the file.
    pub source: PathBuf,
}

/// Reads a city model.
///
/// # Errors
/// - [`CityError::Unreadable`] when the system cannot read the file.
/// - [`CityError::TooLarge`] when it has more than [`SIZE_LIMIT`] bytes.
/// - [`CityError::Refused`] when its format is not known, or it breaks the rules of its format.
///
/// # Examples
/// ```
/// let text = r#"{
///   "type": "CityJSON", "version": "2.0",
///   "transform": {"scale": [1, 1, 1], "translate": [0, 0, 0]},
///   "metadata": {"referenceSystem": "https://www.opengis.net/def/crs/EPSG/0/7415"},
///   "CityObjects": {"house": {"type": "Building", "geometry": [
///     {"type": "MultiSurface", "lod": "2.2", "boundaries": [[[0, 1, 2]]]}]}},
///   "vertices": [[0, 0, 3], [4, 0, 3], [0, 4, 3]]
/// }"#;
/// let folder = tempfile::tempdir()?;
/// let path = folder.path().join("house.city.json");
/// std::fs::write(&path, text)?;
///
/// let file = cityfiles::read(&path)?;
/// assert_eq!(file.format.to_string(), "CityJSON 2.0");
/// assert_eq!(file.model.crs.epsg, Some(7415));
/// assert_eq!(file.model.objects[0].id, "house");
/// assert!(file.defects.is_empty());
/// # Ok::<(), Box<dyn std::error::Error>>(())
/// ```
pub fn read(path: &Path) -> Result<CityFile, CityError> {
    let bytes = content(path)?;
    let Parsed { model, format, defects } = parse(&bytes).map_err(|fault| fault.at(path))?;
    Ok(CityFile { model, format, defects, source: path.to_owned() })
}

fn parse(bytes: &[u8]) -> Result<Parsed, CityFault> {
    let text = bytes.strip_prefix(b"\xef\xbb\xbf").unwrap_or(bytes).trim_ascii_start();
    if looks_like_ply(bytes) {
        return ply::parse(bytes);
    }
    match text.first() {
        None => Err(CityFault::invalid("the file is empty", "line 1")),
        Some(b'{') => cityjson::parse(text),
        Some(b'<') => citygml::parse(text),
        Some(_) if obj::looks_like(text) => obj::parse(bytes),
        Some(_) => {
            let what = "the content is neither CityJSON nor CityGML, OBJ or PLY";
            Err(CityFault::unsupported(what, "line 1"))
        }
    }
}

/// Reads the bytes of a regular file of at most [`SIZE_LIMIT`].
pub(crate) fn content(path: &Path) -> Result<Vec<u8>, CityError> {
    let unreadable = |source| CityError::Unreadable { path: path.to_owned(), source };
    let found = std::fs::metadata(path).map_err(unreadable)?;
    if !found.is_file() {
        return Err(unreadable(std::io::Error::new(std::io::ErrorKind::InvalidInput, "not a regular file")));
    }
    if found.len() > SIZE_LIMIT {
        return Err(CityError::TooLarge { path: path.to_owned(), bytes: found.len(), limit: SIZE_LIMIT });
    }
    read_regular(path, SIZE_LIMIT).map_err(unreadable)
}
