//! What a surface says of its cells, as far as classes go: which heights were not observed, and
//! which are rather wrong than right.

use formats::raster::Dem;
use raster::Grid;
use serde::Serialize;

use super::error::ClassesError;
use crate::surface_layer::{self, NO_LAYERS};
use job::files::FileError;

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
            return NO_LAYERS.to_owned();
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
    let found = surface_layer::weak_cells(surface, LEAST_CONFIDENCE).map_err(FileError::write)?;
    let cells_filled = found.filled_count();
    let layers = ClassLayers { files: found.files, cells_filled, cells_doubtful: found.doubtful };
    Ok((found.mask, layers))
}
