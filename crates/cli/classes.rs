//! `skysweep classes`: ground, buildings and vegetation of a surface model.

use std::path::PathBuf;

use jobs::classes::ClassesConfig;

use crate::progress::RunOptions;
use crate::{Global, Outcome};

/// Arguments of `skysweep classes`.
#[derive(Debug, clap::Args)]
pub(crate) struct Args {
    /// Surface model on a projected map, or the folder of a run of skysweep dsm.
    surface: PathBuf,
    /// Folder for classes.tif, roughness.tif and classes.json.
    #[arg(short, long, value_name = "DIR")]
    output: PathBuf,
    /// Vegetation index (NDVI, −1 to 1) on any grid, which overrules the roughness of the surface.
    #[arg(long, value_name = "FILE")]
    ndvi: Option<PathBuf>,
    /// Building index (0 to 1, from skysweep buildings) on any grid, which decides where the
    /// heights are weak.
    #[arg(long, value_name = "FILE")]
    index: Option<PathBuf>,
    #[command(flatten)]
    run: RunOptions,
}

/// Runs `skysweep classes`.
pub(crate) fn run(args: &Args, global: Global) -> anyhow::Result<Outcome> {
    let mut config = ClassesConfig::new(args.surface.clone(), args.output.clone());
    config.vegetation_index.clone_from(&args.ndvi);
    config.building_index.clone_from(&args.index);
    config.threads = args.run.threads;
    config.overwrite = args.run.overwrite;
    let show = args.run.show;
    let report = show.watch(global, &args.output, |watcher| jobs::classes::run(&config, watcher))?;
    show.print(global, &report, || report.text())?;
    Ok(Outcome::Complete)
}
