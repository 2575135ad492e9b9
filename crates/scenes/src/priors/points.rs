//! The points of a dataset: COLMAP model, PLY files, first splats and crops.

use std::collections::BTreeMap;
use std::path::Path;

use ::priors::{Sample, initial_splats, surface_label};
use formats::colmap::{self, ColmapEncoding, ColmapModel, ColmapObservation, ColmapPoint};
use formats::ply::{self, PlyPoint};
use formats::splat_ply::{self, LocalOrigin, SplatFile, SplatForm, SplatLayout};

use super::dataset::Dataset;
use super::labels::{colour, with_table};
use job::files::{self, FileError};

/// Writes the kept points as a COLMAP model and as PLY, and with extras as text, as a second PLY
/// and as splats.
pub(super) fn write(dataset: &Dataset<'_>, folder: &Path) -> Result<(), FileError> {
    let kept = kept(dataset);
    let sparse = folder.join("sparse/0");
    files::create_folder(&sparse)?;
    let points = colmap_points(dataset, &kept);
    let model = colmap_model(dataset);
    let extras = dataset.config.extras;
    for encoding in [ColmapEncoding::Binary].into_iter().chain(extras.then_some(ColmapEncoding::Text)) {
        colmap::write(&sparse, &model, &points, encoding, false).map_err(FileError::write)?;
    }
    let normals = kept.iter().map(|s| s.normal).chain(std::iter::repeat([0.0; 3]));
    let ply_points: Vec<PlyPoint> = points
        .iter()
        .zip(normals)
        .map(|(p, normal)| PlyPoint { position: p.position.map(|c| c as f32), normal, color: p.color })
        .collect();
    let crs = &dataset.file.model.crs;
    let comment = format!("skysweep priors: the frame is described in origin.json; model CRS {crs}");
    // 2DGS looks for the points beside the cameras, some other loaders in the folder above.
    let above = extras.then(|| folder.join("points3D.ply"));
    for path in [sparse.join("points3D.ply")].into_iter().chain(above) {
        ply::write_points(path, ply_points.iter().copied(), std::slice::from_ref(&comment), false)
            .map_err(FileError::write)?;
    }
    if extras { write_splats(dataset, folder, &kept) } else { Ok(()) }
}

/// Writes how the images are to be cropped, where any is.
pub(super) fn write_crops(dataset: &Dataset<'_>, folder: &Path) -> Result<(), FileError> {
    let cameras = dataset.cameras;
    let views = cameras.model.views.iter();
    let crops: BTreeMap<&str, _> =
        views.filter_map(|view| Some((view.name.as_str(), cameras.crops[view.lens]?))).collect();
    if crops.is_empty() { Ok(()) } else { files::write_json(&folder.join("crops.json"), &crops, false) }
}

/// Returns the kept points in the lengths and axes of the dataset.
fn kept(dataset: &Dataset<'_>) -> Vec<Sample> {
    let frame = dataset.frame;
    let moved = |&number: &u32| {
        let sample = &dataset.samples.points[number as usize];
        Sample {
            position: frame.dataset_from_mesh(sample.position),
            normal: frame.turn(sample.normal.map(f64::from)).map(|c| c as f32),
            spacing_m: (f64::from(sample.spacing_m) * frame.scale()) as f32,
            ..*sample
        }
    };
    dataset.visible.points.iter().map(moved).collect()
}

fn write_splats(dataset: &Dataset<'_>, folder: &Path, kept: &[Sample]) -> Result<(), FileError> {
    let colours = kept.iter().map(|s| (s, colour(s.class).map(|c| f32::from(c) / 255.0)));
    let splats = initial_splats(colours);
    let labels = kept.iter().map(|s| surface_label(s.class, s.object)).collect();
    let labels = with_table(labels, &dataset.file.model);
    let path = folder.join("splats");
    files::create_folder(&path)?;
    let moved = dataset.frame.moved_by().unwrap_or_default();
    let origin = LocalOrigin::new("frame of the cameras, see origin.json", "frame of the cameras", moved);
    for (name, form) in [("splats_2dgs.ply", SplatForm::Discs), ("splats_3dgs.ply", SplatForm::Ellipsoids)] {
        let layout = SplatLayout { form, sh_degree: 3 };
        let (splats, labels, origin) = (splats.clone(), Some(labels.clone()), Some(origin.clone()));
        let file = SplatFile { splats, harmonics: None, labels, layout, origin };
        splat_ply::write_file(&path.join(name), &file, false).map_err(FileError::write)?;
    }
    Ok(())
}

fn colmap_model(dataset: &Dataset<'_>) -> ColmapModel {
    let mut model = dataset.cameras.model.clone();
    for (number, view) in model.views.iter_mut().enumerate() {
        view.pose.centre = dataset.frame.dataset_from_camera(view.pose.centre);
        if let Some(pictures) = dataset.pictures {
            view.name = pictures.name(number).to_owned();
        }
    }
    model
}

/// Returns the kept points with their tracks, followed by the points of the structure from motion.
fn colmap_points(dataset: &Dataset<'_>, kept: &[Sample]) -> Vec<ColmapPoint> {
    let own = kept.iter().zip(&dataset.visible.observations).map(|(sample, observations)| ColmapPoint {
        position: sample.position,
        color: colour(sample.class),
        error_px: 0.0,
        track: observations.iter().map(|o| ColmapObservation { view: o.view, pixel: o.pixel }).collect(),
    });
    let scene = dataset.cameras.points.iter().map(|point| {
        let track = point.track.iter().filter_map(|seen| cropped(dataset, *seen)).collect();
        ColmapPoint { position: dataset.frame.dataset_from_camera(point.position), track, ..point.clone() }
    });
    own.chain(scene).collect()
}

/// Moves an observation of the structure from motion into the kept part of its image; `None`
/// outside of it.
fn cropped(dataset: &Dataset<'_>, mut seen: ColmapObservation) -> Option<ColmapObservation> {
    let cameras = dataset.cameras;
    let Some(crop) = cameras.crops[cameras.model.views[seen.view as usize].lens] else {
        return Some(seen);
    };
    seen.pixel.sample -= crop.x as f64;
    seen.pixel.line -= crop.y as f64;
    let inside = |at: f64, size: usize| (-0.5..size as f64 - 0.5).contains(&at);
    (inside(seen.pixel.sample, crop.width) && inside(seen.pixel.line, crop.height)).then_some(seen)
}
