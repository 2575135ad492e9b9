//! The coordinate reference system that the file of a model names.

use std::fmt;

/// Reference to a coordinate reference system, by EPSG codes and by the name in the file.
///
/// All fields are `None` when the file names no reference system.
///
/// # Examples
/// ```
/// use city::CrsReference;
///
/// assert_eq!(CrsReference::from_epsg(25832, Some(7837)).to_string(), "EPSG:25832+7837");
/// assert_eq!(CrsReference::default().to_string(), "unknown");
/// ```
#[derive(Debug, Clone, PartialEq, Eq, Default)]
pub struct CrsReference {
    /// Name as it stands in the file.
    pub name: Option<String>,
    /// EPSG code of the horizontal CRS, or of the compound CRS of both.
    pub epsg: Option<u32>,
    /// EPSG code of the vertical CRS, when it is named separately.
    pub vertical_epsg: Option<u32>,
}

impl CrsReference {
    /// Creates a reference from EPSG codes. Give `vertical` only when `epsg` is a horizontal CRS.
    pub fn from_epsg(epsg: u32, vertical: Option<u32>) -> Self {
        Self { name: None, epsg: Some(epsg), vertical_epsg: vertical }
    }

    /// Returns whether the file names no CRS.
    pub fn is_missing(&self) -> bool {
        *self == Self::default()
    }
}

impl fmt::Display for CrsReference {
    /// Writes `EPSG:7415`, `EPSG:25832+7837`, the name in the file, or `unknown`.
    fn fmt(&self, f: &mut fmt::Formatter<'_>) -> fmt::Result {
        match (self.epsg, self.vertical_epsg, &self.name) {
            (Some(code), None, _) => write!(f, "EPSG:{code}"),
            (Some(code), Some(vertical), _) => write!(f, "EPSG:{code}+{vertical}"),
            (None, _, Some(name)) => f.write_str(name),
            (None, _, None) => f.write_str("unknown"),
        }
    }
}
