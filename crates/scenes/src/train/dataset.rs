//! Reads the cameras, images, prior maps, points and schedule of a dataset.

use std::path::{Path, PathBuf};

use ::train::{PinholeView, TrainingView};
use formats::colmap::{ColmapPoint, read_with_points};
use formats::npy::{self, NpyArray, NpyData};
use numeric::Progress;
use priors::Schedule;
use raster::Grid;
use serde_json::Value;

use super::config::{TrainConfig, TrainPriors};
use super::error::TrainError;
use super::held_out::held_out;
use super::picture::{self, Left, Undistortion};
use super::place::{DatasetPlace, more_points};
use super::recipe::TrainPreset;
use super::transforms;
use crate::small_view::{pinhole, shrunk};
use job::dataset_folder::{pictures_folder, sparse_folder};
use job::files;

/// A dataset in memory.
#[derive(Debug)]
pub(super) struct TrainData {
    /// File names of the views.
    pub(super) names: Vec<String>,
    pub(super) views: Vec<TrainingView<PinholeView>>,
    /// Whether a view is kept for the judgement.
    pub(super) held_out: Vec<bool>,
    /// Number of the view of each camera of the model; `None` where it has no image.
    pub(super) view_of: Vec<Option<usize>>,
    pub(super) points: Vec<ColmapPoint>,
    /// Factors of the priors, where the dataset states them.
    pub(super) schedule: Option<Schedule>,
    /// What the dataset was made for.
    pub(super) preset: TrainPreset,
    /// Whether only what is masked is modelled.
    pub(super) masked: bool,
    /// Folder of the model.
    pub(super) sparse: PathBuf,
    /// Place of the dataset, whose positions are counted from its origin.
    pub(super) place: DatasetPlace,
}

impl TrainData {
    pub(super) fn read(config: &TrainConfig, progress: &dyn Progress) -> Result<Self, TrainError> {
        let folder = &config.dataset;
        let sparse = sparse_folder(folder);
        let transforms = transforms::file(folder, &sparse);
        let (mut model, mut points) = match &transforms {
            Some(path) => (transforms::read(path, config.images.as_deref().unwrap_or(folder))?, Vec::new()),
            None => read_with_points(&sparse)?,
        };
        if transforms.is_some() && config.more_points.is_none() {
            points = transforms::points(&model, config.seed);
            let count = points.len();
            progress.warn(&format!("the dataset has no points: the training begins with {count} random ones"));
        }
        if let Some(other) = &config.more_points {
            points.extend(more_points(&model, &sparse_folder(other))?);
        }
        let place = DatasetPlace::read(folder, &mut model)?;
        let [x, y, z] = place.shift;
        points.iter_mut().for_each(|p| p.position = [p.position[0] - x, p.position[1] - y, p.position[2] - z]);
        let (schedule, preset) = schedule(folder)?;
        let masked = schedule.is_some() && preset == TrainPreset::BuildingOnly;
        check_conventions(folder)?;
        let wanted: Vec<&str> = model.views.iter().map(|view| view.name.as_str()).collect();
        let images = config.images.clone().unwrap_or_else(|| pictures_folder(folder, &sparse, &wanted));
        let (names, views, view_of) = (Vec::new(), Vec::new(), Vec::new());
        let held = Vec::new();
        let mut data = Self { names, views, held_out: held, view_of, points, schedule, preset, masked, sparse, place };
        progress.begin("images", model.views.len());
        // One for each lens, made where it is needed.
        let mut undistortions: Vec<Option<Option<Undistortion>>> = vec![None; model.lenses.len()];
        let mut left = Left { pixels: 0, kept: 0 };
        for view in &model.views {
            progress.check_cancelled()?;
            let path = images.join(&view.name);
            if path.is_file() {
                data.view_of.push(Some(data.views.len()));
                let lens = &model.lenses[view.lens];
                let undistortion = undistortions[view.lens].get_or_insert_with(|| Undistortion::new(lens)).as_ref();
                let masks = config.masks.as_deref();
                let (pixels, own) = picture::read(&path, view, lens, undistortion, masks)?;
                if own.kept == 0 {
                    return Err(TrainError::EmptyMask { name: view.name.clone() });
                }
                left = Left { pixels: left.pixels + own.pixels, kept: left.kept + own.kept };
                let lens = undistortion.map_or(lens, |to| &to.lens);
                let camera = pinhole(view, lens, config.shrink)
                    .ok_or_else(|| TrainError::Lens { name: view.name.clone(), model: lens.model().name() })?;
                data.views.push(read_view(config, &view.name, (camera, &pixels), undistortion, masked)?);
                data.names.push(view.name.clone());
            } else {
                data.view_of.push(None);
            }
            progress.step();
        }
        if data.views.is_empty() {
            return Err(TrainError::NoImages { cameras: model.views.len(), folder: images });
        }
        if config.masks.is_some() && left.kept == left.pixels {
            progress.warn("the masks are 0 nowhere, so that they leave nothing out");
        }
        data.held_out = held_out(config, &data.names)?;
        let missing = model.views.len() - data.views.len();
        if missing > 0 {
            progress.warn(&format!("{missing} of {} cameras have no image and are left out", model.views.len()));
        }
        Ok(data)
    }
}

