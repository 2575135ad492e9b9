//! Runs a training and writes its results.

use std::path::Path;
use std::time::Instant;

use ::train::{
    Drawing, PinholeView, Registers, Surfel, Trainer, TrainingConfig, TrainingState, TrainingStep, TrainingView,
};
use io::raster::write_png_rgb;
use io::splat_ply::{self, LocalOrigin, SplatForm, SplatLayout};
use numeric::Progress;
use raster::Grid;
use serde_json::Value;
use splats::{psnr_db, ssim};

use super::config::TrainConfig;
use super::dataset::TrainData;
use super::error::TrainError;
use super::initial;
use super::report::{LossPoint, TrainReport, TrainedViewRow};
use crate::files::{self, FileError};
use crate::output_folder::OutputFolder;
use crate::threads;

/// Names of the results.
const SPLATS: &str = "splats.ply";
const REPORT: &str = "report.json";
const CHECKPOINT: &str = "checkpoint.bin";
const RENDERS: &str = "renders";
/// Largest checkpoint, bytes.
const CHECKPOINT_LIMIT: u64 = 1 << 33;
/// Iterations of a point of the loss.
const LOSS_EVERY: u32 = 50;
/// Thickness of a splat in the file, metres. 2DGS has none.
const THICKNESS_M: f32 = 1e-4;

/// Trains splats on a dataset.
///
/// A training that is cancelled leaves a checkpoint, from which it goes on with `resume`: the
/// result has the same bytes.
///
/// # Errors
/// [`TrainError`]: a dataset that cannot be read or has no images, outputs that exist.
pub fn run(config: &TrainConfig, progress: &dyn Progress) -> Result<TrainReport, TrainError> {
    config.validate()?;
    for name in [SPLATS, REPORT] {
        files::refuse_existing(&config.output.join(name), config.overwrite)?;
    }
    threads::install(config.threads, || {
        let data = TrainData::read(config, progress)?;
        let _folder = OutputFolder::take(&config.output)?;
        train(config, &data, progress)
    })?
}

fn is_held_out(config: &TrainConfig, data: &TrainData, view: usize) -> bool {
    config.hold_out > 1 && data.views.len() > 2 && view % config.hold_out == config.hold_out - 1
}

fn train(config: &TrainConfig, data: &TrainData, progress: &dyn Progress) -> Result<TrainReport, TrainError> {
    let trained: Vec<usize> = (0..data.views.len()).filter(|&v| !is_held_out(config, data, v)).collect();
    let views: Vec<TrainingView<PinholeView>> = trained.iter().map(|&v| data.views[v].clone()).collect();
    if data.points.len() < 4 {
        return Err(TrainError::NoPoints { count: data.points.len(), path: data.sparse.clone() });
    }
    let initial = initial::surfels(data, config.budget / 2);
    let before = quality(data, &initial, None)?;
    let checkpoint = config.output.join(CHECKPOINT);
    let state = match config.resume && checkpoint.is_file() {
        true => read_checkpoint(&checkpoint, views.len())?,
        false => TrainingState::new(initial.clone(), views.len()),
    };
    let begun = Instant::now();
    let mut trainer = Trainer::new(&views, extent_m(&initial), state, settings(config, data));
    let losses = iterate(config, &mut trainer, &checkpoint, progress)?;
    let seconds = begun.elapsed().as_secs_f64();
    let state = trainer.into_state();
    files::create_folder(&config.output.join(RENDERS))?;
    let after = quality(data, &state.surfels, Some((config, &config.output.join(RENDERS))))?;
    let splats: Vec<_> = state.surfels.iter().map(|s| s.to_splat(THICKNESS_M)).collect();
    let path = config.output.join(SPLATS);
    let layout = SplatLayout { form: SplatForm::Discs, ..SplatLayout::default() };
    splat_ply::write(&path, &splats, &origin(&config.dataset)?, layout, config.overwrite)?;
    let row = |v: usize| TrainedViewRow {
        name: data.names[v].clone(),
        held_out: is_held_out(config, data, v),
        psnr_before_db: before[v].0,
        psnr_db: after[v].0,
        ssim: after[v].1,
    };
    let report = TrainReport {
        settings: config.clone(),
        splats: path,
        splats_before: initial.len(),
        splats_after: splats.len(),
        masked: data.masked,
        depth_scale: state.depth_scale,
        seconds,
        views: (0..data.views.len()).map(row).collect(),
        losses,
    };
    files::write_json(&config.output.join(REPORT), &report, config.overwrite)?;
    files::remove(&checkpoint)?;
    Ok(report)
}

fn settings(config: &TrainConfig, data: &TrainData) -> TrainingConfig {
    let mut settings = TrainingConfig::default();
    settings.iterations = config.iterations;
    settings.seed = config.seed;
    settings.appearance = config.appearance;
    settings.schedule = data.schedule;
    if let Some(densify) = &mut settings.densify {
        densify.budget = config.budget;
    }
    settings
}

