//! `skysweep simulate`: a seeded scene seen through RPC cameras, with its exact surface beside.
//!
//! Writes `view_1.tif` … (RPC in the file), with `--multispectral` `ms_1.tif` …, the record
//! `scene.json`, the parameters `scene.toml`, and in `truth/` the rasters, the heights of every
//! image and the buildings at LoD2. With `--flight` also perspective cameras with their pictures,
//! in `cameras`.

use std::path::{Path, PathBuf};

use ::simulate::{PRESETS, SeasonsConfig, SimulationConfig};
use jobs::simulate::SimulateConfig;

use crate::error::{hinted, with_hint};
use crate::progress::RunOptions;
use crate::{Global, Outcome, print};

/// Arguments of `skysweep simulate`.
#[derive(Debug, clap::Args)]
pub(crate) struct Args {
    /// Preset or parameter file (TOML): `--list` names the presets, `--template` prints one as a
    /// file.
    #[arg(value_name = "PRESET|FILE.toml", default_value = "town")]
    scene: String,
    /// Everything random follows from this number.
    #[arg(long, value_name = "N")]
    seed: Option<u64>,
    /// Side of the square area, metres.
    #[arg(long, value_name = "METRES")]
    size: Option<f64>,
    /// Ground sampling distance of the images and of the truth, metres.
    #[arg(long, value_name = "METRES")]
    gsd: Option<f64>,
    /// Number of views.
    #[arg(long, value_name = "N")]
    views: Option<usize>,
    /// Number of dates that the views are shared out over: another sun, other vehicles, other
    /// radiometry on each.
    #[arg(long, value_name = "N")]
    dates: Option<usize>,
    /// Change albedo, fine texture and sharpness from date to date; one date per view unless
    /// --dates says otherwise.
    #[arg(long)]
    seasons: bool,
    /// Also take a multispectral image of each view (ms_1.tif …): blue, green, red and near
    /// infrared on pixels four times as wide.
    #[arg(long)]
    multispectral: bool,
    /// Also write N perspective cameras around the scene with their pictures (a COLMAP dataset in
    /// cameras, in map coordinates), for skysweep priors and train, and the exact surface that they
    /// see.
    #[arg(long, value_name = "N", default_value_t = 0, value_parser = clap::value_parser!(u32).range(0..=10_000))]
    flight: u32,
    /// See the scene from one side only: the cameras of the flight stand between two azimuths,
    /// degrees clockwise from north.
    #[arg(long, num_args = 2, value_names = ["FROM", "TO"], allow_negative_numbers = true, requires = "flight")]
    flight_arc: Vec<f64>,
    /// Also write what perspective cameras see exactly (depths, parts of the scene, pictures) to
    /// truth/cameras: a COLMAP model on the map of the scene, with origin.json.
    #[arg(long, value_name = "FOLDER")]
    cameras: Option<PathBuf>,
    /// Spacing of the points of the exact surface that the flight sees, metres.
    #[arg(long, value_name = "METRES", default_value_t = 0.2, requires = "flight")]
    flight_spacing: f64,
    /// Folder for the images and the truth.
    #[arg(short, long, value_name = "DIR", required_unless_present_any = ["list", "template"])]
    output: Option<PathBuf>,
    #[command(flatten)]
    run: RunOptions,
    /// List the presets and stop.
    #[arg(long)]
    list: bool,
    /// Print the parameters as a TOML file and stop.
    #[arg(long)]
    template: bool,
}

/// Runs `skysweep simulate`.
pub(crate) fn run(args: &Args, global: Global) -> anyhow::Result<Outcome> {
    if args.list {
        let lines = PRESETS.map(|(name, description)| format!("{name:18} {description}\n"));
        print::text(&lines.concat())?;
        return Ok(Outcome::Complete);
    }
    let config = config(args)?;
    match &args.output {
        Some(output) if !args.template => made(config, args, output, global),
        _ => print::text(&config.to_toml()?).map(|()| Outcome::Complete),
    }
}

/// Reads the preset or the file and replaces what the options name.
fn config(args: &Args) -> anyhow::Result<SimulationConfig> {
    let is_file = Path::new(&args.scene).extension().is_some_and(|extension| extension.eq_ignore_ascii_case("toml"));
    let mut config = if is_file {
        jobs::simulate::read_scene(Path::new(&args.scene)).map_err(hinted)?
    } else {
        SimulationConfig::preset(&args.scene)?
    };
    config.seed = args.seed.unwrap_or(config.seed);
    config.size_m = args.size.unwrap_or(config.size_m);
    config.gsd_m = args.gsd.unwrap_or(config.gsd_m);
    config.views = args.views.unwrap_or(config.views);
    config.acquisition.dates = args.dates.unwrap_or(config.acquisition.dates);
    if args.seasons {
        config.seasons = SeasonsConfig::YEAR;
        config.acquisition.dates = args.dates.unwrap_or(config.views);
    }
    if args.multispectral {
        config.multispectral.get_or_insert_default();
    }
    config.validate()?;
    Ok(config)
}

fn made(scene: SimulationConfig, args: &Args, output: &Path, global: Global) -> anyhow::Result<Outcome> {
    let mut config = SimulateConfig::new(scene, output.to_owned());
    config.cameras.clone_from(&args.cameras);
    config.flight = args.flight;
    config.flight_arc_deg = args.flight_arc.first_chunk().copied();
    config.flight_spacing_m = args.flight_spacing;
    config.threads = args.run.threads;
    config.overwrite = args.run.overwrite;
    let show = args.run.show;
    let report = show.watch(global, output, |watcher| jobs::simulate::run(&config, watcher)).map_err(|error| {
        let full = error.setting() == Some("the output folder");
        with_hint(error, full.then_some("choose another folder or pass --overwrite"))
    })?;
    show.print(global, &report, || report.text())?;
    Ok(Outcome::Complete)
}
