//! Which bands of an image make its luma: Rec. 601, `0.299 R + 0.587 G + 0.114 B`, on the stored
//! samples.

use gdal::Dataset;
use gdal::raster::ColorInterpretation;

/// The bands, counted from 1, that make one grey value.
#[derive(Debug, Clone, PartialEq, Eq)]
#[non_exhaustive]
pub enum LumaRule {
    /// A single band, unchanged.
    Single(usize),
    /// Rec. 601 luma of red, green and blue: the bands that the file names so, else the first three
    /// of three or four.
    Rgb([usize; 3]),
    /// The mean of bands without a known colour.
    Mean(Vec<usize>),
}

impl LumaRule {
    /// Picks the rule by the colours that the file gives to its bands; alpha bands are left out.
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

    /// The bands with their weights in the sum.
    pub(super) fn weights(&self) -> Vec<(usize, f32)> {
        match self {
            Self::Single(band) => vec![(*band, 1.0)],
            Self::Rgb([r, g, b]) => vec![(*r, 0.299), (*g, 0.587), (*b, 0.114)],
            Self::Mean(bands) => bands.iter().map(|&b| (b, 1.0 / bands.len() as f32)).collect(),
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
}
