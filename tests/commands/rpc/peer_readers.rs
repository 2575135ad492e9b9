//! What is written for trainers loads in other people's readers: pycolmap, Open3D, trimesh, NumPy.
//!
//! `benches/peers/check_priors.py` does the checks. It runs with the Python that
//! `SKYSWEEP_PEERS_PYTHON` names, else with `python3`. Packages that are not installed are skipped
//! with a line each.

use std::path::Path;
use std::process::Command;

use camera::{ImagePoint, Lens, LensModel, Pose};
use formats::colmap::{self, ColmapEncoding, ColmapModel, ColmapObservation, ColmapPoint, ColmapView};
use formats::ply::{self, PlyPoint};

fn model() -> (ColmapModel, Vec<ColmapPoint>) {
    let lenses = vec![
        Lens::new(64, 48, LensModel::Pinhole, &[60.0, 61.0, 31.5, 23.5]).unwrap(),
        Lens::new(64, 48, LensModel::OpenCv, &[60.0, 61.0, 31.0, 23.0, 0.05, -0.01, 1e-3, 2e-3]).unwrap(),
    ];
    let view = |number: u32| ColmapView {
        id: 10 + number,
        name: format!("views/image {number}.png"),
        lens: number as usize % 2,
        pose: Pose::from_quaternion([1.0, 0.02 * f64::from(number), 0.01, -0.03], [0.1, -0.2, 8.0]).unwrap(),
    };
    let views: Vec<ColmapView> = (0..4).map(view).collect();
    let points = (0..50).map(|number| {
        let n = f64::from(number);
        let position = [(n * 0.7).sin(), (n * 1.3).cos(), 0.5 * (n * 0.3).sin()];
        let seen = |(index, view): (usize, &ColmapView)| {
            let [x, y, z] = view.pose.camera_from_world(position);
            let pixel: ImagePoint = lenses[view.lens].project(x / z, y / z)?;
            Some(ColmapObservation { view: index as u32, pixel })
        };
        let track = views.iter().enumerate().filter_map(seen).collect();
        ColmapPoint { position, color: [number as u8, 100, 200], error_px: 0.0, track }
    });
    let points = points.collect();
    (ColmapModel { lenses, views }, points)
}

fn dataset(folder: &Path) {
    let (model, points) = model();
    let sparse = folder.join("sparse/0");
    std::fs::create_dir_all(&sparse).unwrap();
    for encoding in [ColmapEncoding::Binary, ColmapEncoding::Text] {
        colmap::write(&sparse, &model, &points, encoding, false).unwrap();
    }
    let point =
        |p: &ColmapPoint| PlyPoint { position: p.position.map(|c| c as f32), normal: [0.0, 0.6, 0.8], color: p.color };
    ply::write_points(sparse.join("points3D.ply"), points.iter().map(point), &["origin 0 0 0".into()], false).unwrap();
    for name in ["raw_depth", "raw_normal", "raw_mask"] {
        std::fs::create_dir(folder.join(name)).unwrap();
    }
    let depth: Vec<f32> = (0..64 * 48).map(|n| if n % 3 == 0 { f32::INFINITY } else { n as f32 }).collect();
    formats::npy::write(folder.join("raw_depth/a.npy"), &[48, 64], &depth, false).unwrap();
    formats::npy::write(folder.join("raw_normal/a.npy"), &[48, 64, 3], &vec![0.5f32; 48 * 64 * 3], false).unwrap();
    formats::npy::write(folder.join("raw_mask/a.npy"), &[48, 64], &vec![true; 48 * 64], false).unwrap();
    formats::npy::write(folder.join("raw_mask/ids.npy"), &[48, 64], &vec![7u32; 48 * 64], false).unwrap();
}

#[test]
fn other_readers_load_what_is_written() {
    let folder = tempfile::tempdir().unwrap();
    dataset(folder.path());
    let python = std::env::var("SKYSWEEP_PEERS_PYTHON").unwrap_or_else(|_| "python3".to_owned());
    let script = Path::new(env!("CARGO_MANIFEST_DIR")).join("benches/peers/check_priors.py");
    let Ok(output) = Command::new(&python).arg(script).arg(folder.path()).output() else {
        testing::skip(&format!("{python} does not run"));
        return;
    };
    let told = String::from_utf8_lossy(&output.stdout);
    told.lines().filter_map(|line| line.strip_prefix("skip ")).for_each(|line| testing::skip(line.trim()));
    assert!(output.status.success(), "{told}{}", String::from_utf8_lossy(&output.stderr));
    if told.lines().any(|line| line.starts_with("ok   NumPy")) {
        assert_eq!(told.lines().filter(|line| line.starts_with("ok   NumPy")).count(), 4, "{told}");
    }
}
