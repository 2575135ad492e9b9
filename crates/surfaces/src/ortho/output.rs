//! Writes an ortho with its mask and makes the report. The ortho has the sample type of the images.

use std::path::{Path, PathBuf};

use formats::raster::{Band, BandData, CogRaster, ImageSource, LumaRule, Provenance, SampleType, iso_time, write_cog};
use ortho::Balance;
use raster::Grid;
use report::{Legend, LightEnd, MapLayer};
use serde::Serialize;

use super::config::OrthoConfig;
use super::error::OrthoError;
use super::inputs::OrthoInputs;
use super::mosaic::Ortho;
use super::states::{HIDDEN, OUTSIDE, OrthoCounts, SEEN, VOID};
use job::files::FileError;
use job::report_page;
use job::threads;

/// No-data value of integer orthos. Values begin at 1.
const INTEGER_VOID: f32 = 0.0;
/// Value of the colours of cells that an alpha band marks as missing.
const COLOUR_VOID: f32 = 0.0;

/// A finished ortho.
#[derive(Debug, Clone, Serialize)]
#[non_exhaustive]
pub struct OrthoReport {
    /// File of the ortho.
    pub ortho: PathBuf,
    /// File of the mask.
    pub mask: PathBuf,
    /// File of this report; its page lies beside it.
    pub report: PathBuf,
    /// Columns and rows.
    pub size: (usize, usize),
    /// Bands of the ortho.
    pub bands: usize,
    /// Cells that show their own ground point.
    pub cells_seen: usize,
    /// Cells that are hidden in every image that reaches them.
    pub cells_hidden: usize,
    /// Cells that no image reaches.
    pub cells_outside: usize,
    /// Cells without a height.
    pub cells_void: usize,
    /// The images, in the order of the configuration.
    pub images: Vec<OrthoPart>,
}

/// An image of an ortho.
#[derive(Debug, Clone, Serialize)]
#[non_exhaustive]
pub struct OrthoPart {
    /// The image.
    pub path: PathBuf,
    /// Angle from the vertical at the middle of the surface model, degrees.
    pub incidence_deg: f64,
    /// Whether the pointing was corrected.
    pub corrected: bool,
    /// Cells that the image sees, hides and gives.
    #[serde(flatten)]
    pub counts: OrthoCounts,
    /// Gain and offset by band.
    pub balance: Vec<Balance>,
}

/// Writes the mask, then the ortho.
pub(super) fn write(
    config: &OrthoConfig,
    inputs: &OrthoInputs<'_, ImageSource>,
    made: &Ortho,
) -> Result<OrthoReport, OrthoError> {
    let threads = threads::count(config.threads);
    let mask = config.mask();
    let mask_bands = [
        Band { description: "0_seen_1_hidden_2_outside_255_no_height", data: BandData::U8(&made.state) },
        Band { description: "image_from_1", data: BandData::U8(&made.view) },
    ];
    let provenance = provenance(inputs);
    let plain = CogRaster::new(&mask_bands, inputs.grid.geotransform, inputs.surface.map.ellipsoidal());
    let raster = CogRaster { threads, holds_heights: false, provenance: Some(&provenance), ..plain };
    write_cog(&mask, &raster, config.overwrite).map_err(FileError::from)?;
    let style = state_legend().qml();
    formats::write_bytes(config.mask_style(), style.as_bytes(), config.overwrite).map_err(FileError::from)?;
    let colours = colours(inputs);
    let mut names: Vec<String> = (1..=made.bands.len()).map(|band| format!("band_{band}")).collect();
    names.extend(colours.map(|_| "alpha".to_owned()));
    let writer = OrthoWriter { config, inputs, names: &names, colours, threads };
    match sample_type(inputs) {
        SampleType::U8 => {
            let whole = |v, void| whole(v, void, 255.0) as u8;
            writer.write(made, |cells| BandData::U8(cells), whole, (INTEGER_VOID, u8::MAX))?;
        }
        SampleType::U16 => {
            let whole = |v, void| whole(v, void, 65_535.0) as u16;
            writer.write(made, |cells| BandData::U16(cells), whole, (INTEGER_VOID, u16::MAX))?;
        }
        _ => {
            let known = |v: f32, void| if v.is_nan() { void } else { v };
            writer.write(made, |cells| BandData::F32(cells), known, (raster::NO_DATA, 1.0))?;
        }
    }
    report(config, inputs, made, mask)
}

