//! The files of an ortho: its bands in the images' sample type, the mask, and what is told.

use std::path::{Path, PathBuf};

use anyhow::bail;
use crs::Crs;
use io::raster::{Band, BandData, CogRaster, SampleType, write_cog};
use ortho::Balance;
use raster::Grid;
use serde::Serialize;

use super::Args;
use super::inputs::Inputs;
use super::mosaic::{Counts, HIDDEN, OUTSIDE, Ortho, SEEN, VOID};

/// Value of cells without data in integer orthos; those with data begin at 1.
const INTEGER_VOID: f32 = 0.0;

/// What was made.
#[derive(Debug, Serialize)]
pub(super) struct Report {
    ortho: PathBuf,
    mask: PathBuf,
    size: (usize, usize),
    bands: usize,
    cells_seen: usize,
    cells_hidden: usize,
    cells_outside: usize,
    cells_void: usize,
    images: Vec<ImageReport>,
}

#[derive(Debug, Serialize)]
struct ImageReport {
    path: PathBuf,
    /// At the middle of the surface model.
    incidence_deg: f64,
    corrected: bool,
    #[serde(flatten)]
    counts: Counts,
    balance: Vec<Balance>,
}

/// The mask beside an ortho.
fn mask_path(ortho: &Path) -> PathBuf {
    let stem = ortho.file_stem().unwrap_or_default().to_string_lossy();
    ortho.with_file_name(format!("{stem}_mask.tif"))
}

/// Refuses before the work what would fail after it.
pub(super) fn check(args: &Args) -> anyhow::Result<()> {
    for path in [&args.output, &mask_path(&args.output)] {
        if !args.overwrite && path.symlink_metadata().is_ok() {
            bail!("the output exists already: choose another name or pass --overwrite: {}", path.display());
        }
    }
    Ok(())
}

/// Writes the mask, then the ortho.
pub(super) fn write(args: &Args, inputs: &Inputs, made: &Ortho) -> anyhow::Result<Report> {
    let crs = Crs::ellipsoidal(inputs.epsg);
    let threads = args.threads.unwrap_or_else(|| std::thread::available_parallelism().map_or(1, usize::from));
    let mask = mask_path(&args.output);
    let mask_bands = [
        Band { description: "0_seen_1_hidden_2_outside_255_no_height", data: BandData::U8(&made.state) },
        Band { description: "image_from_1", data: BandData::U8(&made.view) },
    ];
    let raster = CogRaster { threads, ..CogRaster::new(&mask_bands, inputs.grid.geotransform, crs) };
    write_cog(&mask, &raster, args.overwrite)?;
    let names: Vec<String> = (1..=made.bands.len()).map(|band| format!("band_{band}")).collect();
    match sample_type(inputs) {
        SampleType::U8 => {
            let grids: Vec<Grid<u8>> = made.bands.iter().map(|b| b.map(|&v| whole(v, 255.0) as u8)).collect();
            let bands: Vec<Band<'_>> = named(&names, &grids, BandData::U8);
            ortho(args, inputs, &bands, Some(f64::from(INTEGER_VOID)), threads)?;
        }
        SampleType::U16 => {
            let grids: Vec<Grid<u16>> = made.bands.iter().map(|b| b.map(|&v| whole(v, 65_535.0) as u16)).collect();
            let bands: Vec<Band<'_>> = named(&names, &grids, BandData::U16);
            ortho(args, inputs, &bands, Some(f64::from(INTEGER_VOID)), threads)?;
        }
        _ => {
            let bands: Vec<Band<'_>> = named(&names, &made.bands, BandData::F32);
            ortho(args, inputs, &bands, Some(f64::from(raster::NO_DATA)), threads)?;
        }
    }
    Ok(report(args, inputs, made, mask))
}

fn named<'a, T>(names: &'a [String], grids: &'a [Grid<T>], data: fn(&'a Grid<T>) -> BandData<'a>) -> Vec<Band<'a>> {
    names.iter().zip(grids).map(|(description, grid)| Band { description, data: data(grid) }).collect()
}

fn ortho(args: &Args, inputs: &Inputs, bands: &[Band<'_>], no_data: Option<f64>, threads: usize) -> anyhow::Result<()> {
    let crs = Crs::ellipsoidal(inputs.epsg);
    let overviews = io::raster::Sampling::Average;
    let raster = CogRaster { no_data, threads, overviews, ..CogRaster::new(bands, inputs.grid.geotransform, crs) };
    Ok(write_cog(&args.output, &raster, args.overwrite)?)
}

/// A sample that an integer type holds, 0 where there is none.
fn whole(value: f32, most: f32) -> f32 {
    if value.is_nan() { INTEGER_VOID } else { value.round().clamp(1.0, most) }
}

/// The type that holds the samples of all images.
fn sample_type(inputs: &Inputs) -> SampleType {
    let types = inputs.images.iter().map(|image| image.source.info().sample);
    types.fold(SampleType::U8, |widest, next| match (widest, next) {
        (SampleType::U8, SampleType::U8) => SampleType::U8,
        (SampleType::U8 | SampleType::U16, SampleType::U8 | SampleType::U16) => SampleType::U16,
        _ => SampleType::F32,
    })
}

fn report(args: &Args, inputs: &Inputs, made: &Ortho, mask: PathBuf) -> Report {
    let count = |state: u8| made.state.data().iter().filter(|&&s| s == state).count();
    let middle = (inputs.dsm.heights.width() as f64 / 2.0, inputs.dsm.heights.height() as f64 / 2.0);
    let images = inputs.images.iter().zip(&made.counts).zip(&made.balances);
    let images = images.map(|((image, counts), balance)| ImageReport {
        path: image.source.path().to_owned(),
        incidence_deg: image.eyeline.incidence_deg(middle.0, middle.1),
        corrected: image.corrected,
        counts: *counts,
        balance: balance.clone(),
    });
    Report {
        ortho: args.output.clone(),
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

impl Report {
    pub(super) fn text(&self) -> String {
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
