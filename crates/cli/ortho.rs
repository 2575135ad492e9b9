//! `skysweep ortho`: images laid on a surface model so that every cell shows its own point, hidden cells marked.
//!
//! Beside `OUT.tif` stands `OUT_mask.tif`: band 1 says what a cell is (0 seen, 1 hidden in every image that reaches it, 2 outside
//! the images, 255 without a height), band 2 which image it comes from (from 1; 0 is none).

mod inputs;
mod mosaic;
mod output;
mod view;

use std::path::PathBuf;

use crs::VerticalDatum;

use crate::progress::{ProgressStyle, Watcher};
use crate::{Global, Outcome, print, threads};

/// Arguments of `skysweep ortho`.
#[derive(Debug, clap::Args)]
#[command(
    after_help = "Of several images each cell takes the one that sees it most steeply, after their grey values have been \
                        brought together. Example: skysweep ortho a.tif b.tif --dsm run -o ortho.tif"
)]
pub(crate) struct Args {
    /// The images: anything GDAL reads, with its RPC inside or beside it.
    #[arg(required = true, value_name = "IMAGE")]
    images: Vec<PathBuf>,
    /// Surface model on a projected map, or the folder of a run of skysweep dsm.
    #[arg(long, value_name = "DSM")]
    dsm: PathBuf,
    /// GeoTIFF to write.
    #[arg(short, long, value_name = "OUT.tif")]
    output: PathBuf,
    /// Cell size in metres [default: the surface model's grid].
    #[arg(long, value_name = "METRES")]
    gsd: Option<f64>,
    /// Area in the surface model's map [default: all of it].
    #[arg(long, num_args = 4, value_names = ["X_MIN", "Y_MIN", "X_MAX", "Y_MAX"], allow_negative_numbers = true)]
    bounds: Option<Vec<f64>>,
    /// Corrections of the images' pointing: the report of a run of skysweep dsm, or none [default: those of the run that made
    /// the surface model, for the images that it used].
    #[arg(long, value_name = "report.json|none")]
    corrections: Option<PathBuf>,
    /// What the surface model's heights are above, where the file does not say or is wrong.
    #[arg(long, value_name = "DATUM")]
    dsm_vertical: Option<VerticalDatum>,
    /// How far the surface must stand above a line of sight to hide what is behind, metres.
    #[arg(long, value_name = "METRES", default_value_t = 0.05)]
    tolerance: f64,
    /// Leave the images' grey values as they are.
    #[arg(long)]
    no_balance: bool,
    /// Fill cells that are hidden in every image with what stands before them, instead of no-data.
    #[arg(long)]
    keep_hidden: bool,
    /// Worker threads [default: all cores].
    #[arg(long, value_name = "N")]
    threads: Option<usize>,
    /// Replace files that exist.
    #[arg(long)]
    overwrite: bool,
    /// How progress is shown on stderr.
    #[arg(long, value_enum, default_value_t = ProgressStyle::Bar)]
    progress: ProgressStyle,
    /// Print the report as JSON.
    #[arg(long)]
    json: bool,
}

/// Runs `skysweep ortho`.
pub(crate) fn run(args: &Args, global: Global) -> anyhow::Result<Outcome> {
    output::check(args)?;
    threads::start(args.threads)?;
    let inputs = inputs::Inputs::open(args)?;
    let watcher = Watcher::new(args.progress, global);
    let made = mosaic::make(&inputs, args, &watcher);
    watcher.finish();
    let report = output::write(args, &inputs, &made?)?;
    if args.json {
        print::json(&report)?;
    } else if !global.is_quiet() {
        print::text(&report.text())?;
    }
    Ok(Outcome::Complete)
}
