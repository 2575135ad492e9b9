//! How a raster is drawn on a map: hillshades, coloured heights, ramps, classes, marks, images.
//!
//! Cells without a value are transparent, so that maps can lie above each other. Every style has a
//! legend with the same colours.

use raster::{Grid, Light, coloured_relief, hillshade, relief_colour};
use serde::Serialize;

use crate::palette::{css, diverging};
use crate::preview::near_to_far;

/// Number of colours of a ramp in a legend.
const STOPS: usize = 9;
/// Colour of marked cells.
const MARK: [u8; 3] = [214, 39, 110];
/// Colours of classes, which also readers who cannot tell red from green can tell apart (after
/// Okabe and Ito), and lighter forms of them.
const CLASS_COLOURS: [[u8; 3]; 12] = [
    [86, 180, 233],
    [230, 159, 0],
    [0, 158, 115],
    [204, 121, 167],
    [0, 114, 178],
    [213, 94, 0],
    [240, 228, 66],
    [120, 120, 128],
    [170, 214, 240],
    [245, 205, 130],
    [140, 210, 190],
    [90, 60, 110],
];
/// Colour of the class that is as it should be: observed, seen, the ground.
const PLAIN_CLASS: [u8; 3] = [206, 213, 206];

/// Colours of a ramp.
#[derive(Debug, Clone, Copy, PartialEq, Eq)]
#[non_exhaustive]
pub enum RampColours {
    /// Light for low values, dark for high ones.
    DarkIsHigh,
    /// Dark for low values, light for high ones.
    LightIsHigh,
    /// Blue below the middle of the range, red above.
    Diverging,
    /// Black to white.
    Grey,
}

/// A value of a raster that stands for a class.
#[derive(Debug, Clone, PartialEq, Eq, Serialize)]
pub struct MapClass {
    /// The value.
    pub code: i64,
    /// The meaning of the value.
    pub label: String,
    /// Red, green, blue.
    pub colour: [u8; 3],
}

/// How a raster is drawn.
#[derive(Debug, Clone, PartialEq)]
#[non_exhaustive]
pub enum MapStyle {
    /// Heights in the light of the north-west, grey.
    Hillshade,
    /// Heights in the colours of a map, shaded.
    Relief {
        /// Height of the first colour, metres.
        low: f32,
        /// Height of the last colour, metres.
        high: f32,
    },
    /// Values in the colours of a ramp.
    Ramp {
        /// Value of the first colour.
        low: f32,
        /// Value of the last colour.
        high: f32,
        /// The colours.
        colours: RampColours,
    },
    /// One colour for each value.
    Classes(Vec<MapClass>),
    /// One colour over the cells of one value, nothing elsewhere. The page hatches them in the
    /// resolution of the screen.
    Marked {
        /// The value.
        code: i64,
    },
    /// Red, green and blue.
    Picture {
        /// Value of black.
        low: f32,
        /// Value of full brightness.
        high: f32,
    },
}

/// The legend of a map.
#[derive(Debug, Clone, PartialEq, Serialize)]
#[serde(tag = "kind", rename_all = "snake_case")]
#[non_exhaustive]
pub enum MapLegend {
    /// A bar of colours at evenly spaced values.
    Ramp {
        /// Value of the first colour.
        low: f32,
        /// Value of the last colour.
        high: f32,
        /// Colours for CSS.
        colours: Vec<String>,
    },
    /// Classes with their colours.
    Classes {
        /// The classes.
        classes: Vec<MapClass>,
    },
    /// Marked cells.
    Marked {
        /// Colour for CSS.
        colour: String,
    },
    /// Nothing to explain.
    None,
}

