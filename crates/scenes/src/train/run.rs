//! Runs a training and writes its results.

use std::path::Path;

use ::train::{Drawing, PinholeView, Registers, TrainingConfig, TrainingState, TrainingView};
use formats::raster::write_png_rgb;
use numeric::Progress;
use raster::Grid;
use report::Comparison;
use splats::{ms_ssim, psnr_db, ssim};

use super::config::{PriorSchedule, TrainConfig};
use super::course::{Course, Trained};
use super::dataset::TrainData;
use super::error::TrainError;
use super::exposure::right_half;
use super::initial;
use super::page;
use super::recipe::{self, TrainPreset};
use super::report::{Exposed, Quality, TrainReport, TrainedViewRow};
use super::results::{self, CHECKPOINT, RENDERS, REPORT};
use job::error::JobError;
use job::files;
use job::output_folder::OutputFolder;
use job::threads;

/// Trains splats on a dataset.
///
/// A training that is cancelled leaves a checkpoint, from which it goes on with `resume`: the
/// result has the same bytes.
///
/// # Errors
/// [`JobError`]: a dataset that cannot be read or has no images, outputs that exist.
pub fn run(config: &TrainConfig, progress: &dyn Progress) -> Result<TrainReport, JobError> {
    config.validate()?;
    let (overwrite, resume) = (config.overwrite, config.resume);
    let may_replace = results::may_replace(&config.output, overwrite, resume, config.iterations)?;
    Ok(threads::install(config.threads, || {
        let data = TrainData::read(config, progress)?;
        let folder = OutputFolder::take(&config.output)?;
        folder.check_folders([RENDERS])?;
        train(config, &data, &folder, may_replace, progress)
    })??)
}

fn train(
    config: &TrainConfig,
    data: &TrainData,
    folder: &OutputFolder,
    may_replace: bool,
    progress: &dyn Progress,
) -> Result<TrainReport, TrainError> {
    let trained: Vec<usize> = (0..data.views.len()).filter(|&v| !data.held_out[v]).collect();
    let views: Vec<TrainingView<PinholeView>> = trained.iter().map(|&v| data.views[v].clone()).collect();
    if data.points.len() < 4 {
        return Err(TrainError::NoPoints { count: data.points.len(), path: data.sparse.clone() });
    }
    let (preset, settings) = settings(config, data);
    let initial = initial::surfels(data, config.budget / 2);
    let before = quality(data, &TrainingState::new(initial.clone(), 0), None)?.views;
    let course = Course {
        output: &config.output,
        checkpoint_every: config.checkpoint_every,
        resume: config.resume,
        transients: config.transients,
        pictures: views.len(),
        settings,
    };
    let Trained { state, transient_share, losses, seconds } = course.run(&initial, views, progress)?;
    results::begin(folder)?;
    let renders = Renders { folder: &folder.subfolder(RENDERS)?, may_replace };
    let Judged { views: after, right, comparisons, ms_ssim } = quality(data, &state, Some(renders))?;
    let splats = results::write_splats(&config.output, &state, &data.place.origin, may_replace)?;
    let row = |v: usize| {
        let row = TrainedViewRow::new(&data.names[v], data.held_out[v], before[v], after[v]);
        row.with_right(right[v]).with_ms_ssim(ms_ssim[v])
    };
    let report = TrainReport {
        settings: config.clone(),
        preset,
        weights: recipe::used(&settings.weights),
        splats,
        harmonics_degree: state.harmonics.degree(),
        splats_before: initial.len(),
        splats_after: state.surfels.len(),
        masked: data.masked,
        depth_scale: state.depth_scale,
        seconds,
        transient_share,
        views: (0..data.views.len()).map(row).collect(),
        losses,
    };
    let lead = "Flat Gaussian splats that learned from the images of a dataset.";
    page::write(&config.output.join(REPORT), lead, &report, &report.losses, comparisons, may_replace)?;
    files::remove(&config.output.join(CHECKPOINT))?;
    Ok(report)
}

fn settings(config: &TrainConfig, data: &TrainData) -> (TrainPreset, TrainingConfig) {
    let preset = config.preset.unwrap_or(data.preset);
    let mut settings = recipe::settings(preset, &config.weights, &config.steps, &config.schedule);
    settings.iterations = config.iterations;
    settings.seed = config.seed;
    settings.appearance = config.appearance;
    if let Some(schedule) = data.schedule.filter(|_| config.prior_schedule == PriorSchedule::Dataset) {
        settings.schedule = schedule;
    }
    if let Some(densify) = &mut settings.densify {
        densify.budget = config.budget;
    }
    (preset, settings)
}

/// Where the views are written that were not trained on.
struct Renders<'a> {
    folder: &'a Path,
    may_replace: bool,
}

/// How well the views are shown, and what shows it.
#[derive(Default)]
struct Judged {
    /// By view.
    views: Vec<Quality>,
    /// Of the right half, by view; none for views that were trained on.
    right: Vec<Exposed>,
    /// Views that were not trained on, for the page.
    comparisons: Vec<Comparison>,
    /// Similarity over several scales, by view; only where views are written.
    ms_ssim: Vec<Option<f64>>,
}

/// Returns the quality of every view, and of the right halves of those that were not trained on.
/// Writes what these show, and returns them for the page.
fn quality(data: &TrainData, state: &TrainingState, write: Option<Renders<'_>>) -> Result<Judged, TrainError> {
    let mut out = Judged::default();
    let mut coloured = Vec::new();
    let mut drawing = Drawing::new(&[], &data.views[0].camera, Registers::Longest);
    for (number, view) in data.views.iter().enumerate() {
        drawing.redraw(state.seen(&view.camera, &mut coloured), &view.camera);
        let [width, height] = view.camera.size;
        let (mut found, mut truth) =
            (Grid::filled(width, height, [0.0f32; 3]), Grid::filled(width, height, [0.0f32; 3]));
        for (grid, planes) in [(&mut found, &drawing.images().colour), (&mut truth, &view.colour)] {
            let pixels = grid.data_mut().iter_mut().enumerate();
            pixels.for_each(|(pixel, value)| *value = planes.each_ref().map(|plane| plane[pixel]));
        }
        let mut counts = Grid::filled(width, height, true);
        if let Some(mask) = &view.mask {
            counts.data_mut().copy_from_slice(mask);
        }
        let (psnr, similar) = (psnr_db(&found, &truth, &counts), ssim(&found, &truth, &counts));
        out.views.push((psnr, similar));
        let several = write.as_ref().and_then(|_| ms_ssim(&found, &truth, &counts));
        out.ms_ssim.push(several);
        out.right.push(if data.held_out[number] { right_half(&found, &truth, &counts) } else { (None, None) });
        if let Some(renders) = write.as_ref().filter(|_| data.held_out[number]) {
            let stem = Path::new(&data.names[number]).file_stem().unwrap_or_default().to_string_lossy();
            let path = renders.folder.join(format!("{stem}.png"));
            write_png_rgb(path, &page::bytes(&found), renders.may_replace)?;
            out.comparisons.push(page::comparison(&data.names[number], &truth, &found, (psnr, similar, several)));
        }
    }
    Ok(out)
}
