//! `skysweep products`: point cloud, terrain and what else people open beside a surface model.

use std::path::PathBuf;

use jobs::error::JobError;
use jobs::products::{ProductKind, ProductsConfig};

use crate::error::with_hint;
use crate::options::named;
use crate::progress::RunOptions;
use crate::{Global, Outcome};

/// Arguments of `skysweep products`.
#[derive(Debug, clap::Args)]
#[command(after_help = "The colours come from an ortho of the images of the run. Example: skysweep products run")]
pub(crate) struct Args {
    /// Folder of a run of skysweep dsm.
    folder: PathBuf,
    /// Products to make [default: all].
    #[arg(long, value_name = "PRODUCT,…", value_delimiter = ',', value_parser = named(&ProductKind::CHOICES))]
    only: Option<Vec<ProductKind>>,
    /// Folder for the products [default: products in the folder of the run].
    #[arg(short, long, value_name = "DIR")]
    output: Option<PathBuf>,
    /// Ortho for the colours, on the map of the surface model [default: one of the run's images].
    #[arg(long, value_name = "FILE")]
    ortho: Option<PathBuf>,
    /// Give filled cells points, too, flagged as synthetic.
    #[arg(long)]
    filled: bool,
    /// Step between contour lines, in the unit of the heights, which is that of the vertical datum
    /// [default: from the relief and the cell size].
    #[arg(long, value_name = "STEP")]
    contour_interval: Option<f64>,
    /// Largest vertical distance of the mesh from the cells, metres [default: the median standard
    /// deviation of the heights, between a quarter and the whole of a cell].
    #[arg(long, value_name = "METRES")]
    mesh_tolerance: Option<f64>,
    #[command(flatten)]
    run: RunOptions,
}

/// Runs `skysweep products`.
pub(crate) fn run(args: &Args, global: Global) -> anyhow::Result<Outcome> {
    let mut config = ProductsConfig::new(args.folder.clone());
    config.products = args.only.clone().unwrap_or(config.products);
    config.output.clone_from(&args.output);
    config.ortho.clone_from(&args.ortho);
    config.filled = args.filled;
    config.contour_interval = args.contour_interval;
    config.mesh_tolerance_m = args.mesh_tolerance;
    config.threads = args.run.threads;
    config.overwrite = args.run.overwrite;
    let show = args.run.show;
    let report = show.watch(global, &config.folder(), |watcher| jobs::products::run(&config, watcher));
    let report = report.map_err(hinted)?;
    show.print(global, &report, || report.text())?;
    Ok(Outcome::Complete)
}

/// Adds the option that helps with an error.
pub(crate) fn hinted(error: JobError) -> anyhow::Error {
    let needs_ortho = error.setting() == Some("the ortho");
    with_hint(error, needs_ortho.then_some("--ortho gives one, --only names the products that need no colours"))
}
