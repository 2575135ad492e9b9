//! The configuration of a change.

use std::path::PathBuf;

use change::ChangeConfig;
use crs::VerticalDatum;
use eval::AlignmentMethod;
use serde::{Deserialize, Serialize};

use super::error::DiffError;
use job::error::{JobError, SettingError};

/// Change between two surface models.
#[derive(Debug, Clone, PartialEq, Serialize, Deserialize)]
#[serde(deny_unknown_fields)]
#[non_exhaustive]
pub struct DiffConfig {
    /// Surface model of the first date, or the folder of a DSM run. The results lie on its grid.
    pub before: PathBuf,
    /// Surface model of the second date, or the folder of a DSM run.
    pub after: PathBuf,
    /// Folder for the results.
    pub output: PathBuf,
    /// Shift of the second surface that is removed first.
    pub alignment: AlignmentMethod,
    /// Radius of the horizontal search, metres.
    pub search_m: f64,
    /// Side of blocks that are moved on their own after the shift, metres: against jitter and
    /// drifts, which one shift leaves. `None` moves the surface as a whole.
    #[serde(default)]
    pub block_m: Option<f64>,
    /// Standard deviation of the heights of a surface without a `sigma.tif` beside it, metres.
    #[serde(default)]
    pub sigma_m: Option<f64>,
    /// Whether filled cells count as observed.
    #[serde(default)]
    pub use_filled: bool,
    /// Vertical datum of the first surface, where the file names none or a wrong one.
    #[serde(with = "job::as_text", default)]
    pub before_vertical: Option<VerticalDatum>,
    /// Vertical datum of the second surface, where the file names none or a wrong one.
    #[serde(with = "job::as_text", default)]
    pub after_vertical: Option<VerticalDatum>,
    /// Polygons (GeoPackage or GeoJSON) whose volumes are wanted.
    #[serde(default)]
    pub areas: Option<PathBuf>,
    /// Layer of a GeoPackage with several.
    #[serde(default)]
    pub areas_layer: Option<String>,
    /// Field of the polygons that holds their names.
    #[serde(default)]
    pub areas_field: Option<String>,
    /// Distance by which walls reach too far outwards, metres. `None` takes what surfaces of this
    /// toolkit have where both surfaces come with their layers, and 0 otherwise.
    #[serde(default)]
    pub overreach_m: Option<f64>,
    /// Parameters of the search for change, without the overreach.
    #[serde(default)]
    pub change: ChangeConfig,
    /// Worker threads. `None` uses all cores.
    #[serde(default)]
    pub threads: Option<usize>,
    /// Whether existing files may be replaced.
    #[serde(default)]
    pub overwrite: bool,
}

impl DiffConfig {
    /// A change with the default parameters: the second surface is moved onto the first.
    pub fn new(before: PathBuf, after: PathBuf, output: PathBuf) -> Self {
        Self {
            before,
            after,
            output,
            alignment: AlignmentMethod::Xyz,
            search_m: 5.0,
            block_m: None,
            sigma_m: None,
            use_filled: false,
            before_vertical: None,
            after_vertical: None,
            areas: None,
            areas_layer: None,
            areas_field: None,
            overreach_m: None,
            change: ChangeConfig::default(),
            threads: None,
            overwrite: false,
        }
    }

    /// Checks the settings that can be judged without opening a file.
    ///
    /// # Errors
    /// [`JobError`] for a parameter of the search, and for a standard deviation that is not
    /// positive.
    pub fn validate(&self) -> Result<(), JobError> {
        self.change.validate().map_err(DiffError::from)?;
        match self.sigma_m {
            Some(sigma) if !(sigma.is_finite() && sigma > 0.0) => {
                let error =
                    SettingError::new("the standard deviation of the heights", sigma, "a positive number of metres");
                Err(error.into())
            }
            _ => Ok(()),
        }
    }
}
