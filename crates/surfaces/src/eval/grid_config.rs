//! The configuration of a comparison of two height grids.

use std::path::PathBuf;

use crs::VerticalDatum;
use eval::{AlignmentMethod, EvalConfig};
use serde::{Deserialize, Serialize};

use super::requirements::EvalRequirements;
use job::error::JobError;
use job::run_folder::surface_file;

/// Folder of the report.
#[derive(Debug, Clone, PartialEq, Eq, Default, Serialize, Deserialize)]
#[serde(rename_all = "snake_case")]
#[non_exhaustive]
pub enum EvalTarget {
    /// `RUN/eval` if the test is the surface model of a DSM run (`RUN/dsm/dsm.tif`), else none. A
    /// report that cannot be written there is a warning.
    #[default]
    RunFolder,
    /// This folder. A report that cannot be written is an error.
    Folder(PathBuf),
    /// None.
    Nowhere,
}

/// A comparison of two height grids.
#[derive(Debug, Clone, PartialEq, Serialize, Deserialize)]
#[serde(deny_unknown_fields)]
#[non_exhaustive]
pub struct GridEvalConfig {
    /// Surface model to evaluate, on any grid, or the folder of a DSM run.
    pub test: PathBuf,
    /// Surface model that is believed, the folder of a DSM run, or a LAS or LAZ cloud. Errors are
    /// measured at its cells.
    pub reference: PathBuf,
    /// What is removed before the comparison.
    pub alignment: AlignmentMethod,
    /// Radius of the horizontal search, metres.
    pub search_m: f64,
    /// Thresholds of completeness and accuracy, metres.
    pub thresholds_m: Vec<f64>,
    /// Class raster on any grid, read at the nearest cell.
    pub classes: Option<PathBuf>,
    /// Classes whose cells are left out of everything, the alignment too.
    pub skip: Vec<i32>,
    /// Raster on any grid, read at the nearest cell. Only cells where it is not zero count.
    pub mask: Option<PathBuf>,
    /// Terrain model. `None` takes the terrain from the cells of class ground, or else estimates it
    /// from the reference.
    pub terrain: Option<PathBuf>,
    /// Confidence of each cell of the test, on its grid; more is better. `None` takes
    /// `confidence.tif` beside the test, if there is one.
    pub confidence: Option<PathBuf>,
    /// Raster on any grid, read at the nearest cell: 0 is ground, −1 a tree, and a positive number
    /// is the building that the cell belongs to.
    pub objects: Option<PathBuf>,
    /// Least height above the terrain of cells that count as standing, metres.
    pub standing_m: f64,
    /// Side of the cells into which a reference cloud is gridded, metres. `None` takes the longer
    /// side of the test's cells.
    pub reference_cell_m: Option<f64>,
    /// Vertical datum of the test, where the file names none or a wrong one.
    pub test_vertical: Option<VerticalDatum>,
    /// Vertical datum of the reference, where the file names none or a wrong one.
    pub reference_vertical: Option<VerticalDatum>,
    /// Folder of the report.
    pub target: EvalTarget,
    /// File for the HTML page alone.
    pub page: Option<PathBuf>,
    /// GeoTIFF for the errors (test − reference, metres) on the grid of the reference.
    pub error_map: Option<PathBuf>,
    /// Whether files may be replaced that no evaluation wrote.
    pub overwrite: bool,
    /// Requirements on the result.
    pub requirements: EvalRequirements,
    /// Worker threads. `None` uses all cores.
    pub threads: Option<usize>,
}

impl GridEvalConfig {
    /// A comparison with default settings: alignment in x, y and z, and the report in the folder of
    /// the run.
    pub fn new(test: PathBuf, reference: PathBuf) -> Self {
        let EvalConfig { alignment, search_m, thresholds_m, skip, standing_m, .. } = EvalConfig::default();
        Self {
            test,
            reference,
            alignment,
            search_m,
            thresholds_m,
            classes: None,
            skip,
            mask: None,
            terrain: None,
            confidence: None,
            objects: None,
            standing_m,
            reference_cell_m: None,
            test_vertical: None,
            reference_vertical: None,
            target: EvalTarget::default(),
            page: None,
            error_map: None,
            overwrite: false,
            requirements: EvalRequirements::default(),
            threads: None,
        }
    }

    /// Returns the configuration with the surface models of runs in the places of their folders.
    pub(super) fn with_surfaces_of_runs(&self) -> Self {
        Self { test: surface_file(&self.test), reference: surface_file(&self.reference), ..self.clone() }
    }

    /// Checks the settings that can be judged without opening a file.
    ///
    /// # Errors
    /// [`JobError`] for a number outside of its range.
    pub fn validate(&self) -> Result<(), JobError> {
        Ok(self.requirements.validate()?)
    }

    /// Returns the settings of the comparison itself. A height with an absolute error below
    /// `right_below_m` is right in the reliability table.
    pub(super) fn eval_config(&self, right_below_m: f64) -> EvalConfig {
        EvalConfig {
            alignment: self.alignment,
            search_m: self.search_m,
            thresholds_m: self.requirements.with_thresholds(self.thresholds_m.clone()),
            skip: self.skip.clone(),
            standing_m: self.standing_m,
            right_below_m,
        }
    }
}
