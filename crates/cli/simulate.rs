//! `skysweep simulate`: a seeded town seen through RPC cameras, with its exact surface beside.
//!
//! Writes `view_1.tif` … (16 bits, RPC in the file), `truth/dsm.tif`, `truth/classes.tif` and `scene.json`.

use std::fs;
use std::path::{Path, PathBuf};

use ::simulate::{PRESETS, Simulation, SimulationConfig};
use anyhow::{Context, bail};
use geodesy::Crs;
use io::raster::{Band, BandData, CogRaster, write_cog, write_image_with_rpc};

use crate::Outcome;
use crate::print;

/// Arguments of `skysweep simulate`.
#[derive(Debug, clap::Args)]
pub(crate) struct Args {
    /// Preset or parameter file (TOML): `--list` names the presets, `--template` prints one as a file.
    #[arg(value_name = "PRESET|FILE.toml", default_value = "town")]
    scene: String,
    /// Everything random follows from this number.
    #[arg(long, value_name = "N")]
    seed: Option<u64>,
    /// Side of the square area, metres.
    #[arg(long, value_name = "M")]
    size: Option<f64>,
    /// Ground sampling distance of the images and of the truth, metres.
    #[arg(long, value_name = "M")]
    gsd: Option<f64>,
    /// Number of views.
    #[arg(long, value_name = "N")]
    views: Option<usize>,
    /// Number of dates that the views are shared out over: another sun, other vehicles, other radiometry on each.
    #[arg(long, value_name = "N")]
    dates: Option<usize>,
    /// Folder for the images and the truth.
    #[arg(short, long, value_name = "DIR", required_unless_present_any = ["list", "template"])]
    output: Option<PathBuf>,
    /// Replace the files of an earlier simulation.
    #[arg(long)]
    overwrite: bool,
    /// List the presets and stop.
    #[arg(long)]
    list: bool,
    /// Print the parameters as a TOML file and stop.
    #[arg(long)]
    template: bool,
}

/// Runs `skysweep simulate`.
pub(crate) fn run(args: &Args) -> anyhow::Result<Outcome> {
    if args.list {
        let lines = PRESETS.map(|(name, description)| format!("{name:18} {description}\n"));
        print::text(&lines.concat())?;
        return Ok(Outcome::Complete);
    }
    let config = config(args)?;
    match &args.output {
        Some(output) if !args.template => made(config, output, args.overwrite),
        _ => print::text(&config.to_toml()?).map(|()| Outcome::Complete),
    }
}

/// The parameters: those of the preset or the file, with what the command line says instead.
fn config(args: &Args) -> anyhow::Result<SimulationConfig> {
    let is_file = Path::new(&args.scene).extension().is_some_and(|extension| extension.eq_ignore_ascii_case("toml"));
    let mut config = if is_file { from_file(Path::new(&args.scene))? } else { SimulationConfig::preset(&args.scene)? };
    config.seed = args.seed.unwrap_or(config.seed);
    config.size_m = args.size.unwrap_or(config.size_m);
    config.gsd_m = args.gsd.unwrap_or(config.gsd_m);
    config.views = args.views.unwrap_or(config.views);
    config.acquisition.dates = args.dates.unwrap_or(config.acquisition.dates);
    config.validate()?;
    Ok(config)
}

fn from_file(path: &Path) -> anyhow::Result<SimulationConfig> {
    let text = fs::read_to_string(path).with_context(|| format!("cannot read the file: {}", path.display()))?;
    SimulationConfig::from_toml(&text).with_context(|| format!("in the parameter file: {}", path.display()))
}

fn made(config: SimulationConfig, output: &Path, overwrite: bool) -> anyhow::Result<Outcome> {
    if !overwrite && fs::read_dir(output).is_ok_and(|mut entries| entries.next().is_some()) {
        bail!("the output folder is not empty: choose another or pass --overwrite: {}", output.display());
    }
    let truth = output.join("truth");
    fs::create_dir_all(&truth).with_context(|| format!("cannot make the output folder: {}", truth.display()))?;
    let simulation = Simulation::new(config)?;
    write(&simulation, output, overwrite)?;
    let (buildings, views) = (simulation.scene.blocks().len(), simulation.views.len());
    tracing::info!("{views} views of {buildings} building blocks in {}", output.display());
    Ok(Outcome::Complete)
}

fn write(simulation: &Simulation, folder: &Path, overwrite: bool) -> anyhow::Result<()> {
    for (number, view) in (1..).zip(&simulation.views) {
        let bands = [Band { description: "panchromatic", data: BandData::U16(&view.image) }];
        write_image_with_rpc(folder.join(format!("view_{number}.tif")), &bands, &view.rpc, Some(0.0), overwrite)?;
    }
    let truth = &simulation.truth;
    let raster = |name: &str, band: Band<'_>| {
        let bands = [band];
        let cog = CogRaster::new(&bands, truth.geotransform, Crs::ellipsoidal(truth.epsg));
        write_cog(folder.join("truth").join(name), &cog, overwrite)
    };
    raster("dsm.tif", Band { description: "height_m", data: BandData::F32(&truth.dsm) })?;
    raster("classes.tif", Band { description: "class", data: BandData::U8(&truth.classes) })?;
    write_record(simulation, folder)
}

/// Writes `scene.json` whole or not at all.
fn write_record(simulation: &Simulation, folder: &Path) -> anyhow::Result<()> {
    let path = folder.join("scene.json");
    let part = folder.join(".scene.json.part");
    let text = serde_json::to_string_pretty(&simulation.record())? + "\n";
    fs::write(&part, text)
        .and_then(|()| fs::rename(&part, &path))
        .with_context(|| format!("cannot write the file: {}", path.display()))
}
