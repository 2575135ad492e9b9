//! The ortho of a tile as an 8-bit picture.

use std::path::Path;

use io::raster::{ImageSource, LumaRule, RasterError, write_png_rgb};
use raster::Grid;

use super::error::TilesError;
use crate::files::FileError;
use crate::report_page::shown_range;

/// Writes red, green and blue of an ortho, or its first band as grey, and returns the values that
/// are black and white in each band. Cells without a value are black.
pub(super) fn write(ortho: &Path, picture: &Path) -> Result<Vec<[f32; 2]>, TilesError> {
    let source = ImageSource::open(ortho)?;
    let bands: Vec<usize> = match &source.info().luma {
        LumaRule::Rgb(bands) => bands.to_vec(),
        _ => vec![1],
    };
    let window = source.window();
    let read = |band: &usize| source.read_samples(*band, window);
    let values = bands.iter().map(read).collect::<Result<Vec<Grid<f32>>, RasterError>>()?;
    let ranges: Vec<[f32; 2]> = values.iter().map(|band| shown_range(band).into()).collect();
    let shown = |band: usize, cell: usize| {
        let ([low, high], value) = (ranges[band], values[band].data()[cell]);
        // Void cells are NaN, which becomes 0.
        (255.0 * (value - low) / (high - low).max(f32::MIN_POSITIVE)).round() as u8
    };
    let mut pixels = Grid::filled(window.width, window.height, [0u8; 3]);
    for (cell, pixel) in pixels.data_mut().iter_mut().enumerate() {
        *pixel = [0, 1, 2].map(|i| shown(i.min(bands.len() - 1), cell));
    }
    write_png_rgb(picture, &pixels, true).map_err(FileError::from)?;
    Ok(ranges)
}
