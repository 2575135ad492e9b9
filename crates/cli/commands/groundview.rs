//! `skysweep groundview`: what cameras and 360° panoramas on the ground see of a surface.
//!
//! A row of a list without a view does not stop the others: it is named in the report, and the exit
//! code is 1. `skysweep groundview compose` lays a rendered ground layer over a satellite layer.

use std::path::{Path, PathBuf};

use anyhow::bail;
use crs::VerticalDatum;
use jobs::error::JobError;
use jobs::groundview::{ComposeConfig, GroundCameras, GroundViewConfig};

use crate::error::with_hint;
use crate::interrupt::{self, Interruptible};
use crate::progress::{Log, RunOptions};
use crate::stand::StandArgs;
use crate::{Global, Outcome};

/// Failed views that are printed one by one.
const SHOWN: usize = 20;

/// Arguments of `skysweep groundview`.
#[derive(Debug, clap::Args)]
#[command(
    args_conflicts_with_subcommands = true,
    subcommand_negates_reqs = true,
    after_help = "Examples: skysweep groundview map.tif --center 4.36 52.01 --heading 37 -o views; \
                  skysweep groundview dsm.tif --cameras aligned -o views"
)]
pub(crate) struct Args {
    #[command(subcommand)]
    command: Option<Command>,
    /// Height map or surface model (raster, or the folder of a run of skysweep dsm), or city model
    /// (CityJSON, CityGML, OBJ, PLY), on a map in metres.
    #[arg(required = true, value_name = "SURFACE")]
    surface: Option<PathBuf>,
    /// Folder to write.
    #[arg(short, long, required = true, value_name = "OUT")]
    output: Option<PathBuf>,
    #[command(flatten)]
    make: MakeArgs,
}

#[derive(Debug, clap::Subcommand)]
enum Command {
    /// Lay a rendered ground layer over a satellite layer.
    Compose(ComposeArgs),
}

/// Arguments of `skysweep groundview compose`.
#[derive(Debug, clap::Args)]
#[command(
    after_help = "C = C_ground + (1 - alpha) C_sat: the ground layer as splat renderers leave it, weighted by its opacity."
)]
struct ComposeArgs {
    /// Colours of the ground layer.
    ground: PathBuf,
    /// Its opacity (0 to the largest value of the file's type, or 0 to 1 in floats).
    alpha: PathBuf,
    /// Colours of the satellite layer.
    satellite: PathBuf,
    /// PNG to write.
    #[arg(short, long, value_name = "OUT.png")]
    output: PathBuf,
    /// Replace a file that exists.
    #[arg(long)]
    overwrite: bool,
}

/// Cameras and outputs of the views.
#[derive(Debug, clap::Args)]
struct MakeArgs {
    /// Cameras of a COLMAP model on the surface's map, with origin.json, as skysweep align writes
    /// it.
    #[arg(long, value_name = "FOLDER", conflicts_with_all = ["center", "camera", "positions"])]
    cameras: Option<PathBuf>,
    #[command(flatten)]
    stand: StandArgs,
    /// Columns of a panorama; it has half as many rows.
    #[arg(long, value_name = "PX", default_value_t = 1024)]
    width: usize,
    /// Perspective crops of each panorama, evenly around from its heading on.
    #[arg(long, value_name = "N", default_value_t = 4)]
    crops: usize,
    /// Pixels along each side of a crop.
    #[arg(long, value_name = "PX", default_value_t = 512)]
    crop_size: usize,
    /// Field of view of a crop, degrees.
    #[arg(long, value_name = "DEGREES", default_value_t = 90.0)]
    fov: f64,
    /// Folder with the pictures of the panoramas (ID.png, ID.jpg or ID.tif; ID is panorama for
    /// --center): crops are cut from them.
    #[arg(long, value_name = "FOLDER")]
    pictures: Option<PathBuf>,
    /// Points of the surface per perspective camera in the COLMAP model, at most.
    #[arg(long, value_name = "N", default_value_t = 2000)]
    points: usize,
    /// Vertical datum of SURFACE, if the file names none or a wrong one: ellipsoid, egm96, egm2008
    /// or EPSG:n.
    #[arg(long, value_name = "DATUM", alias = "vertical")]
    surface_vertical: Option<VerticalDatum>,
    #[command(flatten)]
    run: RunOptions,
}

/// Runs `skysweep groundview`.
pub(crate) fn run(args: &Args, global: Global) -> anyhow::Result<Outcome> {
    match (&args.command, &args.surface, &args.output) {
        (Some(Command::Compose(args)), ..) => compose(args),
        (None, Some(surface), Some(output)) => make(&args.make, surface, output, global),
        _ => bail!("expected SURFACE and -o OUT"),
    }
}

fn make(args: &MakeArgs, surface: &Path, output: &Path, global: Global) -> anyhow::Result<Outcome> {
    let config = config(args, surface, output)?;
    let report =
        args.run.show.watch(global, output, |watcher| jobs::groundview::run(&config, watcher)).map_err(hinted)?;
    report.failed.iter().take(SHOWN).for_each(|failure| tracing::error!("{}: {}", failure.id, failure.reason));
    args.run.show.print(global, &report, || report.text())?;
    let what = || format!("{} views could not be made", report.failed.len());
    Ok(if report.is_complete() { Outcome::Complete } else { Outcome::Partial(what()) })
}

fn config(args: &MakeArgs, surface: &Path, output: &Path) -> anyhow::Result<GroundViewConfig> {
    let cameras = match (&args.cameras, args.stand.config()) {
        (Some(folder), _) => GroundCameras::Model(folder.clone()),
        (None, Some(stand)) => GroundCameras::Panoramas(stand),
        _ => bail!("no cameras: give --cameras FOLDER, --center LON LAT, --camera FILE or --positions FILE"),
    };
    let mut config = GroundViewConfig::new(surface.to_owned(), output.to_owned(), cameras);
    config.panorama_width_px = args.width;
    config.crops = args.crops;
    config.crop_size_px = args.crop_size;
    config.crop_fov_deg = args.fov;
    config.pictures = args.pictures.clone();
    config.points_per_view = args.points;
    config.surface_vertical = args.surface_vertical;
    config.threads = args.run.threads;
    config.overwrite = args.run.overwrite;
    Ok(config)
}

fn compose(args: &ComposeArgs) -> anyhow::Result<Outcome> {
    let (ground, alpha, satellite) = (args.ground.clone(), args.alpha.clone(), args.satellite.clone());
    let mut config = ComposeConfig::new(ground, alpha, satellite, args.output.clone());
    config.overwrite = args.overwrite;
    interrupt::listen();
    jobs::groundview::compose(&config, &Interruptible(&Log)).map_err(hinted)?;
    Ok(Outcome::Complete)
}

/// Adds the option that helps with an error.
fn hinted(error: JobError) -> anyhow::Error {
    let hint = match error.setting() {
        Some("the ground under the camera") => Some("give --camera-height"),
        Some("the city model") => Some("skysweep city info tells why"),
        Some("the cameras") => Some("skysweep align brings cameras to a map, --crs names it"),
        Some("the heading" | "the height of the camera" | "the height of the camera above the ground") => {
            Some("see --heading, --ground-offset and --camera-height")
        }
        Some("the width of a panorama") => Some("see --width"),
        Some("the size of a crop") => Some("see --crop-size"),
        Some("the field of view") => Some("see --fov"),
        Some("the number of crops") => Some("see --crops"),
        _ => None,
    };
    with_hint(error, hint)
}
