//! `skysweep rpc`: show, use and convert RPC camera models.
//!
//! `project` and `localize` take one point from the options, or many from a file or standard input.
//! A point without an answer gives `nan nan` (in JSON an `error`), a line on standard error, and
//! exit code 1 at the end.

use std::io::{BufRead, Write};
use std::path::{Path, PathBuf};

use camera::ImagePoint;
use formats::rpc::RpcFormat;
use geodesy::LonLatHeight;
use jobs::rpc::{
    RpcConvertConfig, RpcDirection, RpcExportConfig, RpcInfoConfig, RpcLineAnswer, RpcLinesConfig, RpcPointsConfig,
    RpcQuery,
};

use crate::error::{hinted, with_hint};
use crate::options::named;
use crate::progress::{Log, WriteOptions};
use crate::{Global, Outcome, print};

/// The commands of `skysweep rpc`.
#[derive(Debug, clap::Subcommand)]
pub(crate) enum Command {
    /// Show the RPC of a file and its image: size, bands, date, satellite, sun, footprint, format,
    /// offsets and scales, validity box, ground sampling distance, viewing angles.
    Info(InfoArgs),
    /// Project ground points into the image.
    Project(ProjectArgs),
    /// Find the ground point that is seen at an image position, at a given height.
    Localize(LocalizeArgs),
    /// Write the RPC in another format.
    Convert(ConvertArgs),
    /// Write images and cameras as a dataset in the layout of Sat-NeRF, which EOGS reads too.
    Export(ExportArgs),
}

#[derive(Debug, clap::Args)]
pub(crate) struct InfoArgs {
    /// RPC file, or image with an RPC.
    file: PathBuf,
    /// Print JSON for programs.
    #[arg(long)]
    json: bool,
}

#[derive(Debug, clap::Args)]
pub(crate) struct ProjectArgs {
    /// RPC file, or image with an RPC.
    file: PathBuf,
    /// Longitude, degrees.
    #[arg(long, value_name = "DEGREES", requires_all = ["lat", "height"], allow_negative_numbers = true)]
    lon: Option<f64>,
    /// Latitude, degrees.
    #[arg(long, value_name = "DEGREES", requires = "lon", allow_negative_numbers = true)]
    lat: Option<f64>,
    /// Height above the WGS 84 ellipsoid, metres.
    #[arg(long, value_name = "METRES", requires = "lon", allow_negative_numbers = true)]
    height: Option<f64>,
    /// File with a point per line: longitude latitude height; - is standard input [default: -].
    #[arg(long, value_name = "FILE", conflicts_with_all = ["lon", "lat", "height"])]
    points: Option<PathBuf>,
    /// Print one JSON object per point.
    #[arg(long)]
    json: bool,
}

#[derive(Debug, clap::Args)]
pub(crate) struct LocalizeArgs {
    /// RPC file, or image with an RPC.
    file: PathBuf,
    /// Column; 0 is the centre of the first.
    #[arg(long, value_name = "PX", requires_all = ["line", "height"], allow_negative_numbers = true)]
    sample: Option<f64>,
    /// Row; 0 is the centre of the first.
    #[arg(long, value_name = "PX", requires = "sample", allow_negative_numbers = true)]
    line: Option<f64>,
    /// Height above the WGS 84 ellipsoid, metres.
    #[arg(long, value_name = "METRES", requires = "sample", allow_negative_numbers = true)]
    height: Option<f64>,
    /// File with a point per line: sample line height; - is standard input [default: -].
    #[arg(long, value_name = "FILE", conflicts_with_all = ["sample", "line", "height"])]
    points: Option<PathBuf>,
    /// Print one JSON object per point.
    #[arg(long)]
    json: bool,
}

#[derive(Debug, clap::Args)]
pub(crate) struct ConvertArgs {
    /// RPC file, or image with an RPC.
    file: PathBuf,
    /// File to write.
    #[arg(short, long, value_name = "OUT")]
    output: PathBuf,
    /// Format to write [default: by the ending of OUT: .txt, .rpb, .json, or .tif for the image
    /// again with the RPC in its tag].
    #[arg(long, value_parser = named(&RpcFormat::CHOICES))]
    format: Option<RpcFormat>,
    /// Include the pointing correction of the image: the report of skysweep register or dsm, or the
    /// folder of a run of skysweep dsm.
    #[arg(long, value_name = "report.json|RUN")]
    corrections: Option<PathBuf>,
    /// Replace OUT where it exists.
    #[arg(long)]
    overwrite: bool,
}

#[derive(Debug, clap::Args)]
#[command(
    after_help = "Of a run, the images are cut to the ground of its surface model, the RPCs include its pointing \
                  corrections, and the heights are those of the surface. The trainers then read DIR/cameras as the \
                  folder of the cameras and DIR/images as that of the images."
)]
pub(crate) struct ExportArgs {
    /// Folder of a run of skysweep dsm, or images with RPCs, their folder, or a quoted pattern.
    #[arg(value_name = "RUN|IMAGE", required = true)]
    inputs: Vec<PathBuf>,
    /// Folder for the dataset.
    #[arg(short, long, value_name = "DIR")]
    output: PathBuf,
    /// Lowest and highest height of the scene above the ellipsoid, metres [default: those of the
    /// surface model of the run].
    #[arg(long, num_args = 2, value_names = ["LO", "HI"], allow_negative_numbers = true)]
    height_range: Vec<f64>,
    /// Keep every Nth image for tests, from the first one by name; 0 keeps none.
    #[arg(long, value_name = "N", default_value_t = 8)]
    hold_out: usize,
    /// Where the sun stood in images that do not say: its azimuth, clockwise from north, and its
    /// elevation, degrees.
    #[arg(long, num_args = 2, value_names = ["AZIMUTH", "ELEVATION"])]
    sun: Vec<f64>,
    #[command(flatten)]
    write: WriteOptions,
}

