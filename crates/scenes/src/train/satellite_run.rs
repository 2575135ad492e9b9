//! Runs a training on satellite images and writes its results.

use std::path::{Path, PathBuf};

use ::train::{Drawing, LatticeView, Registers, Surfel, SurfelCamera, TrainingConfig, TrainingState, TrainingView};
use crs::Crs;
use formats::raster::{Band, BandData, CogRaster, read_dem, write_cog, write_png_rgb};
use numeric::Progress;
use raster::Grid;
use serde::{Deserialize, Serialize};
use splats::{ms_ssim, psnr_db, ssim};

use super::config::CHECKPOINT_EVERY;
use super::course::{Course, Trained};
use super::error::TrainError;
use super::exposure::line;
use super::iterate::extent_m;
use super::page;
use super::recipe::{self, TrainNumbers, TrainPreset, TrainSchedule, TrainSteps, TrainWeights};
use super::report::{LossPoint, Quality, TrainedViewRow};
use super::results::{self, CHECKPOINT, RENDERS, REPORT};
use super::satellite::{PlacedSurfels, SatelliteImage, corrections};
use crate::splats::pointing_path;
use job::corrections::CorrectionSource;
use job::error::{JobError, SettingError};
use job::files::{self, FileError};
use job::map_surface::{self, MapSurface};
use job::output_folder::OutputFolder;
use job::threads;

/// Name of the heights of the splats.
const HEIGHTS: &str = "dsm.tif";
/// Steps of positions at the beginning and at the end, metres. The surface model is right within a
/// cell or two, so that splats have no long way to go.
const STEPS_M: [f64; 2] = [0.01, 0.001];
/// Weight of the heights of the surface model, as a multiple of that of a city model in other
/// trainings. A surface model of the same images is right in the mean, and colours of few
/// directions pull splats away from it. Chosen on a town of seed 1 (1, 4 and 16).
const HEIGHTS_WEIGHT: f64 = 4.0;

/// A training of splats on satellite images.
#[derive(Debug, Clone, PartialEq, Serialize, Deserialize)]
#[serde(deny_unknown_fields)]
#[non_exhaustive]
pub struct SatelliteTrainConfig {
    /// Images with RPCs to train on.
    pub images: Vec<PathBuf>,
    /// Images with RPCs that are only judged.
    pub judged: Vec<PathBuf>,
    /// The splats to begin with, as the splat job writes them.
    pub splats: PathBuf,
    /// Surface model that holds the heights; nothing but the images does when `None`.
    pub dsm: Option<PathBuf>,
    /// Raster on the map of the splats with heights in any unit and from any zero, such as those of
    /// a network for single images: the splats follow its form.
    pub relative_heights: Option<PathBuf>,
    /// Source of the pointing corrections of the images.
    pub corrections: CorrectionSource,
    /// Folder for the results.
    pub output: PathBuf,
    /// Number of iterations; each draws one view.
    pub iterations: u32,
    /// Greatest number of splats. Fewer than there are means that none is split.
    pub budget: usize,
    /// Whether pixels that stay unexplained while other views agree are left out.
    pub transients: bool,
    /// What the training is for.
    pub preset: TrainPreset,
    /// Weights of the loss that differ from those of the preset.
    pub weights: TrainWeights,
    /// Steps of the optimiser that differ from those of the preset.
    pub steps: TrainSteps,
    /// Times of the training that differ from those of the preset.
    pub schedule: TrainSchedule,
    /// Seed of everything random.
    pub seed: u64,
    /// Iterations between two checkpoints.
    pub checkpoint_every: u32,
    /// Whether a training that was stopped goes on.
    pub resume: bool,
    /// Worker threads; one per core when `None`.
    pub threads: Option<usize>,
    /// Whether earlier results may be replaced.
    pub overwrite: bool,
}

/// A finished training on satellite images.
#[derive(Debug, Clone, Serialize)]
#[non_exhaustive]
pub struct SatelliteTrainReport {
    /// The settings.
    pub settings: SatelliteTrainConfig,
    /// The splats.
    pub splats: PathBuf,
    /// Number of splats at the beginning.
    pub splats_before: usize,
    /// Number of splats at the end.
    pub splats_after: usize,
    /// Largest difference of a camera from its exact RPC, pixels.
    pub camera_error_px: f64,
    /// Seconds of the iterations.
    pub seconds: f64,
    /// Mean absolute difference of the heights of the splats from the surface model, before and
    /// after, metres.
    pub height_change_m: Option<[f64; 2]>,
    /// Share of the pixels of each trained image that were left out as transient.
    pub transient_share: Vec<f64>,
    /// Quality of the views before and after; judged images are those that were held out.
    pub views: Vec<TrainedViewRow>,
    /// Mean loss of the iterations before each point.
    pub losses: Vec<LossPoint>,
}