impl MapClass {
    /// Reads the classes that a description of a band names, such as `0_void_1_observed`; `None`
    /// for other descriptions.
    ///
    /// ```
    /// let classes = report::MapClass::in_description("0_seen_1_hidden_255_no_height").unwrap();
    /// assert_eq!((classes[2].code, classes[2].label.as_str()), (255, "no height"));
    /// assert_eq!(report::MapClass::in_description("height_m"), None);
    /// ```
    pub fn in_description(description: &str) -> Option<Vec<Self>> {
        let mut named: Vec<(i64, Vec<&str>)> = Vec::new();
        for word in description.split('_') {
            match (word.parse(), named.last_mut()) {
                (Ok(code), _) => named.push((code, Vec::new())),
                (Err(_), Some((_, words))) => words.push(word),
                (Err(_), None) => return None,
            }
        }
        if named.len() < 2 || named.iter().any(|(_, words)| words.is_empty()) {
            return None;
        }
        named.sort_unstable_by_key(|(code, _)| *code);
        Some(Self::coloured(named.into_iter().map(|(code, words)| (code, words.join(" ")))))
    }

    /// Gives colours to classes.
    pub fn coloured(named: impl IntoIterator<Item = (i64, String)>) -> Vec<Self> {
        let mut colours = CLASS_COLOURS.iter().cycle();
        let mut colour = |label: &str| match label.split(' ').next() {
            Some("observed" | "seen" | "ground") => PLAIN_CLASS,
            _ => colours.next().copied().unwrap_or(PLAIN_CLASS),
        };
        named.into_iter().map(|(code, label)| Self { code, colour: colour(&label), label }).collect()
    }
}

impl MapStyle {
    /// Draws a map. A picture needs three grids of one size; other styles take the first. `cell_m`
    /// is the size of a cell. Without a grid the result is empty.
    pub fn draw(&self, bands: &[Grid<f32>], cell_m: (f64, f64)) -> Grid<[u8; 4]> {
        let Some(values) = bands.first() else { return Grid::filled(0, 0, [0; 4]) };
        match self {
            Self::Hillshade => {
                let shade = hillshade(values, cell_m, Light::default());
                shade.map(|&s| if s == 0 { [0; 4] } else { [s, s, s, 255] })
            }
            Self::Relief { low, high } => {
                let shade = hillshade(values, cell_m, Light::default());
                let colours = coloured_relief(values, &shade, *low, *high);
                at_cells(values, |i, _| colours.data().get(i).copied())
            }
            Self::Ramp { low, high, colours } => at_cells(values, |_, v| Some(colours.at(part(v, *low, *high)))),
            Self::Classes(classes) => {
                at_cells(values, |_, v| classes.iter().find(|class| class.code as f32 == v).map(|class| class.colour))
            }
            Self::Marked { code } => at_cells(values, |_, v| (v == *code as f32).then_some(MARK)),
            Self::Picture { low, high } => {
                let rest = bands.get(1).zip(bands.get(2));
                at_cells(values, |i, red| {
                    let (green, blue) = rest.map_or((red, red), |(g, b)| (value(g, i), value(b, i)));
                    let colour = [red, green, blue];
                    colour.iter().all(|c| c.is_finite()).then(|| colour.map(|c| (255.0 * part(c, *low, *high)) as u8))
                })
            }
        }
    }

    /// Returns the legend.
    pub fn legend(&self) -> MapLegend {
        let ramp = |low: f32, high: f32, at: &dyn Fn(f64) -> [u8; 3]| {
            let colours = (0..STOPS).map(|i| css(at(i as f64 / (STOPS - 1) as f64))).collect();
            MapLegend::Ramp { low, high, colours }
        };
        match self {
            Self::Hillshade | Self::Picture { .. } => MapLegend::None,
            Self::Relief { low, high } => ramp(*low, *high, &|part| relief_colour(part as f32)),
            Self::Ramp { low, high, colours } => ramp(*low, *high, &|part| colours.at(part)),
            Self::Classes(classes) => MapLegend::Classes { classes: classes.clone() },
            Self::Marked { .. } => MapLegend::Marked { colour: css(MARK) },
        }
    }
}

