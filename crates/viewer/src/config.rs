//! The configuration of a viewer.

use std::path::PathBuf;

use serde::{Deserialize, Serialize};

use job::error::SettingError;

/// Longest time that a viewer may be given, seconds: a year.
const SECONDS_MAX: f64 = 366.0 * 86_400.0;
/// Most inputs.
const INPUTS_MAX: usize = 32;

/// An interactive viewer of runs, rasters, splats and meshes.
#[derive(Debug, Clone, PartialEq, Serialize, Deserialize)]
#[serde(deny_unknown_fields)]
#[non_exhaustive]
pub struct ViewConfig {
    /// Folders of runs, of trainings and of datasets, rasters, splats, meshes. The first raster
    /// found gives the coordinate system of the map, the first origin that of splats and meshes.
    pub inputs: Vec<PathBuf>,
    /// Port on 127.0.0.1. `None` lets the system choose a free one.
    #[serde(default)]
    pub port: Option<u16>,
    /// Time after which the viewer ends, seconds. `None` goes on until it is cancelled.
    #[serde(default)]
    pub seconds: Option<f64>,
}

impl ViewConfig {
    /// A viewer of some inputs on a free port, without an end.
    pub fn new(inputs: Vec<PathBuf>) -> Self {
        Self { inputs, port: None, seconds: None }
    }

    /// Checks the settings that can be judged without opening a file.
    ///
    /// # Errors
    /// [`SettingError`] for a time that is not positive or longer than a year, and without inputs
    /// or with more than 32.
    pub fn validate(&self) -> Result<(), SettingError> {
        if self.inputs.is_empty() || self.inputs.len() > INPUTS_MAX {
            return Err(SettingError::new("number of inputs", self.inputs.len(), format!("1 to {INPUTS_MAX}")));
        }
        match self.seconds {
            Some(seconds) if !(seconds > 0.0 && seconds <= SECONDS_MAX) => {
                Err(SettingError::new("time of the viewer", seconds, format!("seconds above 0, at most {SECONDS_MAX}")))
            }
            _ => Ok(()),
        }
    }
}
