//! How the pixels of a run's images are read: the band that is matched, without masked pixels.

use std::path::Path;

use formats::raster::{BandChoice, ImageSource, RasterError};
use raster::{Grid, Window};
use rayon::prelude::*;
use sweep::SweepView;

use crate::error::DsmError;
use crate::images::image_mask::void_masked;
use crate::images::scene_image::SceneImage;

/// Side of a square of zeros that the dark noise of no sensor leaves, pixels.
const BLACK_SIDE: usize = 5;

/// Reads a window of an image with its pyramid. The camera of the view is that of the window.
pub(crate) fn read_view(image: &SceneImage, window: Window) -> Result<SweepView, DsmError> {
    Ok(SweepView::new(image.camera_of(window), read_pixels(image, window)?).beginning_at(first_of(window)))
}

/// Reads one pyramid level of a window, whose first pixel must be the corner of a pixel of that
/// level. The camera of the view is that of the window at full resolution.
pub(crate) fn read_coarse_view(image: &SceneImage, window: Window, level: usize) -> Result<SweepView, DsmError> {
    let mut pixels = read_pixels(image, window)?;
    for _ in 0..level {
        pixels = raster::reduce(&pixels);
    }
    Ok(SweepView::from_level(image.camera_of(window), level, pixels).beginning_at(first_of(window)))
}

/// Returns the column and row of an image at which a window begins.
fn first_of(window: Window) -> [usize; 2] {
    [window.x, window.y].map(|at| usize::try_from(at).unwrap_or(0))
}

/// Reads whole images, in parallel. `done` is called after each image.
pub(crate) fn read_views(images: &[SceneImage], done: &(dyn Fn() + Sync)) -> Result<Vec<SweepView>, DsmError> {
    let read = |image: &SceneImage| {
        let view = read_view(image, image.whole());
        done();
        view
    };
    images.par_iter().map(read).collect()
}

/// Opens an image with the band that is matched as its luma.
///
/// # Errors
/// As [`ImageSource::open`] and [`ImageSource::with_band`].
pub(crate) fn open_source(path: &Path, band: Option<&BandChoice>) -> Result<ImageSource, RasterError> {
    let source = ImageSource::open(path)?;
    match band {
        Some(band) => source.with_band(band),
        None => Ok(source),
    }
}

/// Reads the values that are matched. NaN marks what is not.
fn read_pixels(image: &SceneImage, window: Window) -> Result<Grid<f32>, DsmError> {
    let source = open_source(&image.path, image.band.map(BandChoice::Number).as_ref())?;
    let mut pixels = source.read_luma(window)?.luma;
    mask_black(&mut pixels);
    void_masked(image, window, &mut pixels)?;
    if image.gain != 1.0 {
        pixels.data_mut().iter_mut().for_each(|value| *value *= image.gain);
    }
    Ok(pixels)
}

/// Sets squares of zeros to NaN. They are voids that the file does not declare, and would be
/// compared with what the other views see.
fn mask_black(image: &mut Grid<f32>) {
    let (w, h) = (image.width(), image.height());
    let mut runs = vec![0usize; w];
    let mut squares = Vec::new();
    for y in 0..h {
        let mut columns = 0;
        for (x, run) in runs.iter_mut().enumerate() {
            *run = if image[(x, y)] == 0.0 { *run + 1 } else { 0 };
            columns = if *run >= BLACK_SIDE { columns + 1 } else { 0 };
            if columns >= BLACK_SIDE {
                squares.push((x + 1 - BLACK_SIDE, y + 1 - BLACK_SIDE));
            }
        }
    }
    for (x, y) in squares {
        (y..y + BLACK_SIDE).for_each(|v| image.row_mut(v)[x..x + BLACK_SIDE].fill(f32::NAN));
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn black_squares_are_voids_and_dark_pixels_are_not() {
        let mut image = Grid::filled(30, 20, 0.0f32);
        for (i, v) in image.data_mut().iter_mut().enumerate().filter(|(i, _)| i % 30 >= 12) {
            *v = if i % 3 == 1 { 0.0 } else { 4.0 };
        }
        mask_black(&mut image);
        let voids = |from: usize, to: usize| {
            (0..20).flat_map(|y| (from..to).map(move |x| (x, y))).filter(|p| image[*p].is_nan()).count()
        };
        assert_eq!((voids(0, 12), voids(12, 30)), (240, 0));
    }
}
