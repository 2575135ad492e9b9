//! Layers that lie beside a surface model, on its cells.

use eval::CellOrigin;
use formats::raster::{Dem, ImageSource, RasterError};
use raster::Grid;

/// Where each height comes from.
pub(crate) const SOURCE: &str = "source.tif";
/// Whether each height was filled.
pub(crate) const FILLED_FLAGS: &str = "filled.tif";
/// Standard error of each height, metres.
pub(crate) const SIGMA: &str = "sigma.tif";
/// Probability that each height is right.
pub(crate) const CONFIDENCE: &str = "confidence.tif";
/// What a report says of a surface without layers.
pub(crate) const NO_LAYERS: &str = "none beside the surface: every height counts as observed";

/// Cells whose heights are weak evidence.
#[derive(Debug)]
pub(crate) struct WeakCells {
    /// The cells; `None` where no layer lies beside the surface.
    pub(crate) mask: Option<Grid<bool>>,
    /// Names of the layers that were read.
    pub(crate) files: Vec<String>,
    /// Cells with a filled height.
    pub(crate) filled: Grid<bool>,
    /// Other cells whose probability is below the wanted one.
    pub(crate) doubtful: usize,
}

impl WeakCells {
    /// Returns the number of cells with a filled height.
    pub(crate) fn filled_count(&self) -> usize {
        self.filled.data().iter().filter(|is_filled| **is_filled).count()
    }
}

/// Returns the cells of which a layer beside the surface says that their height was filled, or that
/// it is right with a probability below `least_confidence`. A layer of another size is not one of
/// this surface.
pub(crate) fn weak_cells(surface: &Dem, least_confidence: f32) -> Result<WeakCells, RasterError> {
    let mut filled = surface.heights.map(|_| false);
    let (mut files, mut doubtful) = (Vec::new(), 0);
    if let Some(source) = layer_beside(surface, SOURCE)? {
        files.push(SOURCE.to_owned());
        filled = source.map(|source| CellOrigin::from_source_code(*source as i32) == CellOrigin::Filled);
    }
    let mut mask = filled.clone();
    if let Some(confidence) = layer_beside(surface, CONFIDENCE)? {
        files.push(CONFIDENCE.to_owned());
        for (is_weak, confidence) in mask.data_mut().iter_mut().zip(confidence.data()) {
            if !*is_weak && (0.0..least_confidence).contains(confidence) {
                *is_weak = true;
                doubtful += 1;
            }
        }
    }
    Ok(WeakCells { mask: (!files.is_empty()).then_some(mask), files, filled, doubtful })
}

/// Reads a raster beside a surface; `None` where there is none of its size.
pub(crate) fn layer_beside(surface: &Dem, name: &str) -> Result<Option<Grid<f32>>, RasterError> {
    let path = surface.path.with_file_name(name);
    if !path.is_file() {
        return Ok(None);
    }
    let source = ImageSource::open(&path)?;
    let size = (surface.heights.width(), surface.heights.height());
    if (source.info().width, source.info().height) != size {
        return Ok(None);
    }
    source.read_samples(1, source.window()).map(Some)
}
