//! `skysweep groundview compose`: a rendered ground layer over a satellite layer.

use std::path::{Path, PathBuf};

use groundview::compose;
use io::raster::{ImageSource, SampleType, write_png_rgb};
use raster::Grid;

use crate::Outcome;

/// Arguments of `skysweep groundview compose`.
#[derive(Debug, clap::Args)]
#[command(
    after_help = "C = C_ground + (1 - alpha) C_sat: the ground layer as splat renderers leave it, weighted by its opacity."
)]
pub(crate) struct Args {
    /// Colours of the ground layer.
    ground: PathBuf,
    /// Its opacity (0 to the largest value of the file's type, or 0 to 1 in floats).
    alpha: PathBuf,
    /// Colours of the satellite layer.
    satellite: PathBuf,
    /// PNG to write.
    #[arg(short, long, value_name = "OUT.png")]
    output: PathBuf,
    /// Replace a file that exists.
    #[arg(long)]
    overwrite: bool,
}

/// Runs `skysweep groundview compose`.
pub(crate) fn run(args: &Args) -> anyhow::Result<Outcome> {
    let (ground, satellite) = (layer(&args.ground)?, layer(&args.satellite)?);
    let source = ImageSource::open(&args.alpha)?;
    let full = full(&source);
    let alpha = source.read_samples(1, source.window())?.map(|a| if a.is_finite() { a / full } else { 0.0 });
    let made = compose(&ground, &alpha, &satellite)?;
    let picture = made.map(|p| p.map(|c| (255.0 * c.clamp(0.0, 1.0)).round() as u8));
    write_png_rgb(&args.output, &picture, args.overwrite)?;
    Ok(Outcome::Complete)
}

fn layer(path: &Path) -> anyhow::Result<Grid<[f32; 3]>> {
    let source = ImageSource::open(path)?;
    let full = full(&source);
    Ok(source.read_colour(source.window())?.map(|p| p.map(|c| if c.is_finite() { c / full } else { 0.0 })))
}

/// The value of full light.
fn full(source: &ImageSource) -> f32 {
    match source.info().sample {
        SampleType::U8 => 255.0,
        SampleType::U16 => 65_535.0,
        _ => 1.0,
    }
}
