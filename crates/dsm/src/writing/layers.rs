//! The rasters of a run, each with all that files, pages, styles and catalogues say of it.
//!
//! A further raster is a field of [`SurfaceRasters`] and an entry of [`LAYERS`].

use formats::raster::{BandData, SpoolBand};
use raster::{Grid, NO_DATA, height_percentiles};
use reconstruct::SurfaceRasters;
use report::{Legend, LightEnd};
use sweep::fusion::{CellSource, FILLED, VOID};

/// Percentiles of the heights between which colours are spread, so that one mast does not take them
/// from the rest.
pub(super) const HEIGHT_PERCENTILES: (f64, f64) = (1.0, 99.0);
/// Percentile of σ at which its colours end.
const SIGMA_PERCENTILE: f64 = 98.0;

/// A raster of a run.
pub(crate) struct Layer {
    /// Name of its files without their endings.
    pub(crate) stem: &'static str,
    /// The raster, relative to the folder of the run.
    pub(crate) raster: &'static str,
    /// Its style for QGIS, relative to the folder of the run.
    pub(crate) style: &'static str,
    /// What it holds, in words.
    pub(crate) title: &'static str,
    /// Description of its band.
    description: &'static str,
    /// Value of bytes without data; `None` for floats.
    void_byte: Option<u8>,
    /// Unit of the cells; empty without one.
    pub(crate) unit: &'static str,
    /// Name and caption on the page; `None` for one that is not shown there.
    pub(crate) on_page: Option<(&'static str, &'static str)>,
    /// Returns the colours for reduced cells.
    pub(crate) legend: fn(&Grid<f32>) -> Legend,
    /// Returns the cells; the heights as they are written come beside the rasters.
    pub(super) cells: for<'a> fn(&'a SurfaceRasters, &'a Grid<f32>) -> BandData<'a>,
}

impl Layer {
    /// Returns its band.
    pub(super) const fn band(&self) -> SpoolBand<'static> {
        let (is_float, no_data) = match self.void_byte {
            None => (true, NO_DATA as f64),
            Some(void) => (false, void as f64),
        };
        SpoolBand { description: self.description, is_float, no_data }
    }

    /// Returns whether a mean of cells means something: that of codes and counts is none.
    pub(super) const fn is_averaged(&self) -> bool {
        self.void_byte.is_none()
    }
}

/// Names of the files of a raster.
macro_rules! layer {
    ($stem:literal { $($field:ident: $value:expr,)+ }) => {
        Layer {
            stem: $stem,
            raster: concat!("dsm/", $stem, ".tif"),
            style: concat!("dsm/", $stem, ".qml"),
            $($field: $value,)+
        }
    };
}

/// Places of the rasters in [`LAYERS`] that have uses of their own.
pub(crate) const HEIGHTS: usize = 0;
pub(crate) const SIGMA: usize = 1;
pub(crate) const FILLED_FLAGS: usize = 5;

