//! `skysweep ortho`: images laid on a surface model so that every cell shows its own ground point,
//! hidden cells marked.

use std::path::PathBuf;

use crs::VerticalDatum;
use jobs::error::JobError;
use jobs::ortho::OrthoConfig;
use ortho::MosaicRule;

use crate::corrections::corrections_of;
use crate::error::with_hint;
use crate::options::named;
use crate::progress::RunOptions;
use crate::{Global, Outcome};

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
    /// Surface model on a map, or the folder of a run of skysweep dsm.
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
    /// Pointing corrections of the images: the report of a run of skysweep dsm, or none [default:
    /// from the run that made the surface model, for the images that it used].
    #[arg(long, value_name = "report.json|none")]
    corrections: Option<PathBuf>,
    /// Vertical datum of the surface model, if the file names none or a wrong one.
    #[arg(long, value_name = "DATUM")]
    dsm_vertical: Option<VerticalDatum>,
    /// Height by which the surface must stand above a line of sight to hide what is behind it,
    /// metres.
    #[arg(long, value_name = "METRES", default_value_t = 0.05)]
    tolerance: f64,
    /// Leave the images' grey values as they are.
    #[arg(long)]
    no_balance: bool,
    /// How the values of several images become one: those of the steepest image, the same with
    /// feathered seams, or the median.
    #[arg(long, value_parser = named(&MosaicRule::CHOICES), default_value = "best")]
    mosaic: MosaicRule,
    /// Fill cells that are hidden in every image with what hides them, instead of no-data.
    #[arg(long)]
    keep_hidden: bool,
    #[command(flatten)]
    run: RunOptions,
}

/// Runs `skysweep ortho`.
pub(crate) fn run(args: &Args, global: Global) -> anyhow::Result<Outcome> {
    let show = args.run.show;
    let report =
        show.watch(global, &args.output, |watcher| jobs::ortho::run(&args.config(), watcher)).map_err(hinted)?;
    show.print(global, &report, || report.text())?;
    Ok(Outcome::Complete)
}

impl Args {
    fn config(&self) -> OrthoConfig {
        let mut config = OrthoConfig::new(self.images.clone(), self.dsm.clone(), self.output.clone());
        config.cell_m = self.gsd;
        config.bounds = self.bounds.as_ref().and_then(|bounds| bounds.as_slice().try_into().ok());
        config.corrections = corrections_of(self.corrections.as_deref());
        config.surface_vertical = self.dsm_vertical;
        config.tolerance_m = self.tolerance;
        config.balance = !self.no_balance;
        config.mosaic = self.mosaic;
        config.keep_hidden = self.keep_hidden;
        config.threads = self.run.threads;
        config.overwrite = self.run.overwrite;
        config
    }
}

/// Adds the option that helps with an error.
fn hinted(error: JobError) -> anyhow::Error {
    let hint = match error.setting() {
        Some("the balance of grey values") => Some("give --no-balance"),
        Some("the area") => Some("give --bounds or a larger --gsd"),
        Some("the cell size") => Some("see --gsd"),
        Some("the tolerance") => Some("see --tolerance"),
        _ => None,
    };
    with_hint(error, hint)
}
