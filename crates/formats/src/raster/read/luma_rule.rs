//! Which bands of an image make its luma: one that is asked for, or Rec. 601,
//! `0.299 R + 0.587 G + 0.114 B`, on the stored samples.

use std::fmt;
use std::str::FromStr;

use gdal::raster::ColorInterpretation;
use gdal::{Dataset, Metadata};
use serde::{Deserialize, Serialize};

use super::band_colour::{colour_name, colour_of};

/// A band of an image, as people name it.
///
/// ```
/// use formats::raster::BandChoice;
///
/// assert_eq!("2".parse(), Ok(BandChoice::Number(2)));
/// assert_eq!("nir".parse(), Ok(BandChoice::Name("nir".to_owned())));
/// ```
#[derive(Debug, Clone, PartialEq, Eq, Serialize, Deserialize)]
#[serde(untagged)]
pub enum BandChoice {
    /// Position, counted from 1.
    Number(usize),
    /// The band's description or its colour, in upper or lower case.
    Name(String),
}

impl FromStr for BandChoice {
    type Err = std::convert::Infallible;

    fn from_str(text: &str) -> Result<Self, Self::Err> {
        let text = text.trim();
        Ok(text.parse().map_or_else(|_| Self::Name(text.to_owned()), Self::Number))
    }
}

impl fmt::Display for BandChoice {
    fn fmt(&self, f: &mut fmt::Formatter<'_>) -> fmt::Result {
        match self {
            Self::Number(number) => write!(f, "{number}"),
            Self::Name(name) => write!(f, "{name:?}"),
        }
    }
}

impl BandChoice {
    /// Returns the position of the band among the names of the bands, counted from 1.
    pub(in crate::raster) fn position(&self, bands: &[Vec<String>]) -> Option<usize> {
        match self {
            Self::Number(number) => (1..=bands.len()).contains(number).then_some(*number),
            Self::Name(name) => {
                let named = |names: &Vec<String>| names.iter().any(|own| own.eq_ignore_ascii_case(name));
                bands.iter().position(named).map(|i| i + 1)
            }
        }
    }
}

/// Returns the names that the bands of a file have: descriptions and colours.
pub(in crate::raster) fn band_names(dataset: &Dataset) -> Vec<Vec<String>> {
    let names = |i| {
        let Ok(band) = dataset.rasterband(i) else { return Vec::new() };
        [band.description().ok(), colour_name(&band)].into_iter().flatten().filter(|name| !name.is_empty()).collect()
    };
    (1..=dataset.raster_count()).map(names).collect()
}

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
    pub(in crate::raster) fn of(dataset: &Dataset) -> Self {
        let colours: Vec<_> = (1..=dataset.raster_count())
            .map(|i| dataset.rasterband(i).map_or(ColorInterpretation::Undefined, |band| colour_of(&band)))
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
    pub(in crate::raster) fn weights(&self) -> Vec<(usize, f32)> {
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
    fn bands_have_numbers_and_names() {
        let bands = [vec!["PAN".to_owned(), "Gray".to_owned()], vec![], vec!["Near infrared".to_owned()]];
        let position = |choice: &str| choice.parse::<BandChoice>().unwrap().position(&bands);
        assert_eq!(["pan", "gray", "near INFRARED", "2"].map(position), [Some(1), Some(1), Some(3), Some(2)]);
        assert_eq!(["0", "4", "nir", ""].map(position), [None; 4]);
    }

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