impl SatelliteTrainConfig {
    /// A training with the default settings.
    pub fn new(images: Vec<PathBuf>, splats: PathBuf, output: PathBuf) -> Self {
        Self {
            images,
            judged: Vec::new(),
            splats,
            dsm: None,
            relative_heights: None,
            corrections: CorrectionSource::default(),
            output,
            iterations: 1500,
            budget: 200_000,
            transients: true,
            preset: TrainPreset::Satellite,
            weights: TrainWeights::default(),
            steps: TrainSteps::default(),
            schedule: TrainSchedule::default(),
            seed: 1,
            checkpoint_every: CHECKPOINT_EVERY,
            resume: false,
            threads: None,
            overwrite: false,
        }
    }

    /// Checks the settings that can be judged without opening a file.
    ///
    /// # Errors
    /// [`SettingError`] for a number outside of its range.
    pub fn validate(&self) -> Result<(), SettingError> {
        if self.images.is_empty() {
            return Err(SettingError::new("the number of images", 0, "1 or more"));
        }
        if self.budget > 20_000_000 {
            return Err(SettingError::new("the budget of splats", self.budget, "up to 20,000,000"));
        }
        if self.iterations == 0 {
            return Err(SettingError::new("the number of iterations", self.iterations, "1 or more"));
        }
        self.weights.validate()?;
        self.steps.validate()?;
        self.schedule.check()
    }
}

impl SatelliteTrainReport {
    /// Returns the report as text, which ends in a line break.
    pub fn text(&self) -> String {
        let mut text =
            format!("splats    {} ({}, before {})\n", self.splats.display(), self.splats_after, self.splats_before);
        let number = |value: Option<f64>| value.map_or("-".to_owned(), |v| format!("{v:.2}"));
        for view in &self.views {
            text += &format!(
                "{}   {} dB (before {} dB), SSIM {} (before {})  {}\n",
                if view.held_out { "judged " } else { "trained" },
                number(view.psnr_db),
                number(view.psnr_before_db),
                number(view.ssim),
                number(view.ssim_before),
                view.name,
            );
        }
        if let Some([before, after]) = self.height_change_m {
            text += &format!("heights   {after:.3} m from the surface model (before {before:.3} m)\n");
        }
        text + &format!("time      {:.0} s\n", self.seconds)
    }
}

/// Trains splats on satellite images.
///
/// A training that is cancelled leaves a checkpoint, from which it goes on with `resume`: the
/// result has the same bytes.
///
/// # Errors
/// [`JobError`]: splats without an origin on a map, images that do not see them, outputs that
/// exist.
pub fn run_on_images(config: &SatelliteTrainConfig, progress: &dyn Progress) -> Result<SatelliteTrainReport, JobError> {
    config.validate()?;
    let (overwrite, resume) = (config.overwrite, config.resume);
    let may_replace = results::may_replace(&config.output, overwrite, resume, config.iterations)?;
    Ok(threads::install(config.threads, || train(config, may_replace, progress))??)
}

fn train(
    config: &SatelliteTrainConfig,
    may_replace: bool,
    progress: &dyn Progress,
) -> Result<SatelliteTrainReport, TrainError> {
    let placed = PlacedSurfels::read(&config.splats)?;
    let found = corrections(&config.splats, &config.corrections)?;
    let images = placed.images(&config.images, &found, progress)?;
    let judged = placed.images(&config.judged, &found, progress)?;
    let invalid = |path: &Path, what: &str| TrainError::Dataset { path: path.to_owned(), what: what.to_owned() };
    let surface = config.dsm.as_ref().map(|path| map_surface::read(path, None, progress)).transpose()?;
    let mut views: Vec<TrainingView<LatticeView>> = images.iter().map(|image| image.view.clone()).collect();
    if let (Some(surface), Some(path)) = (&surface, &config.dsm) {
        placed.check_map(path, &surface.dem)?;
        let above = placed.above(surface);
        views.push(above.ok_or_else(|| invalid(path, "the grid of the surface model is not regular"))?);
    }
    if let Some(path) = &config.relative_heights {
        let heights = read_dem(path)?;
        placed.check_map(path, &heights)?;
        let above = placed.above_relative(&heights);
        views.push(above.ok_or_else(|| invalid(path, "the grid of the heights is not regular"))?);
    }
    let folder = OutputFolder::take(&config.output)?;
    folder.check_folders([RENDERS])?;
    let pictures: Vec<&SatelliteImage> = images.iter().chain(&judged).collect();
    let begun = TrainingState::new(placed.surfels.clone(), 0);
    let before: Vec<Quality> = pictures.iter().map(|image| quality(&begun, &image.view).0).collect();
    let course = Course {
        output: &config.output,
        checkpoint_every: config.checkpoint_every,
        resume: config.resume,
        transients: config.transients,
        pictures: images.len(),
        settings: settings(config, extent_m(&placed.surfels)),
    };
    let Trained { state, transient_share, losses, seconds } = course.run(&placed.surfels, views, progress)?;
    results::begin(&folder)?;
    let splats = results::write_splats(&config.output, &state, &placed.origin, may_replace)?;
    let used: Vec<PathBuf> = config.images.iter().chain(&config.judged).cloned().collect();
    found.of_images(&used).write(&pointing_path(&splats), may_replace)?;
    let height_change_m = match &surface {
        Some(surface) => heights(&folder, &placed, [&placed.surfels, &state.surfels], surface, may_replace)?,
        None => None,
    };
    let (mut views, mut comparisons) = (Vec::new(), Vec::new());
    for (number, (image, before)) in pictures.iter().zip(before).enumerate() {
        let (after, shown) = quality(&state, &image.view);
        let held_out = number >= config.images.len();
        let mut several = None;
        if held_out {
            let picture = truth(&image.view);
            several = ms_ssim(&shown, &picture, &picture.map(|p| p.iter().all(|c| c.is_finite())));
            let file = folder.subfolder(RENDERS)?.join(Path::new(&image.name).with_extension("png"));
            write_png_rgb(file, &page::bytes(&shown), may_replace)?;
            comparisons.push(page::comparison(&image.name, &picture, &shown, (after.0, after.1, several)));
        }
        views.push(TrainedViewRow::new(&image.name, held_out, before, after).with_ms_ssim(several));
    }
    let report = SatelliteTrainReport {
        settings: config.clone(),
        splats,
        splats_before: placed.surfels.len(),
        splats_after: state.surfels.len(),
        camera_error_px: pictures.iter().map(|image| image.camera_error_px).fold(0.0, f64::max),
        seconds,
        height_change_m,
        transient_share,
        views,
        losses,
    };
    let lead = "Splats that learned from satellite images.";
    page::write(&config.output.join(REPORT), lead, &report, &report.losses, comparisons, may_replace)?;
    files::remove(&config.output.join(CHECKPOINT))?;
    Ok(report)
}