impl RampColours {
    /// Returns the colour at a part of the range, clamped to 0 … 1.
    fn at(self, part: f64) -> [u8; 3] {
        match self {
            Self::DarkIsHigh => near_to_far(part),
            Self::LightIsHigh => near_to_far(1.0 - part),
            Self::Diverging => diverging(2.0 * part - 1.0),
            Self::Grey => [(255.0 * part.clamp(0.0, 1.0)).round() as u8; 3],
        }
    }
}

/// Returns where a value lies in a range, clamped to 0 … 1.
fn part(value: f32, low: f32, high: f32) -> f64 {
    let span = f64::from(high) - f64::from(low);
    if span > 0.0 { ((f64::from(value) - f64::from(low)) / span).clamp(0.0, 1.0) } else { 0.5 }
}

fn value(grid: &Grid<f32>, i: usize) -> f32 {
    grid.data().get(i).copied().unwrap_or(f32::NAN)
}

/// Colours the cells that have a value; the others are transparent.
fn at_cells(values: &Grid<f32>, colour: impl Fn(usize, f32) -> Option<[u8; 3]>) -> Grid<[u8; 4]> {
    let mut picture = Grid::filled(values.width(), values.height(), [0; 4]);
    for (i, (pixel, &value)) in picture.data_mut().iter_mut().zip(values.data()).enumerate() {
        if let Some([r, g, b]) = value.is_finite().then(|| colour(i, value)).flatten() {
            *pixel = [r, g, b, 255];
        }
    }
    picture
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn descriptions_name_classes() {
        let codes = |text: &str| MapClass::in_description(text).map(|found| found.iter().map(|c| c.code).collect());
        assert_eq!(codes("1_filled_0_observed"), Some(vec![0, 1]));
        assert_eq!(codes("0_outside_10_void_unmatched_2_a"), Some(vec![0, 2, 10]));
        for other in ["", "confidence_0_to_1", "3", "3_a", "1_2_a", "reflectance_1e-4"] {
            assert_eq!(codes(other), None, "{other}");
        }
    }

    #[test]
    fn every_style_leaves_voids_transparent() {
        let values = Grid::from_vec(3, 1, vec![0.0, 1.0, f32::NAN]).unwrap();
        let bands = [values.clone(), values.clone(), values];
        let classes = MapClass::in_description("0_observed_1_filled").unwrap();
        let colours = classes.clone();
        for style in [
            MapStyle::Hillshade,
            MapStyle::Relief { low: 0.0, high: 1.0 },
            MapStyle::Ramp { low: 0.0, high: 1.0, colours: RampColours::DarkIsHigh },
            MapStyle::Classes(classes),
            MapStyle::Picture { low: 0.0, high: 1.0 },
        ] {
            let picture = style.draw(&bands, (1.0, 1.0));
            let alpha: Vec<u8> = picture.data().iter().map(|p| p[3]).collect();
            assert_eq!(alpha, [255, 255, 0], "{style:?}");
            if let MapStyle::Classes(_) = style {
                assert_eq!(picture.data()[1][..3], colours[1].colour);
            }
        }
        let marked = MapStyle::Marked { code: 1 }.draw(&bands, (1.0, 1.0));
        assert_eq!(marked.data().iter().map(|p| p[3]).collect::<Vec<_>>(), [0, 255, 0]);
        assert_eq!(MapStyle::Hillshade.draw(&[], (1.0, 1.0)).width(), 0);
    }

    #[test]
    fn legends_have_the_colours_of_the_map() {
        let style = MapStyle::Ramp { low: 2.0, high: 4.0, colours: RampColours::LightIsHigh };
        let MapLegend::Ramp { low, high, colours } = style.legend() else { panic!("a ramp has a bar") };
        let ends = style.draw(&[Grid::from_vec(2, 1, vec![2.0, 4.0]).unwrap()], (1.0, 1.0));
        let drawn = |i: usize| css([ends.data()[i][0], ends.data()[i][1], ends.data()[i][2]]);
        assert_eq!((low, high, colours[0].clone(), colours[STOPS - 1].clone()), (2.0, 4.0, drawn(0), drawn(1)));
        assert_eq!(MapStyle::Hillshade.legend(), MapLegend::None);
    }
}
