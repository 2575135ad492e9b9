//! One grey value per pixel, and the flags beside it.
//!
//! Luma is Rec. 601, `0.299 R + 0.587 G + 0.114 B`, on the stored samples. A pixel has no data when the file's
//! no-data value, mask or alpha says so in every band used, or when its value is no number; samples of 0 that no file
//! metadata declares void are data. A pixel is saturated when a used band is at the largest value of its type (or of
//! NBITS) in all pixels of some 2 × 2 block around it: a lone maximum is an ordinary bright pixel. The block looks one
//! pixel past the window, so that flags do not depend on the tiling.

use gdal::Dataset;
use gdal::raster::ColorInterpretation;
use raster::{FLAG_NO_DATA, FLAG_OUTSIDE, FLAG_SATURATED, Flags, Grid, Window};

use super::{ImageSource, RasterError};

/// How the bands (counted from 1) become one value.
#[derive(Debug, Clone, PartialEq, Eq)]
#[non_exhaustive]
pub enum LumaRule {
    /// A single band, as it is.
    Single(usize),
    /// Rec. 601 luma of red, green, blue: the bands so named, else the first three of three or four.
    Rgb([usize; 3]),
    /// The mean of bands that have no colour known to us.
    Mean(Vec<usize>),
}

impl LumaRule {
    pub(super) fn of(dataset: &Dataset) -> Self {
        let colours: Vec<_> = (1..=dataset.raster_count())
            .map(|i| dataset.rasterband(i).map_or(ColorInterpretation::Undefined, |b| b.color_interpretation()))
            .collect();
        Self::from_colours(&colours)
    }

    fn from_colours(colours: &[ColorInterpretation]) -> Self {
        use ColorInterpretation as Colour;
        let find = |wanted: Colour| colours.iter().position(|c| *c == wanted).map(|i| i + 1);
        let opaque: Vec<usize> = (1..=colours.len()).filter(|&i| colours[i - 1] != Colour::AlphaBand).collect();
        match (find(Colour::RedBand), find(Colour::GreenBand), find(Colour::BlueBand), opaque.as_slice()) {
            (Some(r), Some(g), Some(b), _) => Self::Rgb([r, g, b]),
            (.., [only]) => Self::Single(*only),
            (.., [r, g, b] | [r, g, b, _]) => Self::Rgb([*r, *g, *b]),
            (.., []) => Self::Single(1),
            (.., several) => Self::Mean(several.to_vec()),
        }
    }

    /// The bands with their weights.
    pub(super) fn weights(&self) -> Vec<(usize, f32)> {
        match self {
            Self::Single(band) => vec![(*band, 1.0)],
            Self::Rgb([r, g, b]) => vec![(*r, 0.299), (*g, 0.587), (*b, 0.114)],
            Self::Mean(bands) => bands.iter().map(|&b| (b, 1.0 / bands.len() as f32)).collect(),
        }
    }
}

/// Pixels of a window.
#[derive(Debug, Clone, PartialEq)]
pub struct LumaTile {
    /// Values in the file's own units; NaN where there is none (no-data or outside).
    pub luma: Grid<f32>,
    /// `raster::FLAG_NO_DATA`, `FLAG_OUTSIDE`, `FLAG_SATURATED` per pixel. Saturated pixels keep their value.
    pub flags: Flags,
}

pub(super) fn read(source: &ImageSource, window: Window) -> Result<LumaTile, RasterError> {
    let mut tile = LumaTile {
        luma: Grid::filled(window.width, window.height, f32::NAN),
        flags: Grid::filled(window.width, window.height, FLAG_OUTSIDE),
    };
    // One pixel more on each side, for the neighbourhood of the saturation rule.
    let Some(inside) = source.window().intersection(&window.grown(1)) else {
        return Ok(tile);
    };
    let (luma, flags) = read_inside(source, inside)?;
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

/// Luma and flags of a window inside the image.
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

fn clear_where_valid(flags: &mut Flags, mask: &Grid<u8>) {
    for (flag, &valid) in flags.data_mut().iter_mut().zip(mask.data()) {
        if valid != 0 {
            *flag &= !FLAG_NO_DATA;
        }
    }
}

/// Flags the pixels of every 2 × 2 block that is at the maximum throughout.
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
    use ColorInterpretation as C;

    #[test]
    fn bands_become_luma_by_colour_then_by_number() {
        assert_eq!(LumaRule::from_colours(&[C::GrayIndex]), LumaRule::Single(1));
        assert_eq!(LumaRule::from_colours(&[C::GrayIndex, C::AlphaBand]), LumaRule::Single(1));
        assert_eq!(LumaRule::from_colours(&[C::BlueBand, C::GreenBand, C::RedBand]), LumaRule::Rgb([3, 2, 1]));
        assert_eq!(LumaRule::from_colours(&[const { C::Undefined }; 4]), LumaRule::Rgb([1, 2, 3]));
        assert_eq!(
            LumaRule::from_colours(&[C::AlphaBand, C::Undefined, C::Undefined, C::Undefined]),
            LumaRule::Rgb([2, 3, 4])
        );
        assert_eq!(LumaRule::from_colours(&[const { C::Undefined }; 2]), LumaRule::Mean(vec![1, 2]));
    }

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
