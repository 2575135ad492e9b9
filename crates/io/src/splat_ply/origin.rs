//! The origin of local positions, as JSON beside the file that holds them.
//!
//! `{"crs": "EPSG:32631", "vertical": "ellipsoid", "origin": [x, y, z], "axes": ["easting", "northing", "height"], "unit":
//! "metre"}`: a local position p is at `origin + p` in the CRS, its third coordinate a height above the vertical datum.

use std::path::{Path, PathBuf};

use serde::{Deserialize, Serialize};

use super::{SplatPlyError, invalid};
use crate::atomic::write_bytes;

/// Where local positions are counted from.
#[derive(Debug, Clone, PartialEq, Serialize, Deserialize)]
pub struct LocalOrigin {
    /// A projected CRS: `EPSG:n`, WKT or PROJJSON.
    pub crs: String,
    /// What heights are measured from: `ellipsoid`, `egm96`, …
    pub vertical: String,
    /// Easting, northing and height of (0, 0, 0), metres.
    pub origin: [f64; 3],
    /// The axes by name; written for readers.
    #[serde(default = "axes")]
    pub axes: [String; 3],
    /// The unit of all lengths; written for readers.
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
    /// An origin in a projected CRS whose unit is the metre.
    pub fn new(crs: impl Into<String>, vertical: impl Into<String>, origin: [f64; 3]) -> Self {
        Self { crs: crs.into(), vertical: vertical.into(), origin, axes: axes(), unit: metre() }
    }

    /// Writes it beside a file; see [`origin_path`].
    ///
    /// # Errors
    /// As [`Self::write`].
    pub fn write_beside(&self, file: &Path, overwrite: bool) -> Result<(), SplatPlyError> {
        self.write(&origin_path(file), overwrite)
    }

    /// Writes it to a file of its own.
    ///
    /// # Errors
    /// An origin that is not finite; a file that exists or cannot be written.
    pub fn write(&self, path: &Path, overwrite: bool) -> Result<(), SplatPlyError> {
        if !self.origin.iter().all(|c| c.is_finite()) {
            return Err(invalid(path, "the origin is not finite"));
        }
        let text = serde_json::to_string_pretty(self).map_err(|error| invalid(path, error.to_string()))?;
        Ok(write_bytes(path, (text + "\n").as_bytes(), overwrite)?)
    }

    /// Reads the origin beside a file; `None` when there is none.
    ///
    /// # Errors
    /// A file that cannot be read, or that is no origin.
    pub fn read_beside(file: &Path) -> Result<Option<Self>, SplatPlyError> {
        let path = origin_path(file);
        match std::fs::read_to_string(&path) {
            Ok(text) => {
                let origin: Self = serde_json::from_str(&text)
                    .map_err(|error| invalid(&path, format!("not an origin as skysweep writes it ({error})")))?;
                Ok(Some(origin))
            }
            Err(error) if error.kind() == std::io::ErrorKind::NotFound => Ok(None),
            Err(source) => Err(SplatPlyError::Unreadable { path, source }),
        }
    }
}

/// `splats.ply` → `splats.origin.json`.
pub fn origin_path(file: &Path) -> PathBuf {
    file.with_extension("origin.json")
}
