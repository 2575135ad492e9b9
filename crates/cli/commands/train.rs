//! `skysweep train`: flat Gaussian splats learn from the images of a dataset, with building priors,
//! or from satellite images.

use std::path::{Path, PathBuf};

use anyhow::{Context, bail, ensure};
use jobs::train::{
    CHECKPOINT_EVERY, PriorSchedule, SatelliteTrainConfig, TrainConfig, TrainNumbers, TrainPreset, TrainPriors,
    TrainSchedule, TrainSteps, TrainWeights,
};

use crate::corrections::corrections_of;
use crate::error::hinted;
use crate::options::{Named, named};
use crate::progress::RunOptions;
use crate::{Global, Outcome};

/// Arguments of `skysweep train`.
#[derive(Debug, clap::Args)]
#[command(after_help = "Example: skysweep priors buildings.city.json --cameras flight -o dataset; \
                  skysweep train dataset --pictures flight/images -o trained. A training that is stopped \
                  leaves a checkpoint, from which --resume goes on. Satellite images: skysweep train \
                  *.tif --splats town.ply --dsm dsm.tif -o trained")]
pub(crate) struct Args {
    /// Folder that skysweep priors wrote, or another folder with a COLMAP model, such as in
    /// sparse/0; or satellite images with RPCs, with --splats.
    #[arg(required = true, value_name = "DATASET|IMAGES")]
    inputs: Vec<PathBuf>,
    /// Folder of the images, with the names that the cameras have [default: DATASET/images, or the
    /// folder in or beside it that has them].
    #[arg(long, value_name = "FOLDER")]
    pictures: Option<PathBuf>,
    /// Folder of a mask for each image, NAME.jpg.png or NAME.png: pixels that are 0 there, such as
    /// the sky, count neither in the training nor in the judgement [default: all pixels count].
    #[arg(long, value_name = "FOLDER")]
    masks: Option<PathBuf>,
    /// Another COLMAP model of the same cameras, whose points are added, such as the reconstruction
    /// that the cameras come from: what is not in the city model begins there.
    #[arg(long, value_name = "FOLDER")]
    points: Option<PathBuf>,
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
    /// Splats to begin with, as skysweep splats makes them of a surface model (satellite images).
    #[arg(long, value_name = "PLY", help_heading = "Satellite images")]
    splats: Option<PathBuf>,
    /// Surface model that holds the heights of the splats; dsm.tif is written on its grid [default:
    /// nothing but the images holds them].
    #[arg(long, value_name = "FILE", requires = "splats", help_heading = "Satellite images")]
    dsm: Option<PathBuf>,
    /// Raster on the map of the splats with heights in any unit and from any zero, such as those of
    /// a network for single images: the splats follow its form (Pearson's correlation).
    #[arg(long, value_name = "FILE", requires = "splats", help_heading = "Satellite images")]
    relative_heights: Option<PathBuf>,
    /// Image that is not trained on and only judged; may be given several times.
    #[arg(long, value_name = "IMAGE", requires = "splats", help_heading = "Satellite images")]
    judge: Vec<PathBuf>,
    /// Corrections of the images' pointing: the report of a run of skysweep dsm, or none [default:
    /// the corrections that the splats were made with].
    #[arg(long, value_name = "report.json|none", requires = "splats", help_heading = "Satellite images")]
    corrections: Option<PathBuf>,
    /// Pixels that one image does not share with the others, such as vehicles [default: leave-out
    /// for satellite images, keep for datasets, whose images are often taken within minutes].
    #[arg(long, value_parser = named(&TRANSIENTS), value_name = "CHOICE")]
    transients: Option<bool>,
    /// Every N-th view in the order of their names, from the first on, is kept for the judgement
    /// and not trained on, as LLFF splits (0: none).
    #[arg(long, value_name = "N", default_value_t = 8)]
    hold_out: usize,
    /// View that is kept for the judgement, by its name, instead of every N-th; may be given
    /// several times.
    #[arg(long, value_name = "NAME", conflicts_with = "hold_out")]
    hold_out_view: Vec<String>,
    /// What the training is for, each with the recipe of its paper [default: satellite with
    /// --splats, the buildings of a dataset that skysweep priors wrote, or else photographs].
    #[arg(long, value_parser = named(&PRESETS))]
    preset: Option<TrainPreset>,
    /// Weight of a term of the loss that differs from the preset: absolute, squared (of colours),
    /// similarity (D-SSIM), mask, distortion (of inverse depths, in sizes of the scene),
    /// consistency (of normals), prior-depth (in sizes of the scene), prior-normal, correlation.
    #[arg(long, value_name = "NAME=NUMBER", value_parser = pair, help_heading = "Recipe")]
    weight: Vec<(String, f64)>,
    /// Step of the optimiser that differs from the preset: position-first, position-last (in sizes
    /// of the scene), rotation, scale (logarithms), opacity (logits), colour-first, colour-last (of
    /// colours from 0 to 1), harmonics-first, harmonics-last (of how colours differ by direction).
    #[arg(long, value_name = "NAME=NUMBER", value_parser = pair, help_heading = "Recipe")]
    step: Vec<(String, f64)>,
    /// Time that differs from the preset: distortion-from, consistency-from, split-from,
    /// split-until (shares of the training), split-every, reset-every (iterations; 0: opacities are
    /// never brought down), degree-every (share of the training after which the degree of the
    /// harmonics grows by one), and the limits split-gradient (halves of the image), least-opacity
    /// and degree (of the harmonics, 0 to 3; 0: colours are the same from all sides).
    #[arg(long, value_name = "NAME=NUMBER", value_parser = pair, help_heading = "Recipe")]
    schedule: Vec<(String, f64)>,
    /// Prior maps in use, as far as the dataset has them.
    #[arg(long, value_parser = named(&PRIORS), default_value = "both")]
    priors: TrainPriors,
    /// Where the factors of the priors by iteration come from.
    #[arg(long, value_parser = named(&PRIOR_SCHEDULES), default_value = "dataset")]
    prior_schedule: PriorSchedule,
    /// Learn a gain and an offset for each image, where exposures differ.
    #[arg(long)]
    appearance: bool,
    /// Seed of everything random.
    #[arg(long, value_name = "N", default_value_t = 1)]
    seed: u64,
    /// Iterations between two checkpoints.
    #[arg(long, value_name = "N", default_value_t = CHECKPOINT_EVERY, help_heading = "Run")]
    checkpoint_every: u32,
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

const PRESETS: [Named<TrainPreset>; 4] = [
    ("photographs", TrainPreset::Photographs, "a scene without bounds, as the code of 2DGS"),
    ("building-only", TrainPreset::BuildingOnly, "nothing but buildings, with priors (GS4Buildings)"),
    ("building-enhanced", TrainPreset::BuildingEnhanced, "the scene, with priors of its buildings (GS4Buildings)"),
    ("satellite", TrainPreset::Satellite, "satellite images with the heights of a surface model"),
];

const PRIOR_SCHEDULES: [Named<PriorSchedule>; 2] = [
    ("preset", PriorSchedule::Preset, "the preset: two phases for buildings"),
    ("dataset", PriorSchedule::Dataset, "schedule.json of the dataset"),
];

const TRANSIENTS: [Named<bool>; 2] = [
    ("leave-out", true, "not trained on once they stay unexplained while other images agree"),
    ("keep", false, "trained on as all others"),
];

/// Returns the two sides of `NAME=NUMBER`.
fn pair(text: &str) -> Result<(String, f64), String> {
    let expected = || format!("{text:?} is not of the form NAME=NUMBER");
    let (name, number) = text.split_once('=').ok_or_else(expected)?;
    Ok((name.trim().to_owned(), number.trim().parse().map_err(|_| expected())?))
}

/// The numbers that differ from the preset.
fn numbers(args: &Args) -> anyhow::Result<(TrainWeights, TrainSteps, TrainSchedule)> {
    let (mut weights, mut steps, mut schedule) =
        (TrainWeights::default(), TrainSteps::default(), TrainSchedule::default());
    let groups: [(&mut dyn TrainNumbers, _, _); 3] = [
        (&mut weights, &args.weight, "--weight"),
        (&mut steps, &args.step, "--step"),
        (&mut schedule, &args.schedule, "--schedule"),
    ];
    for (group, given, option) in groups {
        for (name, value) in given {
            group.set(name, *value).with_context(|| option.to_owned())?;
        }
    }
    Ok((weights, steps, schedule))
}

/// Runs `skysweep train`.
pub(crate) fn run(args: &Args, global: Global) -> anyhow::Result<Outcome> {
    if let Some(splats) = &args.splats {
        return on_images(args, splats, global);
    }
    ensure!(args.inputs.len() == 1, "{} datasets, expected one; satellite images need --splats", args.inputs.len());
    let mut config = TrainConfig::new(args.inputs[0].clone(), args.output.clone());
    config.more_points.clone_from(&args.points);
    config.images.clone_from(&args.pictures);
    config.masks.clone_from(&args.masks);
    config.iterations = args.iterations;
    config.budget = args.budget;
    config.shrink = args.shrink;
    config.hold_out = args.hold_out;
    config.hold_out_names.clone_from(&args.hold_out_view);
    config.preset = args.preset;
    (config.weights, config.steps, config.schedule) = numbers(args)?;
    config.priors = args.priors;
    config.prior_schedule = args.prior_schedule;
    config.appearance = args.appearance;
    config.transients = args.transients.unwrap_or(config.transients);
    config.seed = args.seed;
    config.checkpoint_every = args.checkpoint_every;
    config.resume = args.resume;
    config.threads = args.run.threads;
    config.overwrite = args.run.overwrite;
    let show = args.run.show;
    let report = show.watch(global, &args.output, |watcher| jobs::train::run(&config, watcher)).map_err(hinted)?;
    show.print(global, &report, || report.text())?;
    Ok(Outcome::Complete)
}

/// Trains on satellite images.
fn on_images(args: &Args, splats: &Path, global: Global) -> anyhow::Result<Outcome> {
    let given = [
        ("--pictures", args.pictures.is_some()),
        ("--masks", args.masks.is_some()),
        ("--points", args.points.is_some()),
        ("--shrink", args.shrink != 1),
    ];
    if let Some((option, _)) = given.iter().find(|(_, given)| *given) {
        bail!("{option} is for datasets, and --splats for satellite images: leave one of them out");
    }
    let mut config = SatelliteTrainConfig::new(args.inputs.clone(), splats.to_owned(), args.output.clone());
    config.judged.clone_from(&args.judge);
    config.dsm.clone_from(&args.dsm);
    config.corrections = corrections_of(args.corrections.as_deref());
    config.iterations = args.iterations;
    config.budget = args.budget;
    config.preset = args.preset.unwrap_or(config.preset);
    (config.weights, config.steps, config.schedule) = numbers(args)?;
    config.relative_heights.clone_from(&args.relative_heights);
    config.transients = args.transients.unwrap_or(config.transients);
    config.seed = args.seed;
    config.checkpoint_every = args.checkpoint_every;
    config.resume = args.resume;
    config.threads = args.run.threads;
    config.overwrite = args.run.overwrite;
    let show = args.run.show;
    let report =
        show.watch(global, &args.output, |watcher| jobs::train::run_on_images(&config, watcher)).map_err(hinted)?;
    show.print(global, &report, || report.text())?;
    Ok(Outcome::Complete)
}
