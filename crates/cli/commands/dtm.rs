//! `skysweep dtm`: the bare ground under a surface model, and heights above it.

use std::path::PathBuf;

use jobs::dtm::DtmConfig;
use terrain::GroundConfig;

use crate::error::hinted;
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
    /// Width of the widest object, metres: large halls and closed blocks of houses.
    #[arg(long, value_name = "METRES", default_value_t = GroundConfig::default().widest_object_m)]
    widest_object: f64,
    /// Slope of open ground, rise per run: 0.15 is 15 %. Part of the place's own slope is added.
    #[arg(long, value_name = "RISE_PER_RUN", default_value_t = GroundConfig::default().slope)]
    slope: f64,
    #[command(flatten)]
    run: RunOptions,
}

/// Runs `skysweep dtm`.
pub(crate) fn run(args: &Args, global: Global) -> anyhow::Result<Outcome> {
    let mut config = DtmConfig::new(args.surface.clone(), args.output.clone());
    config.terrain.widest_object_m = args.widest_object;
    config.terrain.slope = args.slope;
    config.threads = args.run.threads;
    config.overwrite = args.run.overwrite;
    let show = args.run.show;
    let report = show.watch(global, &args.output, |watcher| jobs::dtm::run(&config, watcher)).map_err(hinted)?;
    show.print(global, &report, || report.text())?;
    let none = "no cell shows the ground; the outputs hold none".to_owned();
    Ok(if report.cells_ground == 0 { Outcome::Partial(none) } else { Outcome::Complete })
}
