//! Priors for perspective cameras: a dataset for Gaussian splatting trainers.

use std::collections::BTreeMap;
use std::path::Path;

use ::priors::{
    Amount, DepthKind, NormalFrame, PriorModel, Samples, Schedule, Spacing, View, Visibility, Visible, buildings_of,
    error_curve, sample,
};
use city::SurfaceClass;
use numeric::{Choice, Progress};
use report::{ErrorRow, PriorsReport, counted};
use serde_json::{Value, json};

use super::cameras::SceneCameras;
use super::config::{PriorsConfig, PriorsMode};
use super::dataset::Dataset;
use super::error::PriorsJobError;
use super::folder::PriorsFolder;
use super::frame::DatasetFrame;
use super::images::Pictures;
use super::labels::labels;
use super::maps::{self, WrittenMaps};
use super::model::UsableModel;
use super::notes::notes;
use super::outcome::{PriorsJobReport, PriorsProduct};
use super::points;
use super::size::{in_words, largest_bytes};
use super::trainer;
use job::files::{self, FileError};

/// Geometric errors of the curve, relative to the one asked for.
const CURVE: [f64; 4] = [8.0, 4.0, 2.0, 1.0];

/// Makes a dataset.
pub(super) fn make(config: &PriorsConfig, progress: &dyn Progress) -> Result<PriorsJobReport, PriorsJobError> {
    if config.map_epsg.is_some() || config.vertical.is_some() || config.corrections.is_some() {
        return Err(PriorsJobError::NotSatellite);
    }
    let partial = PriorsFolder::take(config)?;
    let sampling = config.sampling()?;
    let cameras = SceneCameras::read(config)?;
    let read = UsableModel::read(config)?;
    let unusable = read.unusable();
    let frame = DatasetFrame::new(config, read.meshed.mesh.origin, &cameras)?;
    let model = PriorModel::new(read.meshed.mesh, &buildings_of(&read.file.model))?;
    let views = frame.views(&cameras);
    let pictures = Pictures::find(config, &cameras)?;
    let samples = sample(&model, &sampling)?;
    progress.choice(&size(config, &cameras, samples.points.len()));
    let visible = visible(config, &model, &samples, &views, progress)?;
    if visible.points.is_empty() {
        progress.warn("no point of a building is seen by enough cameras, so the dataset has no points");
    }
    let dataset = Dataset {
        config,
        file: &read.file,
        model: &model,
        cameras: &cameras,
        frame: &frame,
        views: &views,
        sampling: &sampling,
        samples: &samples,
        visible: &visible,
        pictures: pictures.as_ref(),
        unusable,
    };
    let report = write(&dataset, partial.path(), progress)?;
    let bytes = files::bytes_below(partial.path());
    partial.publish()?;
    let (product, output) = (PriorsProduct::Dataset(Box::new(report)), config.output.clone());
    Ok(PriorsJobReport { product, unusable_objects: unusable, output, bytes })
}

/// Says how large the dataset gets at most.
fn size(config: &PriorsConfig, cameras: &SceneCameras, points: usize) -> Choice {
    let lenses = &cameras.model.lenses;
    let sizes = cameras.model.views.iter().map(|view| [lenses[view.lens].width(), lenses[view.lens].height()]);
    let sizes: Vec<_> = sizes.collect();
    let points_of = if config.maps_only { String::new() } else { format!(" and up to {}", counted(points, "point")) };
    Choice {
        name: "size".to_owned(),
        value: format!("at most {}", in_words(largest_bytes(config, points, &sizes))),
        reason: format!("the maps of {}{points_of}", counted(sizes.len(), "view")),
    }
}

/// Finds the points that enough cameras see.
fn visible(
    config: &PriorsConfig,
    model: &PriorModel,
    samples: &Samples,
    views: &[View],
    progress: &dyn Progress,
) -> Result<Visible, PriorsJobError> {
    let mut visibility = Visibility::new(model, &samples.points, config.visibility)?;
    progress.begin("visibility", views.len());
    let mut candidates = 0;
    for view in views {
        progress.check_cancelled()?;
        candidates += visibility.add(view).candidates;
        progress.step();
    }
    if candidates == 0 {
        return Err(nothing_in_sight(model, views));
    }
    Ok(visibility.finish())
}

/// The error of cameras that see no building, with the boxes around cameras and model.
fn nothing_in_sight(model: &PriorModel, views: &[View]) -> PriorsJobError {
    let origin = model.mesh().origin;
    let to_model = |p: [f64; 3]| [p[0] + origin.x, p[1] + origin.y, p[2] + origin.z];
    let bounds = |points: &mut dyn Iterator<Item = [f64; 3]>| {
        let limits = points.fold(([f64::INFINITY; 3], [f64::NEG_INFINITY; 3]), |(low, high), p| {
            ([0, 1, 2].map(|i| low[i].min(p[i])), [0, 1, 2].map(|i| high[i].max(p[i])))
        });
        let text = |p: [f64; 3]| format!("({:.0}, {:.0}, {:.0})", p[0], p[1], p[2]);
        format!("{} to {}", text(limits.0), text(limits.1))
    };
    PriorsJobError::NothingInSight {
        cameras: bounds(&mut views.iter().map(|v| to_model(v.pose.centre))),
        model: bounds(&mut model.mesh().positions.iter().map(|p| to_model(*p))),
    }
}

