//! Red, green and blue of an image, as f32 in the file's units.
//!
//! The bands are chosen as for luma ([`LumaRule`]): the bands that the file names red, green and
//! blue, else the first three. A single band gives all three colours, and bands without a known
//! colour give their mean. A pixel without data in a used band is NaN in all three.

use raster::{Grid, Window};

use super::luma_rule::LumaRule;
use super::source::ImageSource;
use crate::raster::error::RasterError;

impl ImageSource {
    /// Reads red, green and blue of a window, which may reach outside the image. NaN marks no-data
    /// and the outside.
    ///
    /// # Errors
    /// [`RasterError::Damaged`] when GDAL cannot decode the pixels.
    pub fn read_colour(&self, window: Window) -> Result<Grid<[f32; 3]>, RasterError> {
        let bands: Vec<(usize, [f32; 3])> = match &self.info().luma {
            LumaRule::Rgb([r, g, b]) => vec![(*r, [1.0, 0.0, 0.0]), (*g, [0.0, 1.0, 0.0]), (*b, [0.0, 0.0, 1.0])],
            rule => rule.weights().into_iter().map(|(band, weight)| (band, [weight; 3])).collect(),
        };
        let mut colours = Grid::filled(window.width, window.height, [0.0f32; 3]);
        for (band, weights) in bands {
            let samples = self.read_samples(band, window)?;
            for (colour, &sample) in colours.data_mut().iter_mut().zip(samples.data()) {
                // A NaN sample makes all three NaN, because 0 · NaN is NaN.
                colour.iter_mut().zip(weights).for_each(|(sum, weight)| *sum += weight * sample);
            }
        }
        Ok(colours)
    }
}
