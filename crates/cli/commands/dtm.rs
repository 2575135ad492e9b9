//! `skysweep dtm`: the bare ground under a surface model, and heights above it.

use std::path::PathBuf;

use crs::VerticalDatum;
use jobs::dtm::DtmConfig;

use crate::error::hinted;
use crate::ground::GroundArgs;
use crate::progress::RunOptions;
use crate::{Global, Outcome};

/// Arguments of `skysweep dtm`.
#[derive(Debug, clap::Args)]
pub(crate) struct Args {
    /// Surface model on a map with square cells, or the folder of a run of skysweep dsm.
    surface: PathBuf,
    /// Folder for dtm.tif, height_above_ground.tif, ground.tif and dtm.json.
    #[arg(short, long, value_name = "DIR")]
    output: PathBuf,
    /// Vertical datum of the surface model, if the file names none or a wrong one.
    #[arg(long, value_name = "DATUM")]
    dsm_vertical: Option<VerticalDatum>,
    #[command(flatten)]
    ground: GroundArgs,
    #[command(flatten)]
    run: RunOptions,
}

/// Runs `skysweep dtm`.
pub(crate) fn run(args: &Args, global: Global) -> anyhow::Result<Outcome> {
    let mut config = DtmConfig::new(args.surface.clone(), args.output.clone());
    config.surface_vertical = args.dsm_vertical;
    config.terrain = args.ground.config();
    config.threads = args.run.threads;
    config.overwrite = args.run.overwrite;
    let show = args.run.show;
    let report = show.watch(global, &args.output, |watcher| jobs::dtm::run(&config, watcher)).map_err(hinted)?;
    show.print(global, &report, || report.text())?;
    let none = "no cell shows the ground; the outputs hold none".to_owned();
    Ok(if report.cells_ground == 0 { Outcome::Partial(none) } else { Outcome::Complete })
}
