//! What a surface says of its cells: the layers that a DSM run writes beside `dsm.tif`.
//!
//! Filled cells are no evidence of the ground, and neither are cells whose height is hardly ever
//! right. The other layers are not needed: weak cells still show much ground.

use eval::CellOrigin;
use io::raster::Dem;
use raster::Grid;
use serde::Serialize;

use super::error::DtmError;
use crate::surface_layer::layer_beside;
use job::files::FileError;

/// Where each height comes from.
const SOURCE: &str = "source.tif";
/// Probability that each height is right.
const CONFIDENCE: &str = "confidence.tif";
/// Probability below which a cell is no evidence. Of such cells of two simulated scenes (hills and
/// random:9601), one in twenty showed the ground, and two in five lay metres below it.
const LEAST_CONFIDENCE: f32 = 0.1;

/// Layers that were found beside a surface, and what they say.
#[derive(Debug, Clone, Default, Serialize)]
#[non_exhaustive]
pub struct SurfaceLayers {
    /// Names of the files that were read.
    pub files: Vec<String>,
    /// Cells with a filled height.
    pub cells_filled: usize,
    /// Observed cells whose probability is too low to be evidence.
    pub cells_weak: usize,
}

impl SurfaceLayers {
    /// Says in one line which layers were read and what they changed.
    pub(crate) fn text(&self) -> String {
        if self.files.is_empty() {
            return "none beside the surface: every height counts as observed".to_owned();
        }
        let (filled, weak) = (self.cells_filled, self.cells_weak);
        format!("{}: {filled} filled and {weak} weak cells are no evidence of the ground", self.files.join(", "))
    }
}

/// Reads the layers beside a surface. Returns the cells that nothing has measured, if there are
/// layers.
///
/// # Errors
/// [`DtmError::Job`] for a layer that cannot be read. A layer of another size is not one of this
/// surface.
pub(crate) fn unobserved(surface: &Dem) -> Result<(Option<Grid<bool>>, SurfaceLayers), DtmError> {
    let mut layers = SurfaceLayers::default();
    let mut mask = surface.heights.map(|_| false);
    if let Some(source) = layer_beside(surface, SOURCE).map_err(FileError::write)? {
        layers.files.push(SOURCE.to_owned());
        for (mask, source) in mask.data_mut().iter_mut().zip(source.data()) {
            *mask = CellOrigin::from_source_code(*source as i32) == CellOrigin::Filled;
        }
        layers.cells_filled = mask.data().iter().filter(|is_filled| **is_filled).count();
    }
    if let Some(confidence) = layer_beside(surface, CONFIDENCE).map_err(FileError::write)? {
        layers.files.push(CONFIDENCE.to_owned());
        for (mask, confidence) in mask.data_mut().iter_mut().zip(confidence.data()) {
            if !*mask && (0.0..LEAST_CONFIDENCE).contains(confidence) {
                *mask = true;
                layers.cells_weak += 1;
            }
        }
    }
    Ok(((!layers.files.is_empty()).then_some(mask), layers))
}
