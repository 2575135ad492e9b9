//! Luma and flags of the pixels of an image.
//!
//! A pixel has no data when the file's no-data value, mask or alpha declares it void in every band
//! used, or when its luma is not finite. Samples of 0 that no metadata declares void are data. A
//! pixel is saturated when a used band is at the largest value of its type (or of NBITS) in all
//! pixels of some 2 × 2 block around it: a lone maximum is an ordinary bright pixel. The block
//! reaches one pixel past the window, so that flags do not depend on the tiling.

use raster::{FLAG_NO_DATA, FLAG_OUTSIDE, FLAG_SATURATED, Flags, Grid, Window};

use super::source::ImageSource;
use crate::raster::error::RasterError;

/// Luma and flags of a window.
#[derive(Debug, Clone, PartialEq)]
pub struct LumaTile {
    /// Values in the file's units. NaN for no-data and outside the image.
    pub luma: Grid<f32>,
    /// `raster::FLAG_NO_DATA`, `FLAG_OUTSIDE` or `FLAG_SATURATED` per pixel. Saturated pixels keep
    /// their value.
    pub flags: Flags,
}

impl ImageSource {
    /// Reads the luma of a window with the flags of each pixel. The window may reach outside the
    /// image. Nothing is resampled.
    ///
    /// See [`LumaRule`](crate::raster::LumaRule) for the bands and [`LumaTile`] for the flags.
    ///
    /// # Errors
    /// [`RasterError::Damaged`] when GDAL cannot decode the pixels.
    pub fn read_luma(&self, window: Window) -> Result<LumaTile, RasterError> {
        let mut tile = LumaTile {
            luma: Grid::filled(window.width, window.height, f32::NAN),
            flags: Grid::filled(window.width, window.height, FLAG_OUTSIDE),
        };
        // The saturation rule looks at 2 × 2 blocks, so one more pixel is read on each side.
        let Some(inside) = self.window().intersection(&window.grown(1)) else {
            return Ok(tile);
        };
        let (luma, flags) = read_inside(self, inside)?;
        let Some(shared) = inside.intersection(&window) else {
            return Ok(tile);
        };
        for y in shared.y..shared.y + shared.height as i64 {
            let (from, to) = ((y - inside.y) as usize, (y - window.y) as usize);
            let (a, b) = ((shared.x - inside.x) as usize, (shared.x - window.x) as usize);
            tile.luma.row_mut(to)[b..b + shared.width].copy_from_slice(&luma.row(from)[a..a + shared.width]);
            tile.flags.row_mut(to)[b..b + shared.width].copy_from_slice(&flags.row(from)[a..a + shared.width]);
        }
        Ok(tile)
    }
}

/// Reads luma and flags of a window inside the image.
fn read_inside(source: &ImageSource, inside: Window) -> Result<(Grid<f32>, Flags), RasterError> {
    let info = source.info();
    let maximum = info.sample.maximum(info.bits);
    let mut luma = Grid::filled(inside.width, inside.height, 0.0_f32);
    let mut flags = Grid::filled(inside.width, inside.height, FLAG_NO_DATA);
    for (band, weight) in info.luma.weights() {
        let values = source.read_band(band, inside)?;
        let mask = source.read_mask(band, inside)?;
        for (sum, &value) in luma.data_mut().iter_mut().zip(values.data()) {
            *sum += weight * value;
        }
        match &mask {
            None => flags.data_mut().iter_mut().for_each(|f| *f &= !FLAG_NO_DATA),
            Some(mask) => clear_where_valid(&mut flags, mask),
        }
        if let Some(maximum) = maximum {
            flag_plateaus(&values, maximum, &mut flags);
        }
    }
    for (value, flag) in luma.data_mut().iter_mut().zip(flags.data_mut()) {
        if !value.is_finite() {
            *flag |= FLAG_NO_DATA;
        }
        if *flag & FLAG_NO_DATA != 0 {
            *value = f32::NAN;
            *flag = FLAG_NO_DATA;
        }
    }
    Ok((luma, flags))
}

/// Clears the no-data flag where a band has data.
fn clear_where_valid(flags: &mut Flags, mask: &Grid<u8>) {
    for (flag, &valid) in flags.data_mut().iter_mut().zip(mask.data()) {
        if valid != 0 {
            *flag &= !FLAG_NO_DATA;
        }
    }
}

/// Flags the pixels of every 2 × 2 block whose four values are at the maximum.
fn flag_plateaus(values: &Grid<f32>, maximum: f32, flags: &mut Flags) {
    for row in 1..values.height() {
        let (above, below) = (values.row(row - 1), values.row(row));
        for column in 1..values.width() {
            let block = [above[column - 1], above[column], below[column - 1], below[column]];
            if block.iter().all(|&v| v >= maximum) {
                for (c, r) in [(column - 1, row - 1), (column, row - 1), (column - 1, row), (column, row)] {
                    flags[(c, r)] |= FLAG_SATURATED;
                }
            }
        }
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn a_lone_maximum_is_no_saturation() {
        let mut values = Grid::filled(6, 5, 10.0_f32);
        values[(1, 1)] = 255.0;
        for (c, r) in [(3, 2), (4, 2), (3, 3), (4, 3)] {
            values[(c, r)] = 255.0;
        }
        let mut flags = Grid::filled(6, 5, 0);
        flag_plateaus(&values, 255.0, &mut flags);
        assert_eq!(flags.data().iter().filter(|&&f| f == FLAG_SATURATED).count(), 4);
        assert_eq!(flags[(1, 1)], 0);
    }
}