fn settings(config: &SatelliteTrainConfig, extent_m: f64) -> TrainingConfig {
    let mut steps = config.steps;
    steps.position_first = steps.position_first.or(Some(STEPS_M[0] / extent_m));
    steps.position_last = steps.position_last.or(Some(STEPS_M[1] / extent_m));
    let mut settings = recipe::settings(config.preset, &config.weights, &steps, &config.schedule);
    settings.iterations = config.iterations;
    settings.seed = config.seed;
    settings.appearance = true;
    // The surface model holds the heights from the first iteration to the last.
    settings.schedule.depth.from_factor = 1.0;
    settings.schedule.depth.to_factor = 1.0;
    if config.weights.prior_depth.is_none() {
        settings.weights.prior_depth *= HEIGHTS_WEIGHT;
    }
    if let Some(densify) = &mut settings.densify {
        densify.budget = config.budget;
    }
    settings
}

fn truth(view: &TrainingView<LatticeView>) -> Grid<[f32; 3]> {
    let [width, height] = view.camera.size();
    let value = |pixel: usize| view.colour.each_ref().map(|plane| plane[pixel]);
    Grid::from_vec(width, height, (0..width * height).map(value).collect()).expect("as many values as pixels")
}

/// Compares a view with what splats show, after a gain and an offset for each channel that bring
/// the splats to the view. Returns what they show.
fn quality(state: &TrainingState, view: &TrainingView<LatticeView>) -> (Quality, Grid<[f32; 3]>) {
    let drawing = Drawing::new(state.seen(&view.camera, &mut Vec::new()), &view.camera, Registers::Longest);
    let images = drawing.images();
    let picture = truth(view);
    let counts = picture.map(|p| p.iter().all(|c| c.is_finite()));
    let lines = [0, 1, 2].map(|k| line(&images.colour[k], |pixel| view.colour[k][pixel], |pixel| counts.data()[pixel]));
    let mut shown = picture.clone();
    for (pixel, value) in shown.data_mut().iter_mut().enumerate() {
        *value = [0, 1, 2].map(|k| lines[k].0 * images.colour[k][pixel] + lines[k].1);
    }
    ((psnr_db(&shown, &picture, &counts), ssim(&shown, &picture, &counts)), shown)
}

/// Writes the heights of the splats on the grid of the surface model, and returns the mean absolute
/// difference from it, before and after.
fn heights(
    folder: &OutputFolder,
    placed: &PlacedSurfels,
    splats: [&[Surfel]; 2],
    surface: &MapSurface,
    may_replace: bool,
) -> Result<Option<[f64; 2]>, TrainError> {
    let [Some(before), Some(after)] = splats.map(|surfels| placed.heights(surfels, surface)) else { return Ok(None) };
    let change = |found: &Grid<f32>| {
        let pairs = found.data().iter().zip(surface.dem.heights.data());
        let (sum, count) = pairs
            .map(|(a, b)| f64::from((a - b).abs()))
            .filter(|d| d.is_finite())
            .fold((0.0, 0usize), |(sum, count), d| (sum + d, count + 1));
        sum / count.max(1) as f64
    };
    if let Some(epsg) = surface.dem.horizontal_epsg {
        let bands = [Band { description: "height_m", data: BandData::F32(&after) }];
        let raster = CogRaster {
            holds_heights: true,
            ..CogRaster::new(&bands, surface.dem.geotransform, Crs::ellipsoidal(epsg))
        };
        write_cog(folder.path().join(HEIGHTS), &raster, may_replace).map_err(FileError::from)?;
    }
    Ok(Some([change(&before), change(&after)]))
}