fn read_view(
    config: &TrainConfig,
    name: &str,
    (camera, pixels): (PinholeView, &Grid<[f32; 3]>),
    undistortion: Option<&Undistortion>,
    masked: bool,
) -> Result<TrainingView<PinholeView>, TrainError> {
    let (full, size) = ([pixels.width(), pixels.height()], camera.size);
    let colour = [0, 1, 2].map(|c| shrunk(size, config.shrink, |x, y| pixels[(x, y)][c]));
    let nested = Path::new(name).with_extension("");
    let flat = nested.file_name().unwrap_or_default();
    let map = |kind: &str, channels: usize| -> Result<Option<Vec<f32>>, TrainError> {
        // Maps for 2DGS leave out the folders of the name.
        let paths = [nested.as_os_str(), flat].map(|stem| {
            let mut file = config.dataset.join(kind).join(stem).into_os_string();
            file.push(".npy");
            PathBuf::from(file)
        });
        let found = paths.iter().find(|path| path.is_file());
        found.map(|path| numbers(path, full, channels)).transpose()
    };
    let at = |x: usize, y: usize| y * full[0] + x;
    let half = config.shrink / 2;
    // Maps are of the lens with its distortion, too.
    let source = |pixel: usize| undistortion.map_or(Some(pixel), |to| to.nearest(pixel));
    let nearest = |of: &dyn Fn(usize) -> f32| -> Vec<f32> {
        let pixel = |i: usize| at(i % size[0] * config.shrink + half, i / size[0] * config.shrink + half);
        (0..size[0] * size[1]).map(|i| source(pixel(i)).map_or(f32::NAN, of)).collect()
    };
    let finite = |v: f32| if v.is_finite() && v != 0.0 { v } else { f32::NAN };
    let wants = |kind| config.priors == TrainPriors::Both || config.priors == kind;
    let depth = if wants(TrainPriors::Depth) { map("raw_depth", 1)? } else { None };
    let normal = if wants(TrainPriors::Normal) { map("raw_normal", 3)? } else { None };
    let mask = if masked { map("raw_mask", 1)? } else { None };
    Ok(TrainingView {
        mask: mask.map(|mask| nearest(&|i| mask[i]).into_iter().map(|v| v > 0.0).collect()),
        prior_depth_m: depth.map(|depth| nearest(&|i| finite(depth[i]))),
        prior_normal: normal.map(|normal| {
            // A normal of zeros stands for none.
            let known = |i: usize| normal[3 * i..3 * i + 3].iter().any(|c| *c != 0.0);
            [0, 1, 2].map(|c| nearest(&|i| if known(i) { normal[3 * i + c] } else { f32::NAN }))
        }),
        ..TrainingView::new(camera, colour)
    })
}

fn numbers(path: &Path, size: [usize; 2], channels: usize) -> Result<Vec<f32>, TrainError> {
    let NpyArray { shape, data } = npy::read(path)?;
    let expected: &[usize] = if channels == 1 { &[size[1], size[0]] } else { &[size[1], size[0], channels] };
    if shape != expected {
        let what = format!("the array has the shape {shape:?}, expected {expected:?}");
        return Err(TrainError::Dataset { path: path.to_owned(), what });
    }
    Ok(match data {
        NpyData::F32(values) => values,
        other => other.to_f64().into_iter().map(|v| v as f32).collect(),
    })
}

/// Reads the schedule, and what the dataset is for. One without a schedule is of photographs.
fn schedule(folder: &Path) -> Result<(Option<Schedule>, TrainPreset), TrainError> {
    let path = folder.join("schedule.json");
    if !path.is_file() {
        return Ok((None, TrainPreset::Photographs));
    }
    let invalid = |what: String| TrainError::Dataset { path: path.clone(), what };
    let value: Value = serde_json::from_str(&files::read_text(&path)?).map_err(|e| invalid(e.to_string()))?;
    let factors = serde_json::from_value(value["factors"].clone())
        .map_err(|error| invalid(format!("the factors are not those of a schedule ({error})")))?;
    let only = value["mode"] == "building-only";
    Ok((Some(factors), if only { TrainPreset::BuildingOnly } else { TrainPreset::BuildingEnhanced }))
}

/// Checks that depths and normals are meant as the rasteriser means them.
fn check_conventions(folder: &Path) -> Result<(), TrainError> {
    let path = folder.join("report.json");
    if !path.is_file() {
        return Ok(());
    }
    let invalid = |what: String| TrainError::Dataset { path: path.clone(), what };
    let value: Value = serde_json::from_str(&files::read_text(&path)?).map_err(|e| invalid(e.to_string()))?;
    for (key, expected) in [("depth", "along the optical axis"), ("normals", "in the axes of the world")] {
        if let Some(found) = value["settings"][key].as_str().filter(|found| *found != expected) {
            return Err(invalid(format!("the {key} of the maps: {found}, expected {expected}: make the priors anew")));
        }
    }
    Ok(())
}