/// The rasters of a run.
pub(crate) const LAYERS: [Layer; 6] = [
    layer!("dsm" {
        title: "Heights of the upper surface",
        description: "height_m",
        void_byte: None,
        unit: "m",
        on_page: Some(("Heights", "Heights above the vertical datum, shaded from the north-west.")),
        legend: |heights| {
            let (low, high) = height_percentiles(heights, HEIGHT_PERCENTILES.0, HEIGHT_PERCENTILES.1).unwrap_or((0.0, 1.0));
            Legend::heights(low, high, "m")
        },
        cells: |_, heights| BandData::F32(heights),
    }),
    layer!("sigma" {
        title: "Standard deviation of the heights",
        description: "height_standard_deviation_m",
        void_byte: None,
        unit: "m",
        on_page: Some(("σ", "Standard deviation of the height; an estimate where the cell was filled.")),
        legend: |sigma| {
            let high = height_percentiles(sigma, 0.0, SIGMA_PERCENTILE).map_or(1.0, |(_, high)| high);
            Legend::sequential(0.0, f64::from(high), LightEnd::Low, "m")
        },
        cells: |rasters, _| BandData::F32(&rasters.sigma_m),
    }),
    layer!("source" {
        title: "Where each height comes from",
        description: SOURCE_CODES,
        void_byte: Some(0),
        unit: "",
        on_page: Some(("Source", "Where each height comes from, or why there is none.")),
        legend: |_| source_legend(),
        cells: |rasters, _| BandData::U8(&rasters.source),
    }),
    layer!("confidence" {
        title: "Probability that the height is right",
        description: "confidence_0_to_1",
        void_byte: None,
        unit: "",
        on_page: Some(("Confidence", "Probability that the height is right to a few σ.")),
        legend: |_| Legend::sequential(0.0, 1.0, LightEnd::High, ""),
        cells: |rasters, _| BandData::F32(&rasters.confidence),
    }),
    layer!("views" {
        title: "Number of views behind each height",
        description: "number_of_views",
        void_byte: Some(0),
        unit: "",
        on_page: Some(("Views", "Number of views that observed the height; none where it was filled.")),
        legend: |views| {
            let most = views.data().iter().copied().filter(|v| v.is_finite()).fold(2.0, f32::max);
            Legend::sequential(0.0, f64::from(most), LightEnd::High, "views")
        },
        cells: |rasters, _| BandData::U8(&rasters.views),
    }),
    layer!("filled" {
        title: "Filled cells",
        description: "1_filled_0_observed",
        void_byte: Some(VOID),
        unit: "",
        on_page: None,
        legend: |_| filled_legend(),
        cells: |rasters, _| BandData::U8(&rasters.filled),
    }),
];

/// Description of the codes of [`CellSource`].
const SOURCE_CODES: &str = "0_outside_1_observed_2_filled_hidden_3_filled_surface_4_filled_narrow_5_filled_street_\
                            10_void_unmatched_11_void_blank_12_void_hidden_13_void_masked";

/// Returns the colours of the origins of heights: greens and blues for heights, browns and greys
/// for voids.
pub fn source_legend() -> Legend {
    let code = |source: CellSource, colour: [u8; 3], text| (source.code(), colour, text);
    Legend::Codes(vec![
        code(CellSource::Observed, [86, 160, 96], "observed"),
        code(CellSource::FilledHidden, [86, 140, 200], "filled: hidden ground"),
        code(CellSource::FilledSurface, [240, 200, 80], "filled: surface that does not match"),
        code(CellSource::FilledNarrow, [150, 205, 225], "filled: narrow gap"),
        code(CellSource::FilledStreet, [170, 130, 200], "filled: street between roofs"),
        code(CellSource::Unmatched, [200, 90, 60], "void: no match"),
        code(CellSource::Blank, [120, 90, 70], "void: one grey value"),
        code(CellSource::Hidden, [70, 70, 110], "void: hidden"),
        code(CellSource::Masked, [40, 40, 40], "void: masked"),
    ])
}

/// Returns the colours of observed and filled cells.
pub fn filled_legend() -> Legend {
    Legend::Codes(vec![(0, [86, 160, 96], "observed"), (FILLED, [240, 200, 80], "filled")])
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn places_are_those_of_the_rasters() {
        let stem = |place: usize| LAYERS[place].stem;
        assert_eq!([HEIGHTS, SIGMA, FILLED_FLAGS].map(stem), ["dsm", "sigma", "filled"]);
    }

    #[test]
    fn pages_and_docs_name_every_raster() {
        let links = job::run_links::links("", "page.html", |_| true);
        let outputs = include_str!("../../../../docs/outputs.md");
        for layer in &LAYERS {
            let words = layer.title.to_lowercase();
            let is_linked = links.iter().any(|link| link.path == layer.raster && link.title == words);
            assert!(is_linked, "{}: {words}", layer.raster);
            assert!(outputs.contains(&format!("`{}`", layer.raster)), "{}", layer.raster);
        }
    }

    #[test]
    fn every_source_has_a_colour() {
        let Legend::Codes(codes) = source_legend() else { unreachable!("the sources are codes") };
        let mut colours: Vec<[u8; 3]> = codes.iter().map(|(_, colour, _)| *colour).collect();
        colours.sort_unstable();
        colours.dedup();
        assert_eq!(colours.len(), 9);
    }
}
