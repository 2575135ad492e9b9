//! How the layers of a raster look: from the name of the file, and the description, the sample type
//! and the values of its band.

use formats::raster::{BandLabel, ImageInfo, LumaRule, SampleType};
use raster::{Grid, height_percentiles};
use report::{Legend, MapClass, MapStyle, RampColours};

use dsm::{filled_legend, source_legend};

/// Most values of a raster of bytes that are shown as classes without names.
const CLASSES_MAX: usize = 12;

/// A layer of a raster.
#[derive(Debug, Clone, PartialEq)]
pub(super) struct LayerLook {
    /// Name for people.
    pub(super) title: String,
    /// How it is drawn.
    pub(super) style: MapStyle,
    /// Whether the values are heights above a datum.
    pub(super) is_height: bool,
}

/// What the look of a raster follows from.
pub(super) struct RasterTraits<'a> {
    /// Name of the file without its ending.
    pub(super) stem: &'a str,
    /// Size, sample type, colours.
    pub(super) info: &'a ImageInfo,
    /// Label of the first band.
    pub(super) label: &'a BandLabel,
    /// Reduced values of the bands that are drawn.
    pub(super) sample: &'a [Grid<f32>],
}

/// Returns the bands, counted from 1, that are drawn.
pub(super) fn bands(info: &ImageInfo) -> Vec<usize> {
    match &info.luma {
        LumaRule::Rgb(bands) => bands.to_vec(),
        LumaRule::Single(band) => vec![*band],
        _ => vec![1],
    }
}

/// Returns the layers of a raster, at least one.
pub(super) fn looks(traits: &RasterTraits<'_>) -> Vec<LayerLook> {
    let one = |style: MapStyle| vec![LayerLook { title: title(traits.stem), style, is_height: false }];
    if traits.sample.len() == 3 {
        let (low, high) = range(traits.sample, 1.0, 99.0);
        return one(MapStyle::Picture { low, high });
    }
    if traits.label.description.starts_with("class_") {
        return one(MapStyle::Classes(classes_of(surfaces::classes::legend())));
    }
    if let Some(classes) = MapClass::in_description(&traits.label.description) {
        let classes = match traits.stem {
            "source" => classes_of(source_legend()),
            "filled" => classes_of(filled_legend()),
            _ => classes,
        };
        let mut layers = one(MapStyle::Classes(classes));
        if traits.stem == "filled" {
            let style = MapStyle::Marked { code: 1 };
            layers.push(LayerLook { title: "Filled cells, hatched".to_owned(), style, is_height: false });
        }
        return layers;
    }
    if let Some((low, high, colours)) = ramp(traits) {
        return one(MapStyle::Ramp { low, high, colours });
    }
    if let Some(classes) = numbered_classes(traits) {
        return one(MapStyle::Classes(classes));
    }
    if is_height(traits) {
        return heights(traits);
    }
    let (low, high) = range(traits.sample, 1.0, 99.0);
    one(MapStyle::Ramp { low, high, colours: RampColours::Grey })
}

/// Returns the classes of a legend of codes, such as those of the page of a run.
fn classes_of(legend: Legend) -> Vec<MapClass> {
    let Legend::Codes(codes) = legend else { return Vec::new() };
    codes.iter().map(|&(code, colour, label)| MapClass { code: code.into(), label: label.to_owned(), colour }).collect()
}

/// Returns the hillshade and the coloured relief of a raster of heights.
fn heights(traits: &RasterTraits<'_>) -> Vec<LayerLook> {
    let (low, high) = range(traits.sample, 0.5, 99.5);
    let (shade, relief) = match traits.stem {
        "dsm" => ("Hillshade".to_owned(), "Heights".to_owned()),
        stem => (format!("{}, hillshade", title(stem)), title(stem)),
    };
    let layer = |title: String, style: MapStyle| LayerLook { title, style, is_height: true };
    vec![layer(relief, MapStyle::Relief { low, high }), layer(shade, MapStyle::Hillshade)]
}

