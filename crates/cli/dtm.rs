//! `skysweep dtm`: the bare ground under a surface model, and heights above it.

use std::path::PathBuf;

use jobs::dtm::DtmConfig;

use crate::progress::RunOptions;
use crate::{Global, Outcome};

/// Arguments of `skysweep dtm`.
#[derive(Debug, clap::Args)]
pub(crate) struct Args {
    /// Surface model on a projected map, or the folder of a run of skysweep dsm.
    surface: PathBuf,
    /// Folder for dtm.tif, height_above_ground.tif, ground.tif and dtm.json.
    #[arg(short, long, value_name = "DIR")]
    output: PathBuf,
    #[command(flatten)]
    run: RunOptions,
}

/// Runs `skysweep dtm`.
pub(crate) fn run(args: &Args, global: Global) -> anyhow::Result<Outcome> {
    let mut config = DtmConfig::new(args.surface.clone(), args.output.clone());
    config.threads = args.run.threads;
    config.overwrite = args.run.overwrite;
    let show = args.run.show;
    let report = show.watch(global, &args.output, |watcher| jobs::dtm::run(&config, watcher))?;
    show.print(global, &report, || report.text())?;
    Ok(Outcome::Complete)
}
