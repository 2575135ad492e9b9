//! Writes an ortho with its mask and makes the report. The ortho has the sample type of the images.

use std::path::PathBuf;

use crs::Crs;
use io::raster::{Band, BandData, CogRaster, LumaRule, SampleType, write_cog};
use ortho::Balance;
use raster::Grid;
use serde::Serialize;

use super::config::OrthoConfig;
use super::error::OrthoError;
use super::inputs::OrthoInputs;
use super::mosaic::Ortho;
use super::states::{HIDDEN, OUTSIDE, OrthoCounts, SEEN, VOID};
use crate::files::FileError;
use crate::threads;

/// No-data value of integer orthos. Values begin at 1.
const INTEGER_VOID: f32 = 0.0;

/// A finished ortho.
#[derive(Debug, Clone, Serialize)]
#[non_exhaustive]
pub struct OrthoReport {
    /// File of the ortho.
    pub ortho: PathBuf,
    /// File of the mask.
    pub mask: PathBuf,
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
pub(super) fn write(config: &OrthoConfig, inputs: &OrthoInputs, made: &Ortho) -> Result<OrthoReport, OrthoError> {
    let crs = Crs::ellipsoidal(inputs.epsg);
    let threads = threads::count(config.threads);
    let mask = config.mask();
    let mask_bands = [
        Band { description: "0_seen_1_hidden_2_outside_255_no_height", data: BandData::U8(&made.state) },
        Band { description: "image_from_1", data: BandData::U8(&made.view) },
    ];
    let raster =
        CogRaster { threads, holds_heights: false, ..CogRaster::new(&mask_bands, inputs.grid.geotransform, crs) };
    write_cog(&mask, &raster, config.overwrite).map_err(FileError::from)?;
    let names: Vec<String> = (1..=made.bands.len()).map(|band| format!("band_{band}")).collect();
    match sample_type(inputs) {
        SampleType::U8 => {
            let grids: Vec<Grid<u8>> = made.bands.iter().map(|b| b.map(|&v| whole(v, 255.0) as u8)).collect();
            let bands: Vec<Band<'_>> = named(&names, &grids, BandData::U8);
            write_ortho(config, inputs, &bands, Some(f64::from(INTEGER_VOID)), threads)?;
        }
        SampleType::U16 => {
            let grids: Vec<Grid<u16>> = made.bands.iter().map(|b| b.map(|&v| whole(v, 65_535.0) as u16)).collect();
            let bands: Vec<Band<'_>> = named(&names, &grids, BandData::U16);
            write_ortho(config, inputs, &bands, Some(f64::from(INTEGER_VOID)), threads)?;
        }
        _ => {
            let bands: Vec<Band<'_>> = named(&names, &made.bands, BandData::F32);
            write_ortho(config, inputs, &bands, Some(f64::from(raster::NO_DATA)), threads)?;
        }
    }
    Ok(report(config, inputs, made, mask))
}

fn named<'a, T>(names: &'a [String], grids: &'a [Grid<T>], data: fn(&'a Grid<T>) -> BandData<'a>) -> Vec<Band<'a>> {
    names.iter().zip(grids).map(|(description, grid)| Band { description, data: data(grid) }).collect()
}

fn write_ortho(
    config: &OrthoConfig,
    inputs: &OrthoInputs,
    bands: &[Band<'_>],
    no_data: Option<f64>,
    threads: usize,
) -> Result<(), OrthoError> {
    let crs = Crs::ellipsoidal(inputs.epsg);
    let overviews = io::raster::Sampling::Average;
    let colours = colours(inputs);
    let plain = CogRaster::new(bands, inputs.grid.geotransform, crs);
    let raster = CogRaster { no_data, threads, overviews, holds_heights: false, colours, ..plain };
    Ok(write_cog(&config.output, &raster, config.overwrite).map_err(FileError::from)?)
}

/// Returns the bands that are red, green and blue, where that is so in all images.
fn colours(inputs: &OrthoInputs) -> Option<[usize; 3]> {
    let mut rules = inputs.images.iter().map(|image| &image.source.info().luma);
    match rules.next() {
        Some(LumaRule::Rgb(bands)) if rules.all(|rule| *rule == LumaRule::Rgb(*bands)) => Some(*bands),
        _ => None,
    }
}

/// Rounds a sample to the range of an integer type; NaN becomes no-data.
fn whole(value: f32, most: f32) -> f32 {
    if value.is_nan() { INTEGER_VOID } else { value.round().clamp(1.0, most) }
}

/// Returns the smallest type that holds the samples of all images.
fn sample_type(inputs: &OrthoInputs) -> SampleType {
    let types = inputs.images.iter().map(|image| image.source.info().sample);
    types.fold(SampleType::U8, |widest, next| match (widest, next) {
        (SampleType::U8, SampleType::U8) => SampleType::U8,
        (SampleType::U8 | SampleType::U16, SampleType::U8 | SampleType::U16) => SampleType::U16,
        _ => SampleType::F32,
    })
}

fn report(config: &OrthoConfig, inputs: &OrthoInputs, made: &Ortho, mask: PathBuf) -> OrthoReport {
    let count = |state: u8| made.state.data().iter().filter(|&&s| s == state).count();
    let middle = (inputs.dsm.heights.width() as f64 / 2.0, inputs.dsm.heights.height() as f64 / 2.0);
    let images = inputs.images.iter().zip(&made.counts).zip(&made.balances);
    let images = images.map(|((image, counts), balance)| OrthoPart {
        path: image.source.path().to_owned(),
        incidence_deg: image.eyeline.incidence_deg(middle.0, middle.1),
        corrected: image.corrected,
        counts: *counts,
        balance: balance.clone(),
    });
    OrthoReport {
        ortho: config.output.clone(),
        mask,
        size: (inputs.grid.width, inputs.grid.height),
        bands: made.bands.len(),
        cells_seen: count(SEEN),
        cells_hidden: count(HIDDEN),
        cells_outside: count(OUTSIDE),
        cells_void: count(VOID),
        images: images.collect(),
    }
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