/// Writes the ortho in the type of its samples.
struct OrthoWriter<'a> {
    config: &'a OrthoConfig,
    inputs: &'a OrthoInputs<'a, ImageSource>,
    /// Names of the bands, the alpha band included.
    names: &'a [String],
    colours: Option<[usize; 3]>,
    threads: usize,
}

impl OrthoWriter<'_> {
    /// Writes the bands. A colour picture has an alpha band, whose `opaque` value marks cells with
    /// a colour; every other ortho has the value `no_data` instead. `convert` takes a value and
    /// what stands for a missing one.
    fn write<T: Copy + Default>(
        &self,
        made: &Ortho,
        data: for<'b> fn(&'b Grid<T>) -> BandData<'b>,
        convert: impl Fn(f32, f32) -> T,
        (no_data, opaque): (f32, T),
    ) -> Result<(), OrthoError> {
        let void = if self.colours.is_some() { COLOUR_VOID } else { no_data };
        let mut grids: Vec<Grid<T>> = made.bands.iter().map(|band| band.map(|&v| convert(v, void))).collect();
        if let (Some(_), Some(first)) = (self.colours, made.bands.first()) {
            grids.push(first.map(|v| if v.is_nan() { T::default() } else { opaque }));
        }
        let bands: Vec<Band<'_>> =
            (self.names.iter().zip(&grids)).map(|(description, grid)| Band { description, data: data(grid) }).collect();
        let provenance = provenance(self.inputs);
        let plain = CogRaster::new(&bands, self.inputs.grid.geotransform, self.inputs.surface.map.ellipsoidal());
        let raster = CogRaster {
            no_data: self.colours.is_none().then_some(f64::from(no_data)),
            threads: self.threads,
            overviews: formats::raster::Sampling::Average,
            holds_heights: false,
            colours: self.colours,
            alpha: self.colours.map(|_| bands.len()),
            provenance: Some(&provenance),
            ..plain
        };
        Ok(write_cog(&self.config.output, &raster, self.config.overwrite).map_err(FileError::from)?)
    }
}

/// Returns the images and their times.
fn provenance(inputs: &OrthoInputs<'_, ImageSource>) -> Provenance {
    let name = |path: &Path| path.file_name().unwrap_or_default().to_string_lossy().into_owned();
    Provenance {
        sources: inputs.images.iter().map(|image| name(image.source.path())).collect(),
        acquired: inputs.images.iter().filter_map(|image| image.source.acquired_s().and_then(iso_time)).collect(),
    }
}

/// Returns the bands that are red, green and blue, where that is so in all images.
fn colours(inputs: &OrthoInputs<'_, ImageSource>) -> Option<[usize; 3]> {
    let mut rules = inputs.images.iter().map(|image| &image.source.info().luma);
    match rules.next() {
        Some(LumaRule::Rgb(bands)) if rules.all(|rule| *rule == LumaRule::Rgb(*bands)) => Some(*bands),
        _ => None,
    }
}

/// Rounds a sample to the range of an integer type. NaN becomes `void`. The value 0 is left to
/// voids also where an alpha band marks them, for readers that ignore it.
fn whole(value: f32, void: f32, most: f32) -> f32 {
    if value.is_nan() { void } else { value.round().clamp(1.0, most) }
}

/// Returns the smallest type that holds the samples of all images.
fn sample_type(inputs: &OrthoInputs<'_, ImageSource>) -> SampleType {
    let types = inputs.images.iter().map(|image| image.source.info().sample);
    types.fold(SampleType::U8, |widest, next| match (widest, next) {
        (SampleType::U8, SampleType::U8) => SampleType::U8,
        (SampleType::U8 | SampleType::U16, SampleType::U8 | SampleType::U16) => SampleType::U16,
        _ => SampleType::F32,
    })
}

