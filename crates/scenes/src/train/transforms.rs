//! Datasets of nerfstudio and instant-ngp: cameras in a `transforms.json`, without points.
//!
//! A training then begins with random points, as 3DGS does where a dataset has none: in the ball
//! about the place that the cameras look at, as large as their mean distance from it.

use std::path::{Path, PathBuf};

use formats::colmap::{ColmapModel, ColmapObservation, ColmapPoint};
use numeric::SplitMix64;

use super::error::TrainError;

/// Name of the file.
const FILE: &str = "transforms.json";
/// Random points at the beginning. Splats are split where more are needed; 3DGS begins with
/// 100,000 for images that are seldom larger than a megapixel, a step costs as many times more.
const POINTS: usize = 20_000;
/// Least views that see a random point: from fewer its distance cannot be learned.
const LEAST_VIEWS: usize = 2;
/// Endings that are tried for images, whose names often have none.
const ENDINGS: [&str; 4] = ["", ".png", ".jpg", ".JPG"];

/// Returns the file with the cameras of a dataset that has no COLMAP model in `sparse`.
pub(super) fn file(folder: &Path, sparse: &Path) -> Option<PathBuf> {
    let has_model = ["cameras.bin", "cameras.txt"].iter().any(|name| sparse.join(name).is_file());
    let path = folder.join(FILE);
    (!has_model && path.is_file()).then_some(path)
}

/// Reads the cameras. Images get the endings that their files in `images` have.
pub(super) fn read(path: &Path, images: &Path) -> Result<ColmapModel, TrainError> {
    let mut model = formats::transforms::read(path, None)?;
    for view in &mut model.views {
        let ended = ENDINGS.iter().map(|ending| format!("{}{ending}", view.name));
        if let Some(name) = ended.into_iter().find(|name| images.join(name).is_file()) {
            view.name = name;
        }
    }
    Ok(model)
}

/// Returns random points that the cameras see.
pub(super) fn points(model: &ColmapModel, seed: u64) -> Vec<ColmapPoint> {
    let middle = middle(model);
    let apart = |c: [f64; 3]| (0..3).map(|i| (c[i] - middle[i]).powi(2)).sum::<f64>().sqrt();
    let radius = model.views.iter().map(|view| apart(view.pose.centre)).sum::<f64>() / model.views.len().max(1) as f64;
    let mut random = SplitMix64::new(seed);
    let mut made = Vec::with_capacity(POINTS);
    for _ in 0..POINTS {
        let offset = loop {
            let offset = [0; 3].map(|_| random.uniform_in(-1.0, 1.0));
            if offset.iter().map(|c| c * c).sum::<f64>() <= 1.0 {
                break offset;
            }
        };
        let position = [0, 1, 2].map(|i| middle[i] + radius * offset[i]);
        let track: Vec<ColmapObservation> =
            (0..model.views.len()).filter_map(|view| observation(model, view, position)).collect();
        if track.len() >= LEAST_VIEWS {
            made.push(ColmapPoint { position, color: [128; 3], error_px: -1.0, track });
        }
    }
    made
}

/// Returns where a view sees a place.
fn observation(model: &ColmapModel, view: usize, position: [f64; 3]) -> Option<ColmapObservation> {
    let seen = &model.views[view];
    let lens = &model.lenses[seen.lens];
    let [x, y, z] = seen.pose.camera_from_world(position);
    let pixel = (z > 0.0).then(|| lens.project(x / z, y / z)).flatten()?;
    let inside = |at: f64, side: usize| (-0.5..side as f64 - 0.5).contains(&at);
    let is_seen = inside(pixel.sample, lens.width()) && inside(pixel.line, lens.height());
    is_seen.then_some(ColmapObservation { view: view as u32, pixel })
}

/// Returns the place that is nearest to all optical axes (least squares): what the cameras look at.
/// With axes that are parallel it is as far from the cameras as they are apart.
fn middle(model: &ColmapModel) -> [f64; 3] {
    let count = model.views.len().max(1) as f64;
    let (mut matrix, mut right) = ([[0.0f64; 3]; 3], [0.0f64; 3]);
    let (mut mean, mut ahead) = ([0.0f64; 3], [0.0f64; 3]);
    for view in &model.views {
        let (axis, centre) = (view.pose.rotation[2], view.pose.centre);
        for i in 0..3 {
            mean[i] += centre[i] / count;
            ahead[i] += axis[i] / count;
            for k in 0..3 {
                let across = if i == k { 1.0 } else { 0.0 } - axis[i] * axis[k];
                matrix[i][k] += across / count;
                right[i] += across * centre[k] / count;
            }
        }
    }
    let [a, b, c] = matrix;
    let cross =
        |u: [f64; 3], v: [f64; 3]| [u[1] * v[2] - u[2] * v[1], u[2] * v[0] - u[0] * v[2], u[0] * v[1] - u[1] * v[0]];
    let columns = [cross(b, c), cross(c, a), cross(a, b)];
    let determinant: f64 = (0..3).map(|i| a[i] * columns[0][i]).sum();
    // Of axes a tenth of a radian apart it is some 0.01, of parallel ones 0.
    if determinant > 1e-4 {
        return [0, 1, 2].map(|i| (0..3).map(|k| columns[k][i] * right[k]).sum::<f64>() / determinant);
    }
    let spread = model.views.iter().flat_map(|view| (0..3).map(move |i| (view.pose.centre[i], i)));
    let spread = (spread.map(|(c, i)| (c - mean[i]).powi(2)).sum::<f64>() / count).sqrt().max(1.0);
    [0, 1, 2].map(|i| mean[i] + 2.0 * spread * ahead[i])
}

#[cfg(test)]
mod tests {
    use super::*;
    use camera::{Lens, LensModel, Pose};
    use formats::colmap::ColmapView;

    #[test]
    fn random_points_lie_where_the_cameras_look() {
        let lens = Lens::new(100, 80, LensModel::OpenCv, &[90.0, 90.0, 49.5, 39.5, -0.1, 0.0, 0.0, 0.0]).unwrap();
        // On a circle of 5 about (10, 20, 30), which all look at.
        let view = |number: u32| {
            let (sin, cos) = f64::from(number).sin_cos();
            ColmapView {
                id: number,
                name: format!("{number}"),
                lens: 0,
                pose: Pose {
                    rotation: [[-sin, cos, 0.0], [0.0, 0.0, -1.0], [-cos, -sin, 0.0]],
                    centre: [10.0 + 5.0 * cos, 20.0 + 5.0 * sin, 30.0],
                },
            }
        };
        let mut model = ColmapModel { lenses: vec![lens], views: (0..6).map(view).collect() };
        let looked_at = middle(&model);
        assert!((0..3).all(|i| (looked_at[i] - [10.0, 20.0, 30.0][i]).abs() < 1e-9), "{looked_at:?}");
        let found = points(&model, 3);
        assert!(found.len() > POINTS / 2 && found.iter().all(|p| p.track.len() >= LEAST_VIEWS), "{}", found.len());
        assert_eq!(found, points(&model, 3));
        assert!(found[..50] != points(&model, 4)[..50]);
        let pose = model.views[0].pose;
        model.views.iter_mut().enumerate().for_each(|(i, v)| {
            v.pose = Pose { centre: [pose.centre[0], pose.centre[1] + i as f64, 30.0], ..pose };
        });
        assert!(middle(&model)[0] < pose.centre[0] - 1.0, "{:?}", middle(&model));
    }
}
