//! `skysweep register`: the pointing of a new image corrected against an existing model.

use std::path::PathBuf;

use anyhow::bail;
use crs::VerticalDatum;
use jobs::error::JobError;
use jobs::register::{RegisterConfig, RegisterModel, RegisterOrder};

use crate::corrections::corrections_of;
use crate::error::with_hint;
use crate::options::{Named, named};
use crate::progress::RunOptions;
use crate::{Global, Outcome};

/// Arguments of `skysweep register`.
#[derive(Debug, clap::Args)]
#[command(after_help = "The report is read wherever --corrections is an option. Examples: \
                  skysweep register new.tif --dsm run -o new.json; \
                  skysweep rpc convert new.tif --corrections new.json -o new_RPC.TXT")]
#[command(group = clap::ArgGroup::new("model").args(["dsm", "splats"]).required(true))]
pub(crate) struct Args {
    /// The image: anything GDAL reads, with its RPC inside or beside it.
    #[arg(value_name = "IMAGE")]
    image: PathBuf,
    /// Surface model on a projected map, or the folder of a run of skysweep dsm.
    #[arg(long, value_name = "DSM")]
    dsm: Option<PathBuf>,
    /// Images that show what the surface model looks like [default: those of the run that made it].
    #[arg(long, value_name = "IMAGE", num_args = 1.., requires = "dsm")]
    images: Vec<PathBuf>,
    /// Splats (PLY) with their origin beside them, instead of a surface model.
    #[arg(long, value_name = "SPLATS.ply")]
    splats: Option<PathBuf>,
    /// Report to write (JSON), with the correction.
    #[arg(short, long, value_name = "OUT.json")]
    output: PathBuf,
    /// Pointing corrections of the surface model's images: the report of a run of skysweep dsm, or
    /// none [default: from the run that made the surface model].
    #[arg(long, value_name = "report.json|none")]
    corrections: Option<PathBuf>,
    /// Vertical datum of the surface model, if the file names none or a wrong one.
    #[arg(long, value_name = "DATUM")]
    dsm_vertical: Option<VerticalDatum>,
    /// Largest pointing error that is searched for, pixels.
    #[arg(long, value_name = "PX", default_value_t = 20.0)]
    reach: f64,
    /// What is corrected.
    #[arg(long, value_parser = named(&ORDERS), default_value = "evidence")]
    order: RegisterOrder,
    #[command(flatten)]
    run: RunOptions,
}

/// What is corrected.
const ORDERS: [Named<RegisterOrder>; 4] = [
    ("evidence", RegisterOrder::Evidence, "the least of these that predicts held-out points as well as any"),
    ("shift", RegisterOrder::Shift, "one shift of the whole image"),
    ("drift", RegisterOrder::Drift, "a shift that grows with the line"),
    ("affine", RegisterOrder::Affine, "an affine map in image space"),
];

/// Runs `skysweep register`.
pub(crate) fn run(args: &Args, global: Global) -> anyhow::Result<Outcome> {
    let model = match (&args.dsm, &args.splats) {
        (Some(dsm), _) => RegisterModel::Surface { dsm: dsm.clone(), images: args.images.clone() },
        (None, Some(splats)) => RegisterModel::Splats(splats.clone()),
        (None, None) => bail!("expected --dsm or --splats"),
    };
    let mut config = RegisterConfig::new(args.image.clone(), model, args.output.clone());
    config.corrections = corrections_of(args.corrections.as_deref());
    config.vertical = args.dsm_vertical;
    config.reach_px = args.reach;
    config.order = args.order;
    config.threads = args.run.threads;
    config.overwrite = args.run.overwrite;
    let show = args.run.show;
    let report = show.watch(global, &args.output, |watcher| jobs::register::run(&config, watcher)).map_err(hinted)?;
    show.print(global, &report, || report.text())?;
    Ok(Outcome::Complete)
}

/// Adds the option that helps with an error.
fn hinted(error: JobError) -> anyhow::Error {
    let hint = match error.setting() {
        Some("the images") => Some("give --images"),
        Some("the reach of the search") => Some("see --reach"),
        _ => None,
    };
    with_hint(error, hint)
}