/// Makes the report and writes it, with its page.
fn report(
    config: &OrthoConfig,
    inputs: &OrthoInputs<'_, ImageSource>,
    made: &Ortho,
    mask: PathBuf,
) -> Result<OrthoReport, OrthoError> {
    let count = |state: u8| made.state.data().iter().filter(|&&s| s == state).count();
    let middle = (inputs.surface.dsm.heights.width() as f64 / 2.0, inputs.surface.dsm.heights.height() as f64 / 2.0);
    let images = inputs.images.iter().zip(&made.counts).zip(&made.balances);
    let images = images.map(|((image, counts), balance)| OrthoPart {
        path: image.source.path().to_owned(),
        incidence_deg: image.eyeline.incidence_deg(middle.0, middle.1),
        corrected: image.corrected,
        counts: *counts,
        balance: balance.clone(),
    });
    let report = OrthoReport {
        ortho: config.output.clone(),
        mask,
        report: config.report(),
        size: (inputs.grid.width, inputs.grid.height),
        bands: made.bands.len(),
        cells_seen: count(SEEN),
        cells_hidden: count(HIDDEN),
        cells_outside: count(OUTSIDE),
        cells_void: count(VOID),
        images: images.collect(),
    };
    let lead = format!("{} cells of {} images on a surface model.", report.size.0 * report.size.1, report.images.len());
    report_page::write(&report.report, ("Ortho", &lead), &report, layers(inputs, made), config.overwrite)?;
    Ok(report)
}

/// Returns the maps of the page: the picture, the states of the cells, and the images they are
/// from.
fn layers(inputs: &OrthoInputs<'_, ImageSource>, made: &Ortho) -> Vec<MapLayer> {
    let shown = colours(inputs).unwrap_or([1; 3]);
    let stretched = shown.map(|band| {
        let (small, _) = report_page::thinned(&made.bands[band - 1]);
        let (low, high) = report_page::shown_range(&small);
        small.map(|v| (255.0 * (v - low) / (high - low).max(f32::MIN_POSITIVE)).clamp(0.0, 255.0) as u8)
    });
    let mut picture = Grid::filled(stretched[0].width(), stretched[0].height(), [0u8; 3]);
    for (i, pixel) in picture.data_mut().iter_mut().enumerate() {
        *pixel = std::array::from_fn(|c| stretched[c].data()[i]);
    }
    let caption = "Values between the 1st and the 99th percentile.".to_owned();
    let of_states = made.state.map(|state| f32::from(*state));
    let of_views = made.view.map(|view| if *view == 0 { f32::NAN } else { f32::from(*view) });
    let views = Legend::sequential(1.0, inputs.images.len() as f64, LightEnd::Low, "");
    vec![
        MapLayer { name: "Ortho".to_owned(), picture, caption, legend: None },
        report_page::legend_layer("States", "What the images show of each cell.", &of_states, state_legend()),
        report_page::legend_layer("Images", "Number of the image that gives the cell.", &of_views, views),
    ]
}

/// Returns the colours of the states of cells.
fn state_legend() -> Legend {
    Legend::Codes(vec![
        (SEEN, [86, 160, 96], "seen"),
        (HIDDEN, [70, 70, 110], "hidden"),
        (OUTSIDE, [200, 90, 60], "outside of the images"),
        (VOID, [72, 72, 76], "no height"),
    ])
}

impl OrthoReport {
    /// Returns the report as text, which ends in a line break.
    pub fn text(&self) -> String {
        let cells = self.size.0 * self.size.1;
        let share = |n: usize| 100.0 * n as f64 / cells.max(1) as f64;
        let mut text = format!(
            "ortho   {}\nmask    {}\ncells   {cells} ({:.1} % seen, {:.1} % hidden, {:.1} % outside, {:.1} % without a height)\n",
            self.ortho.display(),
            self.mask.display(),
            share(self.cells_seen),
            share(self.cells_hidden),
            share(self.cells_outside),
            share(self.cells_void),
        );
        for (number, image) in (1..).zip(&self.images) {
            text.push_str(&format!(
                "image {number} {} ({:.1}° from the vertical, {}): gives {:.1} %\n",
                image.path.display(),
                image.incidence_deg,
                if image.corrected { "pointing corrected" } else { "pointing as given" },
                share(image.counts.used),
            ));
        }
        text
    }
}
