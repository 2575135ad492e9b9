//! Writing pictures for people: 8-bit PNG, grey or RGB.

use std::path::Path;

use image::codecs::png::PngEncoder;
use image::{ExtendedColorType, ImageEncoder};
use raster::Grid;

use crate::atomic::write_bytes;
use crate::raster::error::RasterError;

/// Writes a grey picture.
///
/// # Errors
/// [`RasterError::NotWritten`] for a file that exists without `overwrite`, for a picture without
/// pixels, and when the system refuses.
pub fn write_png_gray(path: impl AsRef<Path>, picture: &Grid<u8>, overwrite: bool) -> Result<(), RasterError> {
    write(path.as_ref(), picture.data(), picture.width(), picture.height(), ExtendedColorType::L8, overwrite)
}

/// Writes a colour picture. Pixels are red, green, blue.
///
/// # Errors
/// [`RasterError::NotWritten`] for a file that exists without `overwrite`, for a picture without
/// pixels, and when the system refuses.
pub fn write_png_rgb(path: impl AsRef<Path>, picture: &Grid<[u8; 3]>, overwrite: bool) -> Result<(), RasterError> {
    let bytes = picture.data().as_flattened();
    write(path.as_ref(), bytes, picture.width(), picture.height(), ExtendedColorType::Rgb8, overwrite)
}

/// Writes a colour picture with an alpha band. Pixels are red, green, blue, opacity.
///
/// # Errors
/// As [`write_png_rgb`].
pub fn write_png_rgba(path: impl AsRef<Path>, picture: &Grid<[u8; 4]>, overwrite: bool) -> Result<(), RasterError> {
    let bytes = picture.data().as_flattened();
    write(path.as_ref(), bytes, picture.width(), picture.height(), ExtendedColorType::Rgba8, overwrite)
}

fn write(
    path: &Path,
    bytes: &[u8],
    width: usize,
    height: usize,
    colour: ExtendedColorType,
    overwrite: bool,
) -> Result<(), RasterError> {
    let too_large =
        |_| RasterError::unwritable(path, "the picture is too large, expected at most 2^32 - 1 columns and rows");
    let (width, height) = (u32::try_from(width).map_err(too_large)?, u32::try_from(height).map_err(too_large)?);
    if width == 0 || height == 0 {
        return Err(RasterError::unwritable(path, "the picture has no pixels, expected at least one column and row"));
    }
    let mut encoded = Vec::new();
    PngEncoder::new(&mut encoded)
        .write_image(bytes, width, height, colour)
        .map_err(|error| RasterError::unwritable(path, error))?;
    Ok(write_bytes(path, &encoded, overwrite)?)
}
