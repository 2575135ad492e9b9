//! Grids as pictures: reliefs, error maps, PNG.
//!
//! A grid that is larger than a page needs is first reduced by factors of two (means over valid
//! cells).

use std::io::Cursor;

use image::{ExtendedColorType, ImageFormat};
use raster::{Grid, Light, reduce};

use crate::base64;
use crate::palette::{MISSING, OUTSIDE, diverging};

/// Longest side of a picture in a page, pixels.
const LONGEST_SIDE: usize = 1000;

/// A picture cannot be made.
#[derive(Debug, thiserror::Error)]
#[non_exhaustive]
#[error("cannot make a picture of {width} x {height} pixels ({reason}): leave the pictures out")]
pub struct PictureError {
    /// Number of columns.
    pub width: usize,
    /// Number of rows.
    pub height: usize,
    /// Message of the encoder.
    pub reason: String,
}

/// Encodes a picture (red, green, blue) as PNG.
///
/// ```
/// let bytes = report::png(&raster::Grid::filled(4, 3, [255, 0, 0]))?;
/// assert_eq!(&bytes[1..4], b"PNG");
/// # Ok::<(), report::PictureError>(())
/// ```
///
/// # Errors
/// [`PictureError`] if the picture has no pixels or is larger than PNG allows.
pub fn png(picture: &Grid<[u8; 3]>) -> Result<Vec<u8>, PictureError> {
    encoded(picture.data().as_flattened(), (picture.width(), picture.height()), ExtendedColorType::Rgb8)
}

/// Encodes a picture (red, green, blue, opacity) as PNG.
///
/// # Errors
/// As [`png`].
pub fn png_with_alpha(picture: &Grid<[u8; 4]>) -> Result<Vec<u8>, PictureError> {
    encoded(picture.data().as_flattened(), (picture.width(), picture.height()), ExtendedColorType::Rgba8)
}

fn encoded(pixels: &[u8], (width, height): (usize, usize), colour: ExtendedColorType) -> Result<Vec<u8>, PictureError> {
    let failed = |reason: String| PictureError { width, height, reason };
    let side = |side: usize| u32::try_from(side).ok().filter(|&s| s > 0).ok_or_else(|| failed("its size".to_owned()));
    let (columns, rows) = (side(width)?, side(height)?);
    let mut bytes = Cursor::new(Vec::new());
    image::write_buffer_with_format(&mut bytes, pixels, columns, rows, colour, ImageFormat::Png)
        .map_err(|error| failed(error.to_string()))?;
    Ok(bytes.into_inner())
}

/// Returns a picture as a data URI.
pub(crate) fn data_uri(picture: &Grid<[u8; 3]>) -> Result<String, PictureError> {
    Ok(format!("data:image/png;base64,{}", base64::encode(&png(picture)?)))
}

/// Returns a picture of grey values with opacities as a data URI.
pub(crate) fn grey_alpha_uri(picture: &Grid<[u8; 2]>) -> Result<String, PictureError> {
    let size = (picture.width(), picture.height());
    let bytes = encoded(picture.data().as_flattened(), size, ExtendedColorType::La8)?;
    Ok(format!("data:image/png;base64,{}", base64::encode(&bytes)))
}

/// Colours the errors with a diverging palette over ±`range_m`. Cells without an error are voids of
/// the test if `reference` has a height there, and outside otherwise.
pub fn error_picture(errors: &Grid<f32>, reference: &Grid<f32>, range_m: f64) -> Grid<[u8; 3]> {
    let colours = errors.data().iter().zip(reference.data()).map(|(&error, &height)| {
        if error.is_finite() {
            diverging(f64::from(error) / range_m)
        } else if height.is_finite() {
            MISSING
        } else {
            OUTSIDE
        }
    });
    Grid::from_vec(errors.width(), errors.height(), colours.collect()).unwrap_or_else(|| Grid::filled(0, 0, OUTSIDE))
}

/// Reduces the grid until it fits a page.
pub(crate) fn fitted(grid: &Grid<f32>) -> Grid<f32> {
    let mut fitted = grid.clone();
    while fitted.width().max(fitted.height()) > LONGEST_SIDE {
        fitted = reduce(&fitted);
    }
    fitted
}

/// Returns a coloured relief over the heights from `low` to `high`. `cell_m` is the size of the
/// cells before `fitted` reduced them.
pub(crate) fn relief(
    heights: &Grid<f32>,
    full_width: usize,
    cell_m: (f64, f64),
    (low, high): (f32, f32),
) -> Grid<[u8; 3]> {
    let scale = (full_width as f64 / heights.width().max(1) as f64).log2().round().exp2();
    let shade = raster::hillshade(heights, (cell_m.0 * scale, cell_m.1 * scale), Light::default());
    raster::coloured_relief(heights, &shade, low, high)
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn a_png_is_read_back_pixel_by_pixel() {
        let picture = Grid::from_vec(2, 1, vec![[1, 2, 3], [250, 0, 9]]).unwrap();
        let decoded = image::load_from_memory(&png(&picture).unwrap()).unwrap().to_rgb8();
        assert_eq!(decoded.as_raw(), &[1, 2, 3, 250, 0, 9]);
        assert!(png(&Grid::filled(0, 3, [0; 3])).unwrap_err().to_string().contains("0 x 3"));
    }

    #[test]
    fn voids_of_the_test_differ_from_what_is_not_evaluated() {
        let errors = Grid::from_vec(3, 1, vec![0.0, f32::NAN, f32::NAN]).unwrap();
        let reference = Grid::from_vec(3, 1, vec![5.0, 5.0, f32::NAN]).unwrap();
        assert_eq!(error_picture(&errors, &reference, 1.0).data(), [diverging(0.0), MISSING, OUTSIDE]);
    }

    #[test]
    fn large_grids_are_reduced_to_a_page() {
        let fitted = fitted(&Grid::filled(2500, 3, 1.5f32));
        assert_eq!((fitted.width(), fitted.data()[0]), (625, 1.5));
        assert_eq!(relief(&fitted, 2500, (0.5, 0.5), (1.0, 2.0)).width(), 625);
    }
}