/// Writes all of a dataset into a folder.
fn write(dataset: &Dataset<'_>, folder: &Path, progress: &dyn Progress) -> Result<PriorsReport, PriorsJobError> {
    let written = maps::write(dataset, folder, progress)?;
    if !dataset.config.maps_only {
        points::write(dataset, folder)?;
        points::write_crops(dataset, folder)?;
    }
    let city_model = &dataset.file.model;
    files::write_json(&folder.join("labels.json"), &labels(city_model, dataset.model.mesh()), false)?;
    files::write_json(&folder.join("schedule.json"), &schedule(dataset.config.mode), false)?;
    files::write_json(&folder.join("origin.json"), &dataset.frame.describe(&city_model.crs), false)?;
    let report = report(dataset, &written)?;
    let page = report.html(&written.pictures)?;
    formats::write_bytes(folder.join("report.html"), page.as_bytes(), false).map_err(FileError::from)?;
    files::write_json(&folder.join("report.json"), &report.json().map_err(FileError::from)?, false)?;
    Ok(report)
}

fn schedule(mode: PriorsMode) -> Value {
    json!({
        "mode": mode.name(),
        "factors": Schedule::default(),
        "depth_alignment": "alpha = median(prior) / median(rendered) over the pixels of the mask, per view; compare prior with alpha * rendered",
        "mask": match mode {
            PriorsMode::BuildingOnly => "images, depths and normals are masked to buildings (masks/, raw_mask/)",
            PriorsMode::BuildingEnhanced => "the whole image is trained; priors weigh only inside the mask (masks/, raw_mask/)",
        },
        "source": "values of the released code of GS4Buildings, linear between the two iterations",
    })
}

fn report(dataset: &Dataset<'_>, written: &WrittenMaps) -> Result<PriorsReport, PriorsJobError> {
    let Dataset { config, samples, visible, cameras, .. } = dataset;
    let curve = error_curve(dataset.model, dataset.sampling, &CURVE)?;
    let mut by_class: BTreeMap<SurfaceClass, usize> = BTreeMap::new();
    for &point in &visible.points {
        *by_class.entry(samples.points[point as usize].class).or_insert(0) += 1;
    }
    Ok(PriorsReport {
        model: config.model.display().to_string(),
        cameras: cameras.source.display().to_string(),
        mode: config.mode.name().to_owned(),
        notes: notes(dataset),
        triangles: dataset.model.mesh().triangles.len(),
        sampled_area_m2: samples.area_m2,
        skipped_area_m2: samples.skipped_m2.iter().map(|(class, area)| (class.to_string(), *area)).collect(),
        samples: samples.points.len(),
        kept: visible.points.len(),
        min_views: config.visibility.min_views,
        pairs: visible.pairs,
        views_histogram: visible.histogram.clone(),
        kept_by_class: by_class.iter().map(|(class, count)| (class.to_string(), *count)).collect(),
        scene_points: cameras.points.len(),
        error_curve: curve
            .iter()
            .map(|c| ErrorRow { error_m: c.error_m, points: c.points, even_points: c.even_points })
            .collect(),
        depth_png_step: Some(written.depth_png_step),
        views: written.rows.clone(),
        commands: trainer::commands(dataset.config, written.depth_png_step),
        settings: settings(dataset),
    })
}

/// Describes the number of points in words.
fn amount(amount: Amount) -> String {
    match amount {
        Amount::Count(count) => format!("{count} points"),
        Amount::PerSquareMetre(density) => format!("{density} points per m²"),
        Amount::Adaptive { error_m, max_spacing_m } => {
            format!("as many points as an error of {error_m} m needs, at most {max_spacing_m} m apart")
        }
    }
}

/// Describes the distribution of the points in words.
fn spacing(spacing: Spacing) -> &'static str {
    match spacing {
        Spacing::Random => "independent",
        Spacing::Stratified => "stratified",
        Spacing::PoissonDisk => "Poisson disks",
    }
}

fn settings(dataset: &Dataset<'_>) -> Value {
    let Dataset { config, sampling, samples, frame, .. } = dataset;
    json!({
        "sampling": format!("{}, {}, seed {}", amount(sampling.amount), spacing(sampling.spacing), config.seed),
        "disk_m": samples.disk_m,
        "margin_px": config.visibility.margin_px,
        "near_m": config.visibility.near_m,
        "epsilon_m": config.visibility.epsilon_m,
        "max_incidence_deg": config.visibility.max_incidence_deg,
        "max_observations": config.visibility.max_observations,
        "depth": match config.maps.depth {
            DepthKind::ZDepth => "along the optical axis",
            DepthKind::RayLength => "along the ray",
        },
        "normals": match config.maps.normals {
            NormalFrame::World => "in the axes of the world",
            NormalFrame::Camera => "in the axes of each camera",
        },
        "depth_miss": format!("{} in npy, 0 in depth_png, -32768 in GeoTIFF", config.miss.depth()),
        "units_per_metre": frame.scale(),
    })
}
