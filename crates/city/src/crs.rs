//! The coordinate reference system as a model's file names it.

use std::fmt;

/// A reference to a coordinate reference system: its codes where the file names them, and its own words.
///
/// All fields empty means that the file does not say where it is.
#[derive(Debug, Clone, PartialEq, Eq, Default)]
pub struct CrsReference {
    /// What stands in the file.
    pub name: Option<String>,
    /// EPSG code of the horizontal CRS, or of the compound CRS that holds both.
    pub epsg: Option<u32>,
    /// EPSG code of the vertical CRS where it is named apart.
    pub vertical_epsg: Option<u32>,
}

impl CrsReference {
    /// A reference by EPSG code; `vertical` only where the first code is horizontal alone.
    pub fn from_epsg(epsg: u32, vertical: Option<u32>) -> Self {
        Self { name: None, epsg: Some(epsg), vertical_epsg: vertical }
    }

    /// Whether the file said nothing about its CRS.
    pub fn is_missing(&self) -> bool {
        *self == Self::default()
    }
}

impl fmt::Display for CrsReference {
    /// `EPSG:7415`, `EPSG:25832+7837`, the file's own words, or `unknown`.
    fn fmt(&self, f: &mut fmt::Formatter<'_>) -> fmt::Result {
        match (self.epsg, self.vertical_epsg, &self.name) {
            (Some(code), None, _) => write!(f, "EPSG:{code}"),
            (Some(code), Some(vertical), _) => write!(f, "EPSG:{code}+{vertical}"),
            (None, _, Some(name)) => f.write_str(name),
            (None, _, None) => f.write_str("unknown"),
        }
    }
}
