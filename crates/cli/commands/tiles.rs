//! `skysweep tiles`: for each camera position a folder with a height map, an ortho on the same
//! pixels, and the cameras.

use std::path::PathBuf;

use jobs::error::JobError;
use jobs::tiles::TilesConfig;
use ortho::MosaicRule;

use crate::commands::heightmap::{self, MakeArgs};
use crate::corrections::corrections_of;
use crate::error::with_hint;
use crate::options::named;
use crate::{Global, Outcome};

/// Failed positions that are printed one by one.
const SHOWN: usize = 20;

/// Arguments of `skysweep tiles`.
#[derive(Debug, clap::Args)]
#[command(
    after_help = "Each tile is a folder with height.tif, ortho.tif, ortho_mask.tif, ortho.png and tile.json; tiles.json lists \
                  them. Example: skysweep tiles run --positions cameras.csv --confidence -o pairs"
)]
pub(crate) struct Args {
    /// Surface model (raster, or the folder of a run of skysweep dsm), city model (CityJSON,
    /// CityGML, OBJ, PLY) or point cloud (LAS, LAZ, COPC).
    #[arg(value_name = "SOURCE")]
    source: PathBuf,
    /// Folder for the tiles.
    #[arg(short, long, value_name = "DIR")]
    output: PathBuf,
    /// Satellite images with RPCs [default: those of the run that made the surface model].
    #[arg(long, value_name = "IMAGE", num_args = 1..)]
    images: Vec<PathBuf>,
    /// Pointing corrections of the images: the report of a run of skysweep dsm, or none [default:
    /// from the run that made the surface model, for the images that it used].
    #[arg(long, value_name = "report.json|none")]
    corrections: Option<PathBuf>,
    /// How the values of several images become one: those of the steepest image, the same with
    /// feathered seams, or the median.
    #[arg(long, value_parser = named(&MosaicRule::CHOICES), default_value = "best")]
    mosaic: MosaicRule,
    #[command(flatten)]
    maps: MakeArgs,
}

/// Runs `skysweep tiles`.
pub(crate) fn run(args: &Args, global: Global) -> anyhow::Result<Outcome> {
    let mut config = TilesConfig::new(heightmap::config(&args.maps, &args.source, &args.output)?);
    config.images.clone_from(&args.images);
    config.corrections = corrections_of(args.corrections.as_deref());
    config.mosaic = args.mosaic;
    let show = args.maps.run.show;
    let report = show.watch(global, &args.output, |watcher| jobs::tiles::run(&config, watcher)).map_err(hinted)?;
    let failed = report.failures();
    failed.iter().take(SHOWN).for_each(|(id, reason)| tracing::error!("{id}: {reason}"));
    show.print(global, &report, || report.text())?;
    let what = || format!("{} tiles could not be made", failed.len());
    Ok(if failed.is_empty() { Outcome::Complete } else { Outcome::Partial(what()) })
}

/// Adds the option that helps with an error.
fn hinted(error: JobError) -> anyhow::Error {
    let hint = match error.setting() {
        Some("the images") => Some("give --images"),
        _ => heightmap::hint(&error),
    };
    with_hint(error, hint)
}
