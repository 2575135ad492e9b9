//! What a surface model says about its own cells: the origin of each height, its standard deviation
//! and its confidence, from the files that `skysweep dsm` writes beside `dsm.tif`.
//!
//! `source.tif` holds the origin, and `filled.tif` in surface models without it. A file beside the
//! test that is not on its grid or cannot be read is named in a note and left out: nobody asked for
//! it. A confidence that the configuration names must be usable.

use std::path::{Path, PathBuf};

use eval::CellOrigin;
use formats::raster::{Dem, read_dem};
use raster::Grid;

use super::error::EvalJobError;
use super::grid_config::GridEvalConfig;
use crate::surface_layer::{CONFIDENCE, FILLED_FLAGS, SIGMA, SOURCE};
use job::error_text::with_causes;

/// Layers on the grid of the test.
#[derive(Default)]
pub(crate) struct TestLayers {
    pub(crate) origins: Option<Grid<CellOrigin>>,
    pub(crate) sigma_m: Option<Grid<f32>>,
    pub(crate) confidence: Option<Grid<f32>>,
    /// The files that were read.
    pub(crate) names: Vec<String>,
}

impl TestLayers {
    /// Reads the layers of a test.
    pub(crate) fn read(config: &GridEvalConfig, test: &Dem, notes: &mut Vec<String>) -> Result<Self, EvalJobError> {
        let mut layers = Self::default();
        layers.confidence = match &config.confidence {
            Some(path) => {
                layers.names.push(path.display().to_string());
                Some(on_test_grid(path, test)?)
            }
            None => layers.beside(test, CONFIDENCE, notes),
        };
        layers.sigma_m = layers.beside(test, SIGMA, notes);
        layers.origins = match layers.beside(test, SOURCE, notes) {
            Some(codes) => Some(codes.map(|&code| origin(code, CellOrigin::from_source_code))),
            None => {
                let flags = layers.beside(test, FILLED_FLAGS, notes);
                flags.map(|flags| flags.map(|&flag| origin(flag, CellOrigin::from_filled_flag)))
            }
        };
        Ok(layers)
    }

    /// Reads a file beside the test if there is one that fits.
    fn beside(&mut self, test: &Dem, name: &str, notes: &mut Vec<String>) -> Option<Grid<f32>> {
        let path: PathBuf = test.path.with_file_name(name);
        if !path.is_file() || path == test.path {
            return None;
        }
        match on_test_grid(&path, test) {
            Ok(layer) => {
                self.names.push(path.display().to_string());
                Some(layer)
            }
            Err(error) => {
                notes.push(format!("a file beside the test is left out: {}", with_causes(&error)));
                None
            }
        }
    }
}

/// Returns the origin that a sample stands for. No-data (NaN) is a void.
fn origin(sample: f32, of_code: impl Fn(i32) -> CellOrigin) -> CellOrigin {
    if sample.is_finite() && sample.fract() == 0.0 { of_code(sample as i32) } else { CellOrigin::Void }
}

/// Reads a raster that must have the grid of the test.
fn on_test_grid(path: &Path, test: &Dem) -> Result<Grid<f32>, EvalJobError> {
    let found = read_dem(path)?;
    let size = |dem: &Dem| (dem.heights.width(), dem.heights.height());
    if size(&found) != size(test) || found.geotransform != test.geotransform {
        let grid = |dem: &Dem| format!("{:?} cells, geotransform {:?}", size(dem), dem.geotransform.0);
        return Err(EvalJobError::OtherGrid { path: path.to_owned(), found: grid(&found), expected: grid(test) });
    }
    Ok(found.heights)
}