/// Returns the size of a scene: twice the 90th percentile of the distances from its middle.
fn extent_m(surfels: &[Surfel]) -> f64 {
    let median = |axis: usize| {
        let mut values: Vec<f32> = surfels.iter().map(|s| s.position[axis]).collect();
        values.sort_unstable_by(f32::total_cmp);
        values[values.len() / 2]
    };
    let middle = [0, 1, 2].map(median);
    let distance = |s: &Surfel| (0..3).map(|i| (s.position[i] - middle[i]).powi(2)).sum::<f32>().sqrt();
    let mut distances: Vec<f32> = surfels.iter().map(distance).collect();
    distances.sort_unstable_by(f32::total_cmp);
    2.0 * f64::from(distances[distances.len() * 9 / 10]).max(1e-3)
}

fn iterate(
    config: &TrainConfig,
    trainer: &mut Trainer<'_, PinholeView>,
    checkpoint: &Path,
    progress: &dyn Progress,
) -> Result<Vec<LossPoint>, TrainError> {
    progress.begin("training", config.iterations as usize);
    (0..trainer.state().iteration).for_each(|_| progress.step());
    let (mut points, mut recent) = (Vec::new(), Vec::new());
    while !trainer.is_done() {
        if progress.is_cancelled() {
            write_checkpoint(checkpoint, trainer.state())?;
            progress.check_cancelled()?;
        }
        recent.push(trainer.step());
        let iteration = trainer.state().iteration;
        if iteration.is_multiple_of(LOSS_EVERY) || trainer.is_done() {
            points.push(loss_point(iteration, trainer.state().surfels.len(), &recent));
            recent.clear();
        }
        if iteration.is_multiple_of(config.checkpoint_every.max(1)) && !trainer.is_done() {
            write_checkpoint(checkpoint, trainer.state())?;
        }
        progress.step();
    }
    Ok(points)
}

fn loss_point(iteration: u32, splats: usize, steps: &[TrainingStep]) -> LossPoint {
    let mean = |of: fn(&TrainingStep) -> f64| steps.iter().map(of).sum::<f64>() / steps.len().max(1) as f64;
    LossPoint {
        iteration,
        splats,
        total: mean(|s| s.terms.total),
        colour: mean(|s| s.terms.colour),
        prior_depth: mean(|s| s.terms.prior_depth),
        prior_normal: mean(|s| s.terms.prior_normal),
    }
}

fn write_checkpoint(path: &Path, state: &TrainingState) -> Result<(), FileError> {
    Ok(io::write_bytes(path, &state.to_bytes(), true)?)
}

fn read_checkpoint(path: &Path, views: usize) -> Result<TrainingState, TrainError> {
    let bytes =
        io::read_regular(path, CHECKPOINT_LIMIT).map_err(|source| FileError::Read { path: path.to_owned(), source })?;
    let state =
        TrainingState::from_bytes(&bytes).map_err(|source| TrainError::Checkpoint { path: path.to_owned(), source })?;
    let found = state.appearance.len();
    if found != views {
        return Err(TrainError::OtherViews { path: path.to_owned(), found, expected: views });
    }
    Ok(state)
}

/// Signal-to-noise ratio (dB) and structural similarity of a view.
type Quality = (Option<f64>, Option<f64>);

/// Returns the quality of every view, and writes what the views
/// that were not trained show.
fn quality(
    data: &TrainData,
    surfels: &[Surfel],
    write: Option<(&TrainConfig, &Path)>,
) -> Result<Vec<Quality>, TrainError> {
    let mut rows = Vec::with_capacity(data.views.len());
    let mut drawing = Drawing::new(&[], &data.views[0].camera, Registers::Longest);
    for (number, view) in data.views.iter().enumerate() {
        drawing.redraw(surfels, &view.camera);
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
        rows.push((psnr_db(&found, &truth, &counts), ssim(&found, &truth, &counts)));
        if let Some((config, folder)) = write.filter(|(config, _)| is_held_out(config, data, number)) {
            let stem = Path::new(&data.names[number]).file_stem().unwrap_or_default().to_string_lossy();
            let picture = found.map(|c| c.map(|v| (255.0 * v.clamp(0.0, 1.0)).round() as u8));
            write_png_rgb(folder.join(format!("{stem}.png")), &picture, config.overwrite)?;
        }
    }
    Ok(rows)
}

/// Returns where the dataset lies, as far as its origin says so.
fn origin(dataset: &Path) -> Result<LocalOrigin, TrainError> {
    let path = dataset.join("origin.json");
    let unknown = LocalOrigin::new("frame of the dataset", "unknown", [0.0; 3]);
    if !path.is_file() {
        return Ok(unknown);
    }
    let invalid = |what: String| TrainError::Dataset { path: path.clone(), what };
    let value: Value = serde_json::from_str(&files::read_text(&path)?).map_err(|e| invalid(e.to_string()))?;
    let part = &value["model_from_dataset"];
    let identity = serde_json::json!([[1.0, 0.0, 0.0], [0.0, 1.0, 0.0], [0.0, 0.0, 1.0]]);
    let shift: Option<[f64; 3]> = serde_json::from_value(part["translation"].clone()).ok();
    match (value["model_crs"].as_str(), shift) {
        (Some(crs), Some(shift)) if part["scale"] == 1.0 && part["rotation"] == identity => {
            Ok(LocalOrigin::new(crs, "unknown", shift))
        }
        _ => Ok(unknown),
    }
}