/// Runs `skysweep rpc`.
pub(crate) fn run(command: &Command, global: Global) -> anyhow::Result<Outcome> {
    match command {
        Command::Info(args) => info(args, global),
        Command::Project(args) => project(args),
        Command::Localize(args) => localize(args),
        Command::Convert(args) => convert(args),
        Command::Export(args) => export(args, global),
    }
}

fn info(args: &InfoArgs, global: Global) -> anyhow::Result<Outcome> {
    let report = jobs::rpc::info(&RpcInfoConfig::new(args.file.clone()), &Log).map_err(hinted)?;
    tracing::info!("{}: {}", report.source, report.format);
    print::report(args.json, !global.is_quiet(), &report, || report.text())?;
    Ok(Outcome::Complete)
}

fn convert(args: &ConvertArgs) -> anyhow::Result<Outcome> {
    let mut config = RpcConvertConfig::new(args.file.clone(), args.output.clone());
    config.overwrite = args.overwrite;
    config.format = args.format;
    config.corrections.clone_from(&args.corrections);
    let report = jobs::rpc::convert(&config, &Log).map_err(|error| {
        let hint = match error.setting() {
            Some("the format") => Some("give --format text, rpb or json"),
            _ => None,
        };
        with_hint(error, hint)
    })?;
    tracing::info!("{}: {}", report.source.display(), report.source_format);
    Ok(Outcome::Complete)
}

fn export(args: &ExportArgs, global: Global) -> anyhow::Result<Outcome> {
    let mut config = RpcExportConfig::new(args.inputs.clone(), args.output.clone());
    config.height_range_m = args.height_range.first_chunk().copied();
    config.hold_out = args.hold_out;
    config.sun_deg = args.sun.first_chunk().copied();
    config.overwrite = args.write.overwrite;
    let watched = args.write.show.watch(global, &args.output, |watcher| jobs::rpc::export(&config, watcher));
    let report = watched.map_err(|error| {
        let hint = match error.setting() {
            Some("the range of heights of the images") => Some("give --height-range LO HI"),
            Some("the sun") => Some("give --sun AZIMUTH ELEVATION"),
            Some("the output folder") => Some("choose another folder or pass --overwrite"),
            _ => None,
        };
        with_hint(error, hint)
    })?;
    args.write.show.print(global, &report, || report.text())?;
    Ok(Outcome::Complete)
}

fn project(args: &ProjectArgs) -> anyhow::Result<Outcome> {
    let query = match (args.lon, args.lat, args.height) {
        (Some(lon), Some(lat), Some(height)) => Some(RpcQuery::Project(LonLatHeight::new(lon, lat, height))),
        _ => None,
    };
    answer(&args.file, RpcDirection::Project, query, args.points.as_deref(), args.json)
}

fn localize(args: &LocalizeArgs) -> anyhow::Result<Outcome> {
    let query = match (args.sample, args.line, args.height) {
        (Some(sample), Some(line), Some(height_m)) => {
            Some(RpcQuery::Localize { image: ImagePoint::new(sample, line), height_m })
        }
        _ => None,
    };
    answer(&args.file, RpcDirection::Localize, query, args.points.as_deref(), args.json)
}

fn answer(
    file: &Path,
    direction: RpcDirection,
    query: Option<RpcQuery>,
    points: Option<&Path>,
    json: bool,
) -> anyhow::Result<Outcome> {
    if let Some(query) = query {
        let report = jobs::rpc::points(&RpcPointsConfig::new(file.to_owned(), vec![query]), &Log).map_err(hinted)?;
        let lines: String = report.points.iter().map(|point| point.line(direction, json) + "\n").collect();
        print::text(&lines)?;
        return Ok(Outcome::Complete);
    }
    let mut input: Box<dyn BufRead> = match points.filter(|path| *path != Path::new("-")) {
        Some(path) => jobs::rpc::open_lines(path).map_err(hinted)?,
        None => Box::new(std::io::stdin().lock()),
    };
    let mut output = std::io::BufWriter::new(std::io::stdout().lock());
    let mut receive = |answer: RpcLineAnswer| {
        if let Err(error) = &answer.point {
            tracing::warn!("line {}: {error}", answer.line);
        }
        writeln!(output, "{}", answer.text(direction, json))
    };
    let config = RpcLinesConfig::new(file.to_owned(), direction);
    let report = jobs::rpc::answer_lines(&config, &mut *input, &mut receive, &Log).map_err(hinted)?;
    output.flush()?;
    if report.failed == 0 {
        return Ok(Outcome::Complete);
    }
    Ok(Outcome::Partial(format!("{} points have no answer", report.failed)))
}
