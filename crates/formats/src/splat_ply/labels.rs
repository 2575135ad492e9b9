//! Labels of splats, and the table of what their numbers mean, as JSON beside the file with the
//! splats.
//!
//! `{"classes": {"2": "RoofSurface", …}, "missing_class": 255, "missing_object": 0, "objects":
//! [{"number": 7, "id": "…", "kind": "Building", "building": "…", "attributes": {…}}]}`: the
//! numbers are those of the properties `class` and `object` of the splats, and of the class and
//! object maps of priors.

use std::collections::BTreeMap;
use std::path::{Path, PathBuf};

use gaussian::SplatLabel;
use serde::{Deserialize, Serialize};
use serde_json::{Map, Value};

use crate::atomic::write_bytes;
use crate::format_error::FormatError;
use crate::regular::read_regular_text;

/// Largest table that is read, bytes: a hundred thousand objects with two kilobytes of attributes.
const SIZE_LIMIT: u64 = 256 << 20;

/// Classes and objects of splats.
#[derive(Debug, Clone, PartialEq)]
pub struct SplatLabels {
    /// One for each splat.
    pub of: Vec<SplatLabel>,
    /// What their numbers mean; empty where the file has no table beside it.
    pub table: LabelTable,
}

/// What the numbers of classes and objects mean.
#[derive(Debug, Clone, PartialEq, Serialize, Deserialize)]
pub struct LabelTable {
    /// Names of the classes by their numbers.
    pub classes: BTreeMap<u8, String>,
    /// Class of a splat without one.
    pub missing_class: u8,
    /// Object of a splat without one.
    pub missing_object: u32,
    /// The objects, by their numbers.
    pub objects: Vec<LabelledObject>,
}

/// An object of a city model.
#[derive(Debug, Clone, PartialEq, Serialize, Deserialize)]
pub struct LabelledObject {
    /// Its number: its place in the city model, counted from 1.
    pub number: u32,
    /// Identifier in the city model.
    pub id: String,
    /// Kind of the object, such as `Building`.
    pub kind: String,
    /// Identifier of the building that it belongs to; its own where it is one.
    pub building: String,
    /// Attributes, by their names in the city model.
    #[serde(default)]
    pub attributes: Map<String, Value>,
}

impl Default for LabelTable {
    fn default() -> Self {
        let SplatLabel { class, object } = SplatLabel::NONE;
        Self { classes: BTreeMap::new(), missing_class: class, missing_object: object, objects: Vec::new() }
    }
}

impl LabelTable {
    /// Writes the table beside a file, to [`objects_path`].
    ///
    /// # Errors
    /// [`FormatError`] when the file exists and `overwrite` is false, or cannot be
    /// written.
    pub fn write_beside(&self, file: &Path, overwrite: bool) -> Result<(), FormatError> {
        let path = objects_path(file);
        let text = serde_json::to_string_pretty(self).map_err(|error| FormatError::new(&path, error.to_string()))?;
        Ok(write_bytes(&path, (text + "\n").as_bytes(), overwrite)?)
    }

    /// Reads the table beside a file, or returns `None` when no such file exists.
    ///
    /// # Errors
    /// [`FormatError`] when the system cannot read the file, and when it is not a table.
    pub fn read_beside(file: &Path) -> Result<Option<Self>, FormatError> {
        let path = objects_path(file);
        match read_regular_text(&path, SIZE_LIMIT) {
            Ok(text) => serde_json::from_str(&text).map(Some).map_err(|error| {
                FormatError::new(&path, format!("the file is not a table of objects as skysweep writes it ({error})"))
            }),
            Err(error) if error.kind() == std::io::ErrorKind::NotFound => Ok(None),
            Err(source) => Err(FormatError::unreadable(&path, "the file", source)),
        }
    }
}

/// Returns the path of the table of a file: `splats.objects.json` for `splats.ply`.
pub fn objects_path(file: &Path) -> PathBuf {
    file.with_extension("objects.json")
}
