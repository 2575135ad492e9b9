//! `skysweep heightmap`: the surface seen from above around a camera, turned to its heading, as a
//! GeoTIFF.
//!
//! The command makes one map, or one per row of a list. A map of a list that cannot be made does
//! not stop the others: it is named in the report, and the exit code is 1. `skysweep heightmap
//! unproject` turns a map back into points or splats.

use std::path::{Path, PathBuf};

use anyhow::bail;
use city::Lod;
use crs::{CrsRequest, VerticalDatum};
use heightmap::Reading;
use jobs::error::JobError;
use jobs::heightmap::{ConfidenceSource, HeightMapConfig, MapChoice, Normalization, PointAxes, UnprojectConfig};

use crate::corrections::code_of;
use crate::error::with_hint;
use crate::options::named;
use crate::progress::{RunOptions, WriteOptions};
use crate::stand::StandArgs;
use crate::{Global, Outcome};

/// Failed rows that are printed one by one.
const SHOWN: usize = 20;

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
    /// Surface model (raster, or the folder of a run of skysweep dsm), city model (CityJSON,
    /// CityGML, OBJ, PLY) or point cloud (LAS, LAZ, COPC).
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
    Unproject(UnprojectArgs),
}

/// Arguments of `skysweep heightmap unproject`.
#[derive(Debug, clap::Args)]
struct UnprojectArgs {
    /// Height map that skysweep made.
    map: PathBuf,
    /// File to write: .ply (metres from the camera) or .las (UTM, heights above the ellipsoid).
    #[arg(short, long, value_name = "OUT")]
    output: PathBuf,
    /// Axes of points in a PLY.
    #[arg(long, value_parser = named(&PointAxes::CHOICES), default_value = "world")]
    frame: PointAxes,
    /// Write Gaussian splats as 3DGS viewers and trainers read them (.ply, its origin beside it),
    /// one for each pixel.
    #[arg(long)]
    splats: bool,
    /// Picture of the map's own pixels that gives the splats their colours [default: grey].
    #[arg(long, value_name = "IMAGE", requires = "splats")]
    picture: Option<PathBuf>,
    /// Merge splats whose heights are within this distance of one plane, and whose colours are
    /// alike.
    #[arg(long, value_name = "METRES", requires = "splats")]
    merge: Option<f64>,
    #[command(flatten)]
    write: WriteOptions,
}

/// How maps are made.
#[derive(Debug, clap::Args)]
#[command(mut_arg("overwrite", |arg| {
    arg.help("Replace maps that exist; without it a list goes on where an earlier run was stopped")
}))]
pub(crate) struct MakeArgs {
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
    /// Divide heights by the scale of the scene: auto (mean distance of the map's points), a number
    /// of metres, or none.
    #[arg(long, value_name = "auto|S|none", default_value = "none")]
    normalize: Normalization,
    /// Add a band of confidences (0 to 1): from this raster, or from confidence.tif beside a DSM
    /// that skysweep made; for other sources 1 where SOURCE has a height and 0 where --dtm gave it.
    /// "--confidence=FILE" names the raster.
    #[arg(long, value_name = "FILE", num_args = 0..=1, default_missing_value = "auto", require_equals = true)]
    confidence: Option<PathBuf>,
    /// Map to write on: local (a transverse Mercator at the camera, whose metres are those of the
    /// ground), utm or EPSG:n.
    #[arg(long, value_name = "CRS", default_value = "local")]
    crs: MapChoice,
    /// Interpolation between the cells of a raster.
    #[arg(long, value_parser = named(&Reading::CHOICES), default_value = "bilinear")]
    interpolation: Reading,
    /// Coordinate system of SOURCE, if the file names none or a wrong one: EPSG:n.
    #[arg(long, value_name = "CRS")]
    source_crs: Option<CrsRequest>,
    /// Vertical datum of SOURCE, likewise: ellipsoid, egm96, egm2008 or EPSG:n.
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
    #[command(flatten)]
    pub(crate) run: RunOptions,
}

