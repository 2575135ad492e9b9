//! `skysweep simulate`: a seeded scene seen through RPC cameras, with its exact surface beside.
//!
//! Writes `view_1.tif` … (RPC in the file), the record `scene.json`, the parameters `scene.toml`, and in `truth/` the
//! rasters, the heights of every image and the buildings at LoD2. With `--flight` also perspective cameras, in
//! `cameras/sparse/0`.

use std::fs;
use std::path::{Path, PathBuf};

use ::simulate::{PRESETS, Simulation, SimulationConfig, View};
use anyhow::{Context, bail};
use crs::Crs;
use io::citymodel::{CityJsonOptions, write_cityjson};
use io::colmap::{self, ColmapEncoding, ColmapModel, ColmapView};
use io::raster::{Band, BandData, CogRaster, write_cog, write_image_with_rpc};

use crate::print;
use crate::progress::{ProgressStyle, Watcher};
use crate::{Global, Outcome};

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
    /// Also write N perspective cameras around the scene (a COLMAP model in cameras/sparse/0, in map coordinates), for skysweep
    /// priors and the trainers that it prepares.
    #[arg(long, value_name = "N", default_value_t = 0, value_parser = clap::value_parser!(u32).range(0..=10_000))]
    flight: u32,
    /// Folder for the images and the truth.
    #[arg(short, long, value_name = "DIR", required_unless_present_any = ["list", "template"])]
    output: Option<PathBuf>,
    /// Replace the files of an earlier simulation.
    #[arg(long)]
    overwrite: bool,
    /// How progress is shown.
    #[arg(long, value_name = "STYLE", value_enum, default_value = "bar")]
    progress: ProgressStyle,
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

fn made(config: SimulationConfig, args: &Args, output: &Path, global: Global) -> anyhow::Result<Outcome> {
    if !args.overwrite && fs::read_dir(output).is_ok_and(|mut entries| entries.next().is_some()) {
        bail!("the output folder is not empty: choose another or pass --overwrite: {}", output.display());
    }
    let truth = output.join("truth");
    fs::create_dir_all(&truth).with_context(|| format!("cannot make the output folder: {}", truth.display()))?;
    let watcher = Watcher::new(args.progress, global);
    let simulation = Simulation::with_progress(config, &watcher)?;
    watcher.finish();
    Folder { simulation: &simulation, path: output, overwrite: args.overwrite }.write(args.flight)?;
    let (record, views) = (simulation.record(), simulation.views.len());
    tracing::info!(
        "{views} views of {} buildings and {} trees in {}",
        record.buildings,
        record.trees,
        output.display()
    );
    Ok(Outcome::Complete)
}

/// Where a simulation is written to.
struct Folder<'a> {
    simulation: &'a Simulation,
    path: &'a Path,
    overwrite: bool,
}

impl Folder<'_> {
    fn write(&self, flight: u32) -> anyhow::Result<()> {
        for (number, view) in (1..).zip(&self.simulation.views) {
            self.write_view(number, view)?;
        }
        let truth = &self.simulation.truth;
        self.map("dsm.tif", &[Band { description: "height_m", data: BandData::F32(&truth.dsm) }])?;
        self.map("dtm.tif", &[Band { description: "height_m", data: BandData::F32(&truth.dtm) }])?;
        self.map("classes.tif", &[Band { description: "class", data: BandData::U8(&truth.classes) }])?;
        self.map("ortho.tif", &[Band { description: "reflectance_1e-4", data: BandData::U16(&truth.ortho) }])?;
        let names: Vec<String> = (1..=truth.visibility.len()).map(|view| format!("seen_by_view_{view}")).collect();
        let seen = names.iter().zip(&truth.visibility);
        let seen = seen.map(|(name, grid)| Band { description: name, data: BandData::U8(grid) });
        self.map("visibility.tif", &seen.collect::<Vec<_>>())?;
        let options = CityJsonOptions { overwrite: self.overwrite, ..CityJsonOptions::default() };
        write_cityjson(&self.path.join("truth/buildings.city.json"), &truth.buildings, &options)?;
        let record = serde_json::to_string_pretty(&self.simulation.record())? + "\n";
        if flight > 0 {
            self.write_flight(flight)?;
        }
        self.write_text("scene.toml", &self.simulation.config.to_toml()?)?;
        self.write_text("scene.json", &record)
    }

    fn write_view(&self, number: usize, view: &View) -> anyhow::Result<()> {
        let bands = [Band { description: "panchromatic", data: BandData::U16(&view.image) }];
        write_image_with_rpc(
            self.path.join(format!("view_{number}.tif")),
            &bands,
            &view.rpc,
            Some(0.0),
            self.overwrite,
        )?;
        // Truth in the image's own grid keeps the true RPC: the height of a pixel with it gives the pixel's place.
        let heights = [Band { description: "height_m", data: BandData::F32(&view.heights) }];
        let path = |what: &str| self.path.join("truth").join(format!("{what}_{number}.tif"));
        write_image_with_rpc(
            path("heights"),
            &heights,
            &view.true_rpc,
            Some(f64::from(raster::NO_DATA)),
            self.overwrite,
        )?;
        if let Some(cover) = &view.clouds {
            let bands = [Band { description: "cloud", data: BandData::U8(cover) }];
            write_image_with_rpc(path("clouds"), &bands, &view.true_rpc, None, self.overwrite)?;
        }
        Ok(())
    }

    fn write_flight(&self, count: u32) -> anyhow::Result<()> {
        let (lens, poses) = self.simulation.flight(count as usize)?;
        let view = |(id, pose)| ColmapView { id, name: format!("flight_{id:02}.png"), lens: 0, pose };
        let model = ColmapModel { lenses: vec![lens], views: (1..).zip(poses).map(view).collect() };
        let folder = self.path.join("cameras/sparse/0");
        fs::create_dir_all(&folder).with_context(|| format!("cannot make the folder: {}", folder.display()))?;
        Ok(colmap::write(&folder, &model, &[], ColmapEncoding::Text, self.overwrite)?)
    }

    fn map(&self, name: &str, bands: &[Band<'_>]) -> anyhow::Result<()> {
        let truth = &self.simulation.truth;
        let cog = CogRaster::new(bands, truth.geotransform, Crs::ellipsoidal(truth.epsg));
        Ok(write_cog(self.path.join("truth").join(name), &cog, self.overwrite)?)
    }

    /// Writes a text whole or not at all.
    fn write_text(&self, name: &str, text: &str) -> anyhow::Result<()> {
        let path = self.path.join(name);
        let part = path.with_extension("part");
        fs::write(&part, text)
            .and_then(|()| fs::rename(&part, &path))
            .with_context(|| format!("cannot write the file: {}", path.display()))
    }
}
