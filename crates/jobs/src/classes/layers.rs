//! What a surface says of its cells, as far as classes go: which heights were not observed, and
//! which are rather wrong than right.

use eval::CellOrigin;
use io::raster::Dem;
use raster::Grid;
use serde::Serialize;

use super::error::ClassesError;
use crate::files::FileError;
use crate::surface_layer::layer_beside;

/// Where each height comes from, and the probability that it is right.
const SOURCE: &str = "source.tif";
const CONFIDENCE: &str = "confidence.tif";
/// Probability below which a height is rather wrong than right.
const LEAST_CONFIDENCE: f32 = 0.5;

/// Layers that were found beside a surface, and what they say to the classes.
#[derive(Debug, Clone, Default, Serialize)]
#[non_exhaustive]
pub struct ClassLayers {
    /// Names of the files that were read.
    pub files: Vec<String>,
    /// Cells with a filled height.
    pub cells_filled: usize,
    /// Observed cells whose height is rather wrong than right.
    pub cells_doubtful: usize,
}

impl ClassLayers {
    /// Says in one line which layers were read and what they changed.
    pub(crate) fn text(&self) -> String {
        if self.files.is_empty() {
            return "none beside the surface: every height counts as observed".to_owned();
        }
        let (filled, doubtful) = (self.cells_filled, self.cells_doubtful);
        format!("{}: {filled} filled and {doubtful} doubtful cells bound no building", self.files.join(", "))
    }
}

/// Reads the layers beside a surface. Returns the cells whose heights bound no building, if there
/// are layers.
///
/// # Errors
/// [`ClassesError::Job`] for a layer that cannot be read. A layer of another size is not one of
/// this surface.
pub(super) fn weak_cells(surface: &Dem) -> Result<(Option<Grid<bool>>, ClassLayers), ClassesError> {
    let mut layers = ClassLayers::default();
    let mut weak = surface.heights.map(|_| false);
    if let Some(source) = layer_beside(surface, SOURCE).map_err(FileError::write)? {
        layers.files.push(SOURCE.to_owned());
        for (weak, source) in weak.data_mut().iter_mut().zip(source.data()) {
            *weak = CellOrigin::from_source_code(*source as i32) == CellOrigin::Filled;
        }
        layers.cells_filled = weak.data().iter().filter(|is_filled| **is_filled).count();
    }
    if let Some(confidence) = layer_beside(surface, CONFIDENCE).map_err(FileError::write)? {
        layers.files.push(CONFIDENCE.to_owned());
        for (weak, confidence) in weak.data_mut().iter_mut().zip(confidence.data()) {
            if !*weak && (0.0..LEAST_CONFIDENCE).contains(confidence) {
                *weak = true;
                layers.cells_doubtful += 1;
            }
        }
    }
    Ok(((!layers.files.is_empty()).then_some(weak), layers))
}
