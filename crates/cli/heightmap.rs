//! `skysweep heightmap`: the surface seen from above around a camera, turned to its heading, as a GeoTIFF.
//!
//! One map, or one per row of a list. A map that cannot be made does not stop the others of a list: it is named in the
//! report, and the exit code is 1. `skysweep heightmap unproject` leads back to points
//! or splats.

mod batch;
mod settings;
mod source;
mod tags;
mod tile;
mod unproject;

use std::path::PathBuf;

use anyhow::bail;
use city::Lod;
use crs::{CrsRequest, VerticalDatum};

use crate::progress::ProgressStyle;
use crate::stand::StandArgs;
use crate::{Global, Outcome, threads};

/// Arguments of `skysweep heightmap`.
#[derive(Debug, clap::Args)]
#[command(
    args_conflicts_with_subcommands = true,
    subcommand_negates_reqs = true,
    after_help = "The top of the picture is what lies before the camera, its middle is the camera, and heights are relative to it. \
                  Examples: skysweep heightmap dsm.tif --center 4.36 52.01 --heading 37 -o map.tif; \
                  skysweep heightmap dsm.tif --positions cameras.csv -o maps"
)]
pub(crate) struct Args {
    #[command(subcommand)]
    command: Option<Command>,
    /// Surface model (raster), city model (CityJSON, CityGML, OBJ, PLY) or point cloud (LAS, LAZ, COPC).
    #[arg(required = true, value_name = "SOURCE")]
    source: Option<PathBuf>,
    /// GeoTIFF to write; with --positions the folder for the maps.
    #[arg(short, long, required = true, value_name = "OUT")]
    output: Option<PathBuf>,
    #[command(flatten)]
    make: MakeArgs,
}

#[derive(Debug, clap::Subcommand)]
enum Command {
    /// Turn a height map back into points or splats.
    Unproject(unproject::Args),
}

/// How maps are made.
#[derive(Debug, clap::Args)]
struct MakeArgs {
    #[command(flatten)]
    stand: StandArgs,
    /// Pixels along each side.
    #[arg(long, value_name = "PX", default_value_t = 518)]
    size: usize,
    /// Pixels per metre on the ground.
    #[arg(long, value_name = "PX/M", default_value_t = 2.0)]
    resolution: f64,
    /// Terrain model: the ground under the camera, and the height where SOURCE has none.
    #[arg(long, value_name = "FILE")]
    dtm: Option<PathBuf>,
    /// Divide heights by the scale of the scene: auto (mean distance of the map's points), a number of metres, or none.
    #[arg(long, value_name = "auto|S|none", default_value = "none")]
    normalize: settings::Normalize,
    /// Add a band of confidences (0 to 1): from this raster, or from confidence.tif beside a DSM that skysweep made; for
    /// other sources 1 where SOURCE has a height and 0 where --dtm gave it. "--confidence=FILE" names the raster.
    #[arg(long, value_name = "FILE", num_args = 0..=1, default_missing_value = "auto", require_equals = true)]
    confidence: Option<PathBuf>,
    /// Map to write on: local (a transverse Mercator at the camera, whose metres are those of the ground), utm or EPSG:n.
    #[arg(long, value_name = "CRS", default_value = "local")]
    crs: settings::MapChoice,
    /// How a raster is read between its cells.
    #[arg(long, value_enum, default_value_t = settings::Interpolation::Bilinear)]
    interpolation: settings::Interpolation,
    /// Coordinate system of SOURCE, where the file does not say or is wrong: EPSG:n.
    #[arg(long, value_name = "CRS")]
    source_crs: Option<CrsRequest>,
    /// What SOURCE's heights are above, likewise: ellipsoid, egm96, egm2008 or EPSG:n.
    #[arg(long, value_name = "DATUM")]
    source_vertical: Option<VerticalDatum>,
    /// Level of detail of a city model [default: the highest of each object up to 2.x].
    #[arg(long, value_name = "LOD")]
    lod: Option<Lod>,
    /// Use every object of a city model, not only buildings.
    #[arg(long)]
    all_objects: bool,
    /// Write no picture beside the map.
    #[arg(long)]
    no_preview: bool,
    /// Write pictures beside the maps of a list too.
    #[arg(long, conflicts_with = "no_preview")]
    previews: bool,
    /// Worker threads [default: all cores].
    #[arg(long, value_name = "N")]
    threads: Option<usize>,
    /// Replace maps that exist; without it a list goes on where it was left.
    #[arg(long)]
    overwrite: bool,
    /// How progress is shown on stderr.
    #[arg(long, value_enum, default_value_t = ProgressStyle::Bar)]
    progress: ProgressStyle,
    /// Print the report as JSON.
    #[arg(long)]
    json: bool,
}

/// Runs `skysweep heightmap`.
pub(crate) fn run(args: &Args, global: Global) -> anyhow::Result<Outcome> {
    let (source, output) = match (&args.command, &args.source, &args.output) {
        (Some(Command::Unproject(args)), ..) => return unproject::run(args, global),
        (None, Some(source), Some(output)) => (source, output),
        _ => bail!("expected SOURCE and -o OUT"),
    };
    args.make.stand.check()?;
    threads::start(args.make.threads)?;
    match &args.make.stand.positions {
        Some(positions) => batch::run(&args.make, source, positions, output, global),
        None => tile::run(&args.make, source, output, global),
    }
}
