//! Configurations of the city model jobs.

use std::path::{Path, PathBuf};

use city::Lod;
use job::error::JobError;
use serde::{Deserialize, Serialize};

use super::error::CityJobError;

/// A city model and how it is read.
#[derive(Debug, Clone, PartialEq, Eq, Serialize, Deserialize)]
#[serde(deny_unknown_fields)]
#[non_exhaustive]
pub struct CityInput {
    /// City model: CityJSON, CityJSONSeq, CityGML, OBJ or PLY.
    pub file: PathBuf,
    /// Level of detail, such as 2.2; the highest of each object up to 2.x when `None`.
    #[serde(with = "job::as_text", default)]
    pub lod: Option<Lod>,
    /// Whether every object with surfaces is used, and not only buildings.
    pub all_objects: bool,
    /// File for the account of every object with its defects (JSON). Only when it is given, solids
    /// are checked for shells that meet themselves, cavities outside of their solid, and parts that
    /// overlap (codes 306, 4xx, 5xx, 601).
    pub account: Option<PathBuf>,
    /// Whether existing files may be replaced.
    pub overwrite: bool,
}

/// A city model to be described.
#[derive(Debug, Clone, PartialEq, Eq, Serialize, Deserialize)]
#[serde(deny_unknown_fields)]
#[non_exhaustive]
pub struct CityInfoConfig {
    /// The model.
    pub input: CityInput,
}

/// A city model to be written in another format.
#[derive(Debug, Clone, PartialEq, Eq, Serialize, Deserialize)]
#[serde(deny_unknown_fields)]
#[non_exhaustive]
pub struct CityConvertConfig {
    /// The model.
    pub input: CityInput,
    /// File to write.
    pub output: PathBuf,
    /// Format to write; taken from the ending of `output` when `None`.
    pub format: Option<CityOutputFormat>,
}

/// A format that city models are written in.
#[derive(Debug, Clone, Copy, PartialEq, Eq, Serialize, Deserialize)]
#[serde(rename_all = "lowercase")]
#[non_exhaustive]
pub enum CityOutputFormat {
    /// Triangles as Wavefront OBJ with whole coordinates.
    Obj,
    /// Triangles as binary PLY: f32 relative to an origin that the header names.
    Ply,
    /// Triangles as binary glTF: f32 relative to an origin that the extras name.
    Glb,
    /// Footprints with heights in longitude and latitude.
    Geojson,
    /// CityJSON 2.0 with all objects and levels of detail.
    Cityjson,
}

impl CityOutputFormat {
    /// All values with the names that people give them, and their meanings.
    pub const CHOICES: [(&'static str, Self, &'static str); 5] = [
        ("obj", Self::Obj, "Wavefront OBJ, whole coordinates"),
        ("ply", Self::Ply, "Binary PLY, f32 from an origin that the header names"),
        ("glb", Self::Glb, "Binary glTF, f32 from an origin that the extras name"),
        ("geojson", Self::Geojson, "Footprints with heights in longitude and latitude"),
        ("cityjson", Self::Cityjson, "CityJSON 2.0 with all objects and levels"),
    ];
}

impl CityInput {
    /// Buildings of `file` at their default level of detail, without an account.
    pub fn new(file: PathBuf) -> Self {
        Self { file, lod: None, all_objects: false, account: None, overwrite: false }
    }
}

impl CityInfoConfig {
    /// A description of the buildings of `file`.
    pub fn new(file: PathBuf) -> Self {
        Self { input: CityInput::new(file) }
    }
}

impl CityConvertConfig {
    /// A conversion of the buildings of `file` that takes the format from the ending of `output`.
    pub fn new(file: PathBuf, output: PathBuf) -> Self {
        Self { input: CityInput::new(file), output, format: None }
    }

    /// Checks that a format is known.
    ///
    /// # Errors
    /// [`JobError`] when neither `format` nor the ending of `output` names one.
    pub fn validate(&self) -> Result<(), JobError> {
        Ok(self.output_format().map(drop)?)
    }

    /// The format to write.
    pub(super) fn output_format(&self) -> Result<CityOutputFormat, CityJobError> {
        self.format.map_or_else(|| format_of(&self.output), Ok)
    }
}

fn format_of(output: &Path) -> Result<CityOutputFormat, CityJobError> {
    let ending = output.extension().map(|e| e.to_string_lossy().to_lowercase());
    match ending.as_deref() {
        Some("obj") => Ok(CityOutputFormat::Obj),
        Some("ply") => Ok(CityOutputFormat::Ply),
        Some("glb") => Ok(CityOutputFormat::Glb),
        Some("geojson") => Ok(CityOutputFormat::Geojson),
        Some("json") => Ok(CityOutputFormat::Cityjson),
        _ => Err(CityJobError::UnknownEnding { path: output.to_owned() }),
    }
}
