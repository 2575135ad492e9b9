//! What the colours of a map mean: for a page, and as a style of QGIS.

use std::fmt::Write;

use raster::{Grid, VOID_COLOUR};

use crate::escape::escape;
use crate::palette::{css, diverging};
use crate::words::{plain_number, sensible, typeset};

/// Number of colours that a ramp is written with.
const STEPS: usize = 17;

/// Meaning of the colours of a map.
#[derive(Debug, Clone, PartialEq)]
pub enum Legend {
    /// Colours between values, in rising order of the values; values beyond take those of the ends.
    Ramp {
        /// Values with their colours, at least two.
        stops: Vec<(f64, [u8; 3])>,
        /// Unit of the values; empty for a share or a count.
        unit: &'static str,
    },
    /// One colour for each whole number.
    Codes(Vec<(u8, [u8; 3], &'static str)>),
}

impl Legend {
    /// Returns the ramp of reliefs between two heights.
    pub fn heights(low: f32, high: f32, unit: &'static str) -> Self {
        let high = if high > low { high } else { low + 1.0 };
        let at = |i: usize| low + (high - low) * i as f32 / (STEPS - 1) as f32;
        let heights = Grid::from_vec(STEPS, 1, (0..STEPS).map(at).collect()).unwrap_or_else(|| Grid::filled(0, 0, 0.0));
        // The shade of level ground leaves the colours as they are.
        let level = (255.0 * std::f32::consts::FRAC_1_SQRT_2) as u8;
        let picture = raster::coloured_relief(&heights, &Grid::filled(STEPS, 1, level), low, high);
        let stops = heights.data().iter().zip(picture.data()).map(|(&h, &colour)| (f64::from(h), colour));
        Self::Ramp { stops: stops.collect(), unit }
    }

    /// Returns a ramp from `low` to `high` that is light at `light` and dark at the other end.
    pub fn sequential(low: f64, high: f64, light: LightEnd, unit: &'static str) -> Self {
        let high = if high > low { high } else { low + 1.0 };
        let stop = |i: usize| {
            let part = i as f64 / (STEPS - 1) as f64;
            let shown = if light == LightEnd::Low { part } else { 1.0 - part };
            (low + part * (high - low), crate::preview::near_to_far(shown))
        };
        Self::Ramp { stops: (0..STEPS).map(stop).collect(), unit }
    }

    /// Returns a ramp from −`range` to `range`, blue below zero and red above.
    pub fn signed(range: f64, unit: &'static str) -> Self {
        let range = if range > 0.0 { range } else { 1.0 };
        let stop = |i: usize| {
            let part = 2.0 * i as f64 / (STEPS - 1) as f64 - 1.0;
            (part * range, diverging(part))
        };
        Self::Ramp { stops: (0..STEPS).map(stop).collect(), unit }
    }

    /// Returns the colour of a value; that of nothing for NaN and for codes without a colour.
    pub fn colour(&self, value: f32) -> [u8; 3] {
        let value = f64::from(value);
        match self {
            _ if value.is_nan() => VOID_COLOUR,
            Self::Codes(codes) => {
                codes.iter().find(|(code, ..)| f64::from(*code) == value).map_or(VOID_COLOUR, |(_, colour, _)| *colour)
            }
            Self::Ramp { stops, .. } => {
                let above = stops.partition_point(|(at, _)| *at <= value);
                match (above.checked_sub(1).and_then(|i| stops.get(i)), stops.get(above)) {
                    (Some((low, a)), Some((high, b))) => {
                        let t = (value - low) / (high - low);
                        std::array::from_fn(|i| (f64::from(a[i]) + t * (f64::from(b[i]) - f64::from(a[i]))) as u8)
                    }
                    (Some((_, colour)), None) | (None, Some((_, colour))) => *colour,
                    (None, None) => VOID_COLOUR,
                }
            }
        }
    }

    /// Returns a map in the colours of the legend.
    pub fn picture(&self, values: &Grid<f32>) -> Grid<[u8; 3]> {
        values.map(|value| self.colour(*value))
    }

    /// Returns the legend as HTML. With `has_voids` it also explains the colour of cells without a
    /// value.
    pub(crate) fn html(&self, has_voids: bool) -> String {
        let key = |colour, text: &str| {
            let (colour, text) = (css(colour), escape(text));
            format!("<span><span class=\"key\" style=\"background:{colour}\"></span>{text}</span> ")
        };
        let void = if has_voids { key(VOID_COLOUR, "no value") } else { String::new() };
        match self {
            Self::Codes(codes) => {
                let items: String = codes.iter().map(|(_, colour, text)| key(*colour, text)).collect();
                format!("<div class=\"legend\">{items}{void}</div>")
            }
            Self::Ramp { stops, unit } => {
                let colours: Vec<String> = stops.iter().map(|(_, colour)| css(*colour)).collect();
                let end = |stop: Option<&(f64, [u8; 3])>| {
                    let value = stop.map_or(String::new(), |(value, _)| sensible(*value, "m"));
                    escape(typeset(&format!("{value} {unit}")).trim_end())
                };
                let (low, high) = (end(stops.first()), end(stops.last()));
                format!(
                    "<div class=\"legend\"><span>{low}</span><span class=\"ramp\" \
                     style=\"background:linear-gradient(90deg,{})\"></span><span>{high}</span>{void}</div>",
                    colours.join(",")
                )
            }
        }
    }

    /// Returns the legend as a style file of QGIS (`.qml`) for the first band of a raster.
    pub fn qml(&self) -> String {
        let mut renderer = String::new();
        // Writing to a string cannot fail.
        match self {
            Self::Codes(codes) => {
                renderer.push_str("<rasterrenderer type=\"paletted\" band=\"1\" opacity=\"1\" alphaBand=\"-1\">\n");
                renderer.push_str("      <colorPalette>\n");
                for (code, colour, text) in codes {
                    let (colour, text) = (css(*colour), escape(text));
                    let _ = writeln!(
                        renderer,
                        "        <paletteEntry value=\"{code}\" color=\"{colour}\" alpha=\"255\" label=\"{text}\"/>"
                    );
                }
                renderer.push_str("      </colorPalette>\n    </rasterrenderer>");
            }
            Self::Ramp { stops, unit } => {
                let (low, high) = (stops.first().map_or(0.0, |s| s.0), stops.last().map_or(1.0, |s| s.0));
                let _ = writeln!(
                    renderer,
                    "<rasterrenderer type=\"singlebandpseudocolor\" band=\"1\" opacity=\"1\" alphaBand=\"-1\" \
                     classificationMin=\"{low}\" classificationMax=\"{high}\">\n      <rastershader>\n        \
                     <colorrampshader colorRampType=\"INTERPOLATED\" classificationMode=\"1\" clip=\"0\" \
                     minimumValue=\"{low}\" maximumValue=\"{high}\">"
                );
                for (value, colour) in stops {
                    let (colour, label) = (css(*colour), format!("{} {unit}", plain_number(*value)));
                    let label = escape(label.trim_end());
                    let _ = writeln!(
                        renderer,
                        "          <item value=\"{value}\" color=\"{colour}\" alpha=\"255\" label=\"{label}\"/>"
                    );
                }
                renderer.push_str("        </colorrampshader>\n      </rastershader>\n    </rasterrenderer>");
            }
        }
        format!(
            "<!DOCTYPE qgis PUBLIC 'http://mrcc.com/qgis.dtd' 'SYSTEM'>\n<qgis version=\"3.22.0\" \
             styleCategories=\"Symbology\">\n  <pipe>\n    {renderer}\n    <brightnesscontrast brightness=\"0\" \
             contrast=\"0\" gamma=\"1\"/>\n    <huesaturation saturation=\"0\" grayscaleMode=\"0\"/>\n    \
             <rasterresampler maxOversampling=\"2\"/>\n  </pipe>\n  <blendMode>0</blendMode>\n</qgis>\n"
        )
    }
}

/// Which end of a ramp is light.
#[derive(Debug, Clone, Copy, PartialEq, Eq)]
pub enum LightEnd {
    /// The lowest value.
    Low,
    /// The highest value.
    High,
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn values_between_stops_have_colours_between_them() {
        let ramp = Legend::Ramp { stops: vec![(0.0, [0, 0, 0]), (10.0, [100, 200, 50])], unit: "m" };
        assert_eq!([-5.0, 5.0, 99.0].map(|v| ramp.colour(v)), [[0, 0, 0], [50, 100, 25], [100, 200, 50]]);
        assert_eq!(ramp.colour(f32::NAN), VOID_COLOUR);
        let codes = Legend::Codes(vec![(1, [1, 2, 3], "seen <once>")]);
        assert_eq!((codes.colour(1.0), codes.colour(2.0)), ([1, 2, 3], VOID_COLOUR));
        assert!(
            codes.html(false).contains("seen &lt;once&gt;") && codes.qml().contains("value=\"1\" color=\"#010203\"")
        );
        assert!(ramp.html(false).contains("10 m") && ramp.qml().contains("<item value=\"10\" color=\"#64c832\""));
    }

    #[test]
    fn voids_are_explained_where_there_are_some() {
        let ramp = Legend::heights(0.0, 10.0, "m");
        assert!(ramp.html(true).contains("no value") && !ramp.html(false).contains("no value"));
        for legend in [ramp, Legend::signed(1.0, "m"), Legend::sequential(0.0, 1.0, LightEnd::High, "")] {
            let Legend::Ramp { stops, .. } = &legend else { unreachable!("these are ramps") };
            let (low, high) = (stops[0].0, stops[STEPS - 1].0);
            for i in 0..=1000 {
                let colour = legend.colour((low + (high - low) * f64::from(i) / 1000.0) as f32);
                let far = colour.iter().zip(VOID_COLOUR).map(|(a, b)| a.abs_diff(b)).max();
                assert!(far >= Some(32), "{colour:?} looks like a void");
            }
        }
    }

    #[test]
    fn light_stands_where_it_is_asked_for() {
        let light = |colour: [u8; 3]| colour.iter().map(|&c| u32::from(c)).sum::<u32>();
        let low = Legend::sequential(0.0, 2.0, LightEnd::Low, "m");
        let high = Legend::sequential(0.0, 1.0, LightEnd::High, "");
        assert!(light(low.colour(0.0)) > light(low.colour(2.0)) && light(high.colour(1.0)) > light(high.colour(0.0)));
        // A surface of one height has a ramp as well.
        assert_eq!(Legend::heights(5.0, 5.0, "m").colour(5.0).len(), 3);
    }
}
