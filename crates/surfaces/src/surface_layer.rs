//! Layers that lie beside a surface model, on its cells.

use io::raster::{Dem, ImageSource, RasterError};
use raster::Grid;

/// Value of `filled` in a cell with an observed height.
pub const OBSERVED: u8 = 0;
/// Value of `filled` in a cell that was filled.
pub const FILLED: u8 = 1;
/// Value of `filled` in a cell without a height.
pub const VOID: u8 = 255;

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