/// Runs `skysweep heightmap`.
pub(crate) fn run(args: &Args, global: Global) -> anyhow::Result<Outcome> {
    match (&args.command, &args.source, &args.output) {
        (Some(Command::Unproject(args)), ..) => unproject(args, global),
        (None, Some(source), Some(output)) => make(&args.make, source, output, global),
        _ => bail!("expected SOURCE and -o OUT"),
    }
}

fn make(args: &MakeArgs, source: &Path, output: &Path, global: Global) -> anyhow::Result<Outcome> {
    let config = config(args, source, output)?;
    let report =
        args.run.show.watch(global, output, |watcher| jobs::heightmap::run(&config, watcher)).map_err(hinted)?;
    let failed = report.failures();
    failed.iter().take(SHOWN).for_each(|(id, reason)| tracing::error!("{id}: {reason}"));
    args.run.show.print(global, &report, || report.text())?;
    let what = || format!("{} height maps could not be made", failed.len());
    Ok(if failed.is_empty() { Outcome::Complete } else { Outcome::Partial(what()) })
}

/// Returns the configuration of maps.
pub(crate) fn config(args: &MakeArgs, source: &Path, output: &Path) -> anyhow::Result<HeightMapConfig> {
    let Some(stand) = args.stand.config() else {
        bail!("no position: give --center LON LAT, --camera FILE or --positions FILE");
    };
    let mut config = HeightMapConfig::new(source.to_owned(), output.to_owned(), stand);
    config.size_px = args.size;
    config.resolution_px_per_m = args.resolution;
    config.terrain = args.dtm.clone();
    config.normalization = args.normalize;
    config.confidence = match &args.confidence {
        None => ConfidenceSource::None,
        Some(word) if word == Path::new("auto") => ConfidenceSource::Automatic,
        Some(raster) => ConfidenceSource::Raster(raster.clone()),
    };
    config.map = args.crs;
    config.interpolation = args.interpolation;
    let (epsg, datum) = code_of(args.source_crs, "--source-crs")?;
    config.source_epsg = epsg;
    config.source_vertical = args.source_vertical.or(datum);
    config.lod = args.lod;
    config.all_objects = args.all_objects;
    config.previews = if args.stand.positions.is_some() { args.previews } else { !args.no_preview };
    config.threads = args.run.threads;
    config.overwrite = args.run.overwrite;
    Ok(config)
}

fn unproject(args: &UnprojectArgs, global: Global) -> anyhow::Result<Outcome> {
    let mut config = UnprojectConfig::new(args.map.clone(), args.output.clone());
    config.axes = args.frame;
    config.splats = args.splats;
    config.picture = args.picture.clone();
    config.merge_m = args.merge;
    config.overwrite = args.write.overwrite;
    let show = args.write.show;
    let report = show.watch(global, &args.output, |watcher| jobs::heightmap::unproject(&config, watcher));
    let report = report.map_err(hinted)?;
    show.print(global, &report, || report.text())?;
    Ok(Outcome::Complete)
}

/// Adds the option that helps with an error.
fn hinted(error: JobError) -> anyhow::Error {
    let hint = hint(&error);
    with_hint(error, hint)
}

/// Returns the option that helps with an error.
pub(crate) fn hint(error: &JobError) -> Option<&'static str> {
    match error.setting()? {
        "the coordinate system of the source" => Some("give --source-crs"),
        "the city model" => Some("skysweep city info tells why"),
        "the heading" | "the height of the camera" | "the height of the camera above the ground" => {
            Some("see --heading, --ground-offset and --camera-height")
        }
        "the bend of the map" => Some("give --crs local"),
        "the coordinate system of the map" => Some("give --crs local, utm or another projected EPSG code"),
        "the vertical datum of the source" => Some("--source-vertical ellipsoid takes the heights as they are"),
        "the ground" => Some("give --dtm or --camera-height"),
        "the axes of the splats" => Some("give --frame world"),
        _ => None,
    }
}
