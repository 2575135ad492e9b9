//! `skysweep mesh`: depth maps of a dataset, or those that splats show, become a mesh.

use std::path::PathBuf;

use jobs::mesh::{DepthSource, MeshJobConfig};

use crate::error::hinted;
use crate::progress::RunOptions;
use crate::{Global, Outcome};

/// Arguments of `skysweep mesh`.
#[derive(Debug, clap::Args)]
#[command(after_help = "Example: skysweep mesh dataset --splats trained/splats.ply --masked -o building.ply \
                  --reference truth.ply")]
#[command(group = clap::ArgGroup::new("depths_of").args(["splats", "depths"]).required(true))]
pub(crate) struct Args {
    /// Folder that skysweep priors wrote, or another folder with a COLMAP model in sparse/0.
    dataset: PathBuf,
    /// Splats (2DGS) that the cameras of the dataset look at, such as those of skysweep train.
    #[arg(long, value_name = "PLY")]
    splats: Option<PathBuf>,
    /// Folder of depth maps (NAME.npy, along the optical axis), such as DATASET/raw_depth.
    #[arg(long, value_name = "FOLDER")]
    depths: Option<PathBuf>,
    /// Folder of the images that give the colours with --depths [default: grey].
    #[arg(long, value_name = "FOLDER", requires = "depths")]
    pictures: Option<PathBuf>,
    /// File of the mesh, .ply or .glb; NAME.report.json is written beside it.
    #[arg(short, long, value_name = "FILE")]
    output: PathBuf,
    /// Edge of a voxel, metres.
    #[arg(long, value_name = "METRES", default_value_t = 0.1)]
    voxel: f64,
    /// Distance from a surface beyond which a map says nothing, metres [default: four voxels].
    #[arg(long, value_name = "METRES")]
    truncation: Option<f64>,
    /// Views that must have seen a place.
    #[arg(long, value_name = "N", default_value_t = 1)]
    least_views: u32,
    /// Leave out connected parts of a smaller area.
    #[arg(long, value_name = "M2", default_value_t = 1.0)]
    least_part: f64,
    /// Pixels of an image that become one, in each direction, where splats are drawn.
    #[arg(long, value_name = "N", default_value_t = 1)]
    shrink: usize,
    /// Keep only what the masks of the dataset show: the buildings.
    #[arg(long)]
    masked: bool,
    /// Mesh, city model or cloud to compare with, as skysweep eval does.
    #[arg(long, value_name = "FILE")]
    reference: Option<PathBuf>,
    /// Greatest memory of the volume, GiB.
    #[arg(long, value_name = "GIB", default_value_t = 4.0)]
    memory: f64,
    #[command(flatten)]
    run: RunOptions,
}

/// Runs `skysweep mesh`.
pub(crate) fn run(args: &Args, global: Global) -> anyhow::Result<Outcome> {
    let depths = match (&args.splats, &args.depths) {
        (Some(splats), _) => DepthSource::Splats(splats.clone()),
        (None, folder) => DepthSource::Maps(folder.clone().unwrap_or_default()),
    };
    let mut config = MeshJobConfig::new(args.dataset.clone(), depths, args.output.clone());
    config.images.clone_from(&args.pictures);
    config.voxel_m = args.voxel;
    config.truncation_m = args.truncation;
    config.least_views = args.least_views;
    config.least_part_m2 = args.least_part;
    config.shrink = args.shrink;
    config.masked = args.masked;
    config.reference.clone_from(&args.reference);
    config.memory_gib = args.memory;
    config.threads = args.run.threads;
    config.overwrite = args.run.overwrite;
    let show = args.run.show;
    let report = show.watch(global, &args.output, |watcher| jobs::mesh::run(&config, watcher)).map_err(hinted)?;
    show.print(global, &report, || report.text())?;
    Ok(Outcome::Complete)
}
