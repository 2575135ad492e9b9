//! `skysweep simulate`: a seeded town seen through RPC cameras, with its exact surface beside.
//!
//! Writes `view_1.tif` … (16 bits, RPC in the file), `truth/dsm.tif`, `truth/classes.tif` and `scene.json`.

use std::fs;
use std::path::{Path, PathBuf};

use ::simulate::{Simulation, SimulationConfig};
use anyhow::{Context, bail};
use geodesy::Crs;
use io::raster::{Band, BandData, CogRaster, write_cog, write_image_with_rpc};

use crate::Outcome;

/// Arguments of `skysweep simulate`.
#[derive(Debug, clap::Args)]
pub(crate) struct Args {
    /// Everything random follows from this number.
    #[arg(long, value_name = "N", default_value_t = SimulationConfig::default().seed)]
    seed: u64,
    /// Side of the square area, metres.
    #[arg(long, value_name = "M", default_value_t = SimulationConfig::default().size_m)]
    size: f64,
    /// Ground sampling distance of the images and of the truth, metres.
    #[arg(long, value_name = "M", default_value_t = SimulationConfig::default().gsd_m)]
    gsd: f64,
    /// Number of views.
    #[arg(long, value_name = "N", default_value_t = SimulationConfig::default().views)]
    views: usize,
    /// Folder for the images and the truth.
    #[arg(short, long, value_name = "DIR")]
    output: PathBuf,
    /// Replace the files of an earlier simulation.
    #[arg(long)]
    overwrite: bool,
}

/// Runs `skysweep simulate`.
pub(crate) fn run(args: &Args) -> anyhow::Result<Outcome> {
    let config = SimulationConfig {
        seed: args.seed,
        size_m: args.size,
        gsd_m: args.gsd,
        views: args.views,
        ..SimulationConfig::default()
    };
    config.validate()?;
    if !args.overwrite && fs::read_dir(&args.output).is_ok_and(|mut entries| entries.next().is_some()) {
        bail!("the output folder is not empty: choose another or pass --overwrite: {}", args.output.display());
    }
    let truth = args.output.join("truth");
    fs::create_dir_all(&truth).with_context(|| format!("cannot make the output folder: {}", truth.display()))?;
    let simulation = Simulation::new(config)?;
    write(&simulation, &args.output, args.overwrite)?;
    let (buildings, views) = (simulation.scene.blocks().len(), simulation.views.len());
    tracing::info!("{views} views of {buildings} building blocks in {}", args.output.display());
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
