//! Red, green and blue of an image, as f32 in the file's own units.
//!
//! Bands are chosen as for luma ([`LumaRule`]): those named red, green and blue, else the first three; a single band is all three, and
//! bands of no known colour become their mean. A pixel that a used band has no value for is NaN in all three.

use raster::{Grid, Window};

use super::{ImageSource, LumaRule, RasterError};

pub(super) fn read(source: &ImageSource, window: Window) -> Result<Grid<[f32; 3]>, RasterError> {
    let bands: Vec<(usize, [f32; 3])> = match &source.info().luma {
        LumaRule::Rgb([r, g, b]) => vec![(*r, [1.0, 0.0, 0.0]), (*g, [0.0, 1.0, 0.0]), (*b, [0.0, 0.0, 1.0])],
        rule => rule.weights().into_iter().map(|(band, weight)| (band, [weight; 3])).collect(),
    };
    let mut colours = Grid::filled(window.width, window.height, [0.0f32; 3]);
    for (band, weights) in bands {
        let samples = source.read_samples(band, window)?;
        for (colour, &sample) in colours.data_mut().iter_mut().zip(samples.data()) {
            // A sample that is NaN makes all three NaN: 0 · NaN is NaN.
            colour.iter_mut().zip(weights).for_each(|(sum, weight)| *sum += weight * sample);
        }
    }
    Ok(colours)
}
