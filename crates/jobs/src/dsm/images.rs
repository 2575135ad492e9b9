//! The images of a run with their cameras, and how their pixels are read.

use std::path::PathBuf;

use camera::{ImagePoint, RpcCamera};
use raster::{Grid, Window};
use rayon::prelude::*;
use serde::{Deserialize, Serialize};
use sweep::SweepView;

use crate::dsm::error::DsmError;

/// Side of a square of zeros that the dark noise of no sensor leaves, pixels.
const BLACK_SIDE: usize = 5;

/// An image file with its camera.
#[derive(Debug, Clone, PartialEq, Serialize, Deserialize)]
#[serde(deny_unknown_fields)]
#[non_exhaustive]
pub struct SceneImage {
    /// File of the image.
    pub path: PathBuf,
    /// Position at which the image was given, counted from 0.
    pub number: usize,
    /// Name of the format in which the RPC was found.
    pub rpc_format: String,
    /// Camera in the frame of the whole image.
    pub camera: RpcCamera,
    /// Width and height, pixels.
    pub size: (usize, usize),
    /// When the image was taken, seconds of UTC since 1970; `None` where the file does not say.
    pub acquired_s: Option<i64>,
    /// Factor of the grey values, a power of two: 1 unless a float image has a scale of its own,
    /// such as reflectances from 0 to 1. Noise and texture are then measured in numbers like those
    /// of sensors.
    pub gain: f32,
}

impl SceneImage {
    /// Returns the window of the whole image.
    pub(crate) const fn whole(&self) -> Window {
        Window::whole(self.size.0, self.size.1)
    }

    /// Returns the camera in the frame of a window.
    fn camera_of(&self, window: Window) -> RpcCamera {
        self.camera.cropped(ImagePoint::new(window.x as f64, window.y as f64))
    }
}

/// Reads a window of an image with its pyramid. The camera of the view is that of the window.
pub(crate) fn read_view(image: &SceneImage, window: Window) -> Result<SweepView, DsmError> {
    let source = io::raster::ImageSource::open(&image.path)?;
    let mut pixels = source.read_luma(window)?.luma;
    mask_black(&mut pixels);
    scale(&mut pixels, image.gain);
    Ok(SweepView::new(image.camera_of(window), pixels))
}

/// Reads one pyramid level of a window, whose first pixel must be the corner of a pixel of that
/// level. The camera of the view is that of the window at full resolution.
pub(crate) fn read_coarse_view(image: &SceneImage, window: Window, level: usize) -> Result<SweepView, DsmError> {
    let source = io::raster::ImageSource::open(&image.path)?;
    let mut pixels = source.read_luma(window)?.luma;
    mask_black(&mut pixels);
    scale(&mut pixels, image.gain);
    for _ in 0..level {
        pixels = raster::reduce(&pixels);
    }
    Ok(SweepView::from_level(image.camera_of(window), level, pixels))
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

fn scale(pixels: &mut Grid<f32>, gain: f32) {
    if gain != 1.0 {
        pixels.data_mut().iter_mut().for_each(|value| *value *= gain);
    }
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
