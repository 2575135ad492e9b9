//! `skysweep train`: flat Gaussian splats learn from the images of a dataset, with building priors.

use std::path::PathBuf;

use jobs::train::{TrainConfig, TrainPriors};

use crate::options::{Named, named};
use crate::progress::RunOptions;
use crate::{Global, Outcome};

/// Arguments of `skysweep train`.
#[derive(Debug, clap::Args)]
#[command(after_help = "Example: skysweep priors buildings.city.json --cameras flight -o dataset; \
                  skysweep train dataset --pictures flight/images -o trained. A training that is stopped \
                  leaves a checkpoint, from which --resume goes on.")]
pub(crate) struct Args {
    /// Folder that skysweep priors wrote, or another folder with a COLMAP model in sparse/0.
    dataset: PathBuf,
    /// Folder of the images, with the names that the cameras have [default: DATASET/images].
    #[arg(long, value_name = "FOLDER")]
    pictures: Option<PathBuf>,
    /// Folder for splats.ply, report.json and the views that were not trained on.
    #[arg(short, long, value_name = "DIR")]
    output: PathBuf,
    /// Number of iterations; each draws one view.
    #[arg(long, value_name = "N", default_value_t = 3000)]
    iterations: u32,
    /// Greatest number of splats; the training begins with at most half of them.
    #[arg(long, value_name = "N", default_value_t = 100_000)]
    budget: usize,
    /// Pixels of an image that become one, in each direction.
    #[arg(long, value_name = "N", default_value_t = 1)]
    shrink: usize,
    /// Every N-th view is kept for the judgement and not trained on (0: none).
    #[arg(long, value_name = "N", default_value_t = 8)]
    hold_out: usize,
    /// Prior maps in use, as far as the dataset has them.
    #[arg(long, value_parser = named(&PRIORS), default_value = "both")]
    priors: TrainPriors,
    /// Learn a gain and an offset for each image, where exposures differ.
    #[arg(long)]
    appearance: bool,
    /// Seed of everything random.
    #[arg(long, value_name = "N", default_value_t = 1)]
    seed: u64,
    /// Go on from the checkpoint of a training that was stopped.
    #[arg(long)]
    resume: bool,
    #[command(flatten)]
    run: RunOptions,
}

const PRIORS: [Named<TrainPriors>; 4] = [
    ("both", TrainPriors::Both, "depths and normals"),
    ("depth", TrainPriors::Depth, "depths alone"),
    ("normal", TrainPriors::Normal, "normals alone"),
    ("none", TrainPriors::None, "the images alone"),
];

/// Runs `skysweep train`.
pub(crate) fn run(args: &Args, global: Global) -> anyhow::Result<Outcome> {
    let mut config = TrainConfig::new(args.dataset.clone(), args.output.clone());
    config.images.clone_from(&args.pictures);
    config.iterations = args.iterations;
    config.budget = args.budget;
    config.shrink = args.shrink;
    config.hold_out = args.hold_out;
    config.priors = args.priors;
    config.appearance = args.appearance;
    config.seed = args.seed;
    config.resume = args.resume;
    config.threads = args.run.threads;
    config.overwrite = args.run.overwrite;
    let show = args.run.show;
    let report = show.watch(global, &args.output, |watcher| jobs::train::run(&config, watcher))?;
    show.print(global, &report, || report.text())?;
    Ok(Outcome::Complete)
}
