//! `skysweep groundview`: what cameras and 360° panoramas on the ground see of a surface.
//!
//! The folder: `depth/NAME.npy` (metres; z-depth of perspective cameras, ray length of panoramas, NaN for none),
//! `normal/NAME.npy` (east, north, up of the map), `mask/NAME.png` (255 shows the surface), `sky/NAME.png` (255 is sky) and
//! `previews/NAME.png` (normals and depths to look at), `visibility.tif` (how many cameras see each cell, for rasters),
//! `sparse/0` (a COLMAP model of the perspective cameras with points of the surface), `images` (crops of pictures, where
//! given), `origin.json` (where local positions are counted from, also beside the model) and `report.json`.
//! A row of a list without a view (no surface under it, no picture of it) does not stop the others: it is named in the report, and
//! the exit code is 1. `skysweep groundview compose` lays a rendered ground layer over a satellite layer.

mod compose;
mod output;
mod shots;
mod surface;

use std::path::PathBuf;

use anyhow::{bail, ensure};
use crs::VerticalDatum;

use crate::progress::{ProgressStyle, Watcher};
use crate::stand::StandArgs;
use crate::{Global, Outcome, print, threads};

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
    /// Height map or surface model (raster), or city model (CityJSON, CityGML, OBJ, PLY), on a map in metres.
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
    Compose(compose::Args),
}

/// Which views are made, and how.
#[derive(Debug, clap::Args)]
struct MakeArgs {
    /// Cameras of a COLMAP model on the surface's map, with origin.json beside: what skysweep align writes.
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
    /// Folder with the pictures of the panoramas (ID.png, ID.jpg or ID.tif; ID is panorama for --center): crops are cut from them.
    #[arg(long, value_name = "FOLDER")]
    pictures: Option<PathBuf>,
    /// Points of the surface per perspective camera in the COLMAP model, at most.
    #[arg(long, value_name = "N", default_value_t = 2000)]
    points: usize,
    /// What SURFACE's heights are above, where the file does not say or is wrong: ellipsoid, egm96, egm2008 or EPSG:n.
    #[arg(long, value_name = "DATUM")]
    vertical: Option<VerticalDatum>,
    /// Worker threads [default: all cores].
    #[arg(long, value_name = "N")]
    threads: Option<usize>,
    /// Replace files that exist.
    #[arg(long)]
    overwrite: bool,
    /// How progress is shown on stderr.
    #[arg(long, value_enum, default_value_t = ProgressStyle::Bar)]
    progress: ProgressStyle,
    /// Print the report as JSON.
    #[arg(long)]
    json: bool,
}

/// Runs `skysweep groundview`.
pub(crate) fn run(args: &Args, global: Global) -> anyhow::Result<Outcome> {
    let (surface, output) = match (&args.command, &args.surface, &args.output) {
        (Some(Command::Compose(args)), ..) => return compose::run(args),
        (None, Some(surface), Some(output)) => (surface, output),
        _ => bail!("expected SURFACE and -o OUT"),
    };
    let make = &args.make;
    make.stand.check()?;
    threads::start(make.threads)?;
    ensure!(
        make.overwrite || output.join(output::REPORT).symlink_metadata().is_err(),
        "the folder holds views already: choose another or pass --overwrite: {}",
        output.display()
    );
    let surface = surface::Surface::open(surface, make.vertical)?;
    let shots = shots::Shots::of(make, &surface)?;
    let watcher = Watcher::new(make.progress, global);
    let report = output::write(make, &surface, &shots, output, &watcher);
    watcher.finish();
    let report = report?;
    report.tell_failures();
    if make.json {
        print::json(&report)?;
    } else if !global.is_quiet() {
        print::text(&report.text(output))?;
    }
    Ok(if report.is_complete() { Outcome::Complete } else { Outcome::Partial })
}
