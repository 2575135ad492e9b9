//! The origin of local positions, as JSON beside the file with the positions.
//!
//! `{"crs": "EPSG:32631", "vertical": "ellipsoid", "origin": [x, y, z], "axes": ["easting",
//! "northing", "height"], "unit": "metre"}`: the local position p lies at `origin + p` in the CRS.
//! The third coordinate is a height above the vertical datum.

use std::path::{Path, PathBuf};

use serde::{Deserialize, Serialize};

use crate::atomic::write_bytes;
use crate::format_error::FormatError;
use crate::regular::read_regular_text;

/// Point of a map that local positions are relative to.
#[derive(Debug, Clone, PartialEq, Serialize, Deserialize)]
pub struct LocalOrigin {
    /// Projected CRS: `EPSG:n`, WKT or PROJJSON.
    pub crs: String,
    /// Vertical datum of the heights: `ellipsoid`, `egm96`, …
    pub vertical: String,
    /// Easting, northing and height of the local position (0, 0, 0), metres.
    pub origin: [f64; 3],
    /// Names of the axes, for people who read the file.
    #[serde(default = "axes")]
    pub axes: [String; 3],
    /// Unit of all lengths, for people who read the file.
    #[serde(default = "metre")]
    pub unit: String,
}

fn axes() -> [String; 3] {
    ["easting", "northing", "height"].map(str::to_owned)
}

fn metre() -> String {
    "metre".to_owned()
}

impl LocalOrigin {
    /// Creates an origin in a projected CRS whose unit is the metre.
    pub fn new(crs: impl Into<String>, vertical: impl Into<String>, origin: [f64; 3]) -> Self {
        Self { crs: crs.into(), vertical: vertical.into(), origin, axes: axes(), unit: metre() }
    }

    /// Writes the origin beside a file, to [`origin_path`].
    ///
    /// # Errors
    /// The errors of [`Self::write`].
    pub fn write_beside(&self, file: &Path, overwrite: bool) -> Result<(), FormatError> {
        self.write(&origin_path(file), overwrite)
    }

    /// Writes the origin to a file.
    ///
    /// # Errors
    /// [`FormatError`] when the origin is not finite, and when the file exists and `overwrite` is
    /// false, or cannot be written.
    pub fn write(&self, path: &Path, overwrite: bool) -> Result<(), FormatError> {
        if !self.origin.iter().all(|c| c.is_finite()) {
            return Err(FormatError::new(path, "the origin is not finite"));
        }
        let text = serde_json::to_string_pretty(self).map_err(|error| FormatError::new(path, error.to_string()))?;
        Ok(write_bytes(path, (text + "\n").as_bytes(), overwrite)?)
    }

    /// Reads the origin beside a file, or returns `None` when no such file exists.
    ///
    /// # Errors
    /// [`FormatError`] when the system cannot read the file, and when it is not an origin.
    pub fn read_beside(file: &Path) -> Result<Option<Self>, FormatError> {
        let path = origin_path(file);
        match read_regular_text(&path, 1 << 20) {
            Ok(text) => {
                let origin: Self = serde_json::from_str(&text).map_err(|error| {
                    FormatError::new(&path, format!("the file is not an origin as skysweep writes it ({error})"))
                })?;
                Ok(Some(origin))
            }
            Err(error) if error.kind() == std::io::ErrorKind::NotFound => Ok(None),
            Err(source) => Err(FormatError::unreadable(&path, "the file", source)),
        }
    }
}

/// Returns the path of the origin of a file: `splats.origin.json` for `splats.ply`.
pub fn origin_path(file: &Path) -> PathBuf {
    file.with_extension("origin.json")
}
