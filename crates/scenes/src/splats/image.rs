//! Reading a satellite image with its camera.

use std::path::Path;

use camera::RpcCamera;
use formats::raster::{ImageSource, RasterError};
use numeric::Progress;
use raster::Grid;

use super::error::SplatsJobError;
use job::corrections::Corrections;

/// An image with its camera.
pub(super) struct ColourImage {
    pub(super) camera: RpcCamera,
    /// Red, green and blue in the image's own units.
    pub(super) pixels: Grid<[f32; 3]>,
}

/// Reads an image and the RPC inside or beside it.
pub(super) fn read(
    path: &Path,
    corrections: &Corrections,
    progress: &dyn Progress,
) -> Result<ColourImage, SplatsJobError> {
    Ok(ColourImage { camera: corrections.camera(path, progress)?, pixels: read_pixels(path)? })
}

/// Reads the colours of a picture in its own units.
pub(super) fn read_pixels(path: &Path) -> Result<Grid<[f32; 3]>, RasterError> {
    let source = ImageSource::open(path)?;
    source.read_colour(source.window())
}