/// Returns the range and the colours of quantities that are not heights.
fn ramp(traits: &RasterTraits<'_>) -> Option<(f32, f32, RampColours)> {
    let description = traits.label.description.as_str();
    let end = range(traits.sample, 0.0, 98.0).1;
    Some(match () {
        () if description.contains("0_to_1") => (0.0, 1.0, RampColours::LightIsHigh),
        () if description.contains("standard_deviation") => (0.0, end, RampColours::DarkIsHigh),
        () if description.contains("above_ground") => (0.0, end, RampColours::DarkIsHigh),
        () if description.contains("number_of") => {
            let (low, high) = range(traits.sample, 0.0, 100.0);
            (low, high, RampColours::LightIsHigh)
        }
        () if ["error", "change"].iter().any(|word| description.starts_with(word))
            || description.contains("difference") =>
        {
            let (low, high) = range(traits.sample, 3.0, 97.0);
            let most = low.abs().max(high.abs());
            (-most, most, RampColours::Diverging)
        }
        () => return None,
    })
}

/// Returns classes without names for a raster of bytes with few values.
fn numbered_classes(traits: &RasterTraits<'_>) -> Option<Vec<MapClass>> {
    let sample = traits.sample.first().filter(|_| traits.info.sample == SampleType::U8)?;
    let mut is_used = [false; 256];
    for value in sample.data().iter().filter(|value| value.is_finite()) {
        is_used[usize::from(*value as u8)] = true;
    }
    let codes: Vec<i64> = (0..256).filter(|code| is_used[*code as usize]).collect();
    let names = codes.iter().map(|code| (*code, code.to_string()));
    (!codes.is_empty() && codes.len() <= CLASSES_MAX).then(|| MapClass::coloured(names))
}

/// Whether the values are heights: by name, or samples of a type that is used for heights without
/// another name.
fn is_height(traits: &RasterTraits<'_>) -> bool {
    use SampleType as Sample;
    let description = traits.label.description.to_ascii_lowercase();
    let can_be = matches!(traits.info.sample, Sample::F32 | Sample::F64 | Sample::I16 | Sample::I32);
    let is_named = ["height", "elevation", "dsm", "dtm", "dem"].iter().any(|word| description.contains(word));
    can_be && traits.info.geotransform.is_some() && (is_named || description.is_empty())
}

/// Returns two percentiles of the values of all bands, or 0 and 1 without values.
fn range(sample: &[Grid<f32>], low: f64, high: f64) -> (f32, f32) {
    let ranges: Vec<_> = sample.iter().filter_map(|grid| height_percentiles(grid, low, high)).collect();
    let low = ranges.iter().map(|r| r.0).fold(f32::INFINITY, f32::min);
    let high = ranges.iter().map(|r| r.1).fold(f32::NEG_INFINITY, f32::max);
    if low < high {
        (low, high)
    } else if low == high {
        (low, low + 1.0)
    } else {
        (0.0, 1.0)
    }
}

/// Returns a name for people.
fn title(stem: &str) -> String {
    let known = [
        ("dsm", "Heights"),
        ("dtm", "Terrain"),
        ("height_above_ground", "Height above ground"),
        ("sigma", "Standard deviation"),
        ("confidence", "Confidence"),
        ("views", "Views"),
        ("source", "Source of the height"),
        ("filled", "Filled cells"),
        ("ground", "State of the ground"),
        ("ortho", "Ortho"),
        ("ortho_mask", "Ortho, seen and hidden"),
        ("error_map", "Errors"),
        ("classes", "Classes"),
        ("roughness", "Roughness"),
        ("ndvi", "Vegetation index"),
        ("change", "Change"),
        ("significance", "Significance of the change"),
        ("regions", "Regions of change"),
    ];
    known.iter().find(|(own, _)| *own == stem).map_or_else(|| stem.to_owned(), |(_, name)| (*name).to_owned())
}
