//! `skysweep buildings`: a geometric index of buildings in one image, in its pixels or on a surface
//! model.

use std::path::PathBuf;

use crs::VerticalDatum;
use jobs::buildings::BuildingMapConfig;
use jobs::error::JobError;

use crate::corrections::corrections_of;
use crate::error::with_hint;
use crate::progress::RunOptions;
use crate::{Global, Outcome};

/// Arguments of `skysweep buildings`.
#[derive(Debug, clap::Args)]
#[command(after_help = "Example: skysweep buildings a.tif --dsm run -o index.tif && \
                        skysweep classes run --index index.tif -o classes")]
pub(crate) struct Args {
    /// The image: anything GDAL reads, with an RPC inside or beside it, or on a projected map.
    image: PathBuf,
    /// GeoTIFF to write: 0 to 1, in the pixels of the image, with its RPC or its map.
    #[arg(short, long, value_name = "OUT.tif")]
    output: PathBuf,
    /// Surface model on a map, or the folder of a run of skysweep dsm, to lay the index
    /// on.
    #[arg(long, value_name = "DSM")]
    dsm: Option<PathBuf>,
    /// Pointing correction of the image: the report of a run of skysweep dsm, or none [default:
    /// from the run that made the surface model, if it used the image].
    #[arg(long, value_name = "report.json|none", requires = "dsm")]
    corrections: Option<PathBuf>,
    /// Vertical datum of the surface model, if the file names none or a wrong one.
    #[arg(long, value_name = "DATUM", requires = "dsm")]
    dsm_vertical: Option<VerticalDatum>,
    /// Ground sampling distance of the image in metres [default: from its RPC or its map].
    #[arg(long, value_name = "METRES")]
    gsd: Option<f64>,
    #[command(flatten)]
    run: RunOptions,
}

/// Runs `skysweep buildings`.
pub(crate) fn run(args: &Args, global: Global) -> anyhow::Result<Outcome> {
    let mut config = BuildingMapConfig::new(args.image.clone(), args.output.clone());
    config.surface.clone_from(&args.dsm);
    config.corrections = corrections_of(args.corrections.as_deref());
    config.surface_vertical = args.dsm_vertical;
    config.gsd_m = args.gsd;
    config.threads = args.run.threads;
    config.overwrite = args.run.overwrite;
    let show = args.run.show;
    let report = show.watch(global, &args.output, |watcher| jobs::buildings::run(&config, watcher)).map_err(hinted)?;
    show.print(global, &report, || report.text())?;
    Ok(Outcome::Complete)
}

/// Adds the option that helps with an error.
fn hinted(error: JobError) -> anyhow::Error {
    let hint = match error.setting() {
        Some("the scale of the image") => Some("give --gsd"),
        Some("the ground sampling distance") => Some("see --gsd"),
        _ => None,
    };
    with_hint(error, hint)
}
