//! `skysweep align` end to end: a planted similarity among right and wrong positions (made by NumPy
//! and PROJ), the files it writes, the noise harness, a real model, and what is refused.

use std::path::{Path, PathBuf};

use crate::common::skysweep;
use formats::colmap::{ColmapPoint, read_with_points};
use formats::splat_ply::LocalOrigin;
use predicates::prelude::*;
use serde_json::Value;

fn reference(name: &str) -> PathBuf {
    Path::new(env!("CARGO_MANIFEST_DIR")).join("tests/reference/align").join(name)
}

fn json(path: PathBuf) -> Value {
    serde_json::from_slice(&std::fs::read(path).unwrap()).unwrap()
}

/// The planted similarity: a place of the model in UTM.
fn planted(p: [f64; 3]) -> [f64; 3] {
    let numbers: Vec<f64> =
        std::fs::read_to_string(reference("planted.txt")).unwrap().lines().map(|l| l.parse().unwrap()).collect();
    [0, 1, 2].map(|i| numbers[0] * (0..3).map(|j| numbers[1 + 3 * i + j] * p[j]).sum::<f64>() + numbers[10 + i])
}

#[test]
fn the_planted_similarity_comes_back_among_wrong_positions() {
    let folder = tempfile::tempdir().unwrap();
    let (before, points) = read_with_points(&reference("model")).unwrap();
    for (positions, right) in [("gps.csv", 40), ("gps_wrong.csv", 28)] {
        let out = folder.path().join(positions);
        skysweep()
            .arg("align")
            .arg(reference("model"))
            .arg("--gps")
            .arg(reference(positions))
            .arg("-o")
            .arg(&out)
            .assert()
            .code(0);
        let report = json(out.join("align.json"));
        assert_eq!(report["inliers"].as_u64(), Some(right), "{positions}");
        assert!(report["rmse_m"].as_f64().unwrap() < 1e-6);
        let origin: LocalOrigin = serde_json::from_value(json(out.join("origin.json"))).unwrap();
        assert_eq!((origin.crs.as_str(), origin.vertical.as_str()), ("EPSG:32631", "ellipsoid"));
        let (after, moved) = read_with_points(&out).unwrap();
        let similarity = formats::similarity::read(out.join("similarity.json")).unwrap();
        assert!((similarity.scale() / 13.75 - 1.0).abs() < 1e-9);
        let close = |model: [f64; 3], local: [f64; 3]| {
            let expected = planted(model);
            let by_file = similarity.apply(model);
            (0..3).all(|i| {
                (local[i] + origin.origin[i] - expected[i]).abs() < 1e-6 && (by_file[i] - local[i]).abs() < 1e-7
            })
        };
        assert_eq!((after.views.len(), moved.len()), (40, 25));
        assert!(
            before.views.iter().zip(&after.views).all(|(b, a)| b.name == a.name && close(b.pose.centre, a.pose.centre))
        );
        assert!(points.iter().zip(&moved).all(|(b, a)| close(b.position, a.position) && b.track == a.track));
        // Every point stays where its image sees it.
        let seen = |points: &[ColmapPoint], views: &[formats::colmap::ColmapView]| -> Vec<[f64; 2]> {
            let of = |point: &ColmapPoint| {
                let [x, y, z] = views[point.track[0].view as usize].pose.camera_from_world(point.position);
                [x / z, y / z]
            };
            points.iter().map(of).collect()
        };
        let (was, is) = (seen(&points, &before.views), seen(&moved, &after.views));
        assert!(was.iter().zip(&is).all(|(a, b)| (0..2).all(|i| (a[i] - b[i]).abs() < 1e-6 * (1.0 + a[i].abs()))));
    }
}

#[test]
fn noise_is_measured_and_its_models_are_written() {
    let folder = tempfile::tempdir().unwrap();
    let (out, noisy) = (folder.path().join("out"), folder.path().join("noisy"));
    let mut command = skysweep();
    command.arg("align").arg(reference("model")).arg("--positions").arg(reference("gps.csv")).arg("-o").arg(&out);
    command.args([
        "--noise",
        "--noise-translation",
        "1,5",
        "--noise-rotation",
        "10",
        "--noise-seeds",
        "4",
        "--encoding",
        "txt",
    ]);
    command.arg("--noise-output").arg(&noisy).assert().code(0).stdout(predicate::str::contains("5 m: cameras off by"));
    let report = json(out.join("align.json"));
    let levels = report["noise"].as_array().unwrap();
    let mean = |level: usize, key: &str| levels[level][key]["mean"].as_f64().unwrap();
    assert_eq!(levels.len(), 3);
    assert!(mean(0, "position_m") < mean(1, "position_m") && mean(1, "position_m") < 5.0);
    // A wrong heading turns by its own size and changes no scale.
    assert!(mean(2, "rotation_deg") > 1.0 && mean(2, "rotation_deg") < 30.0 && mean(2, "scale_percent") < 1e-9);
    assert_eq!(std::fs::read_dir(&noisy).unwrap().count(), 12);
    let (clean, _) = read_with_points(&out).unwrap();
    let distance = |name: &str| {
        let (model, _) = read_with_points(&noisy.join(name)).unwrap();
        let square = |(a, b): (&formats::colmap::ColmapView, &formats::colmap::ColmapView)| {
            (0..3).map(|i| (a.pose.centre[i] - b.pose.centre[i]).powi(2)).sum::<f64>()
        };
        (model.views.iter().zip(&clean.views).map(square).sum::<f64>() / 40.0).sqrt()
    };
    let written: f64 = (1..=4).map(|seed| distance(&format!("translation_5m_seed_{seed}"))).sum::<f64>() / 4.0;
    assert!((written - mean(1, "position_m")).abs() < 1e-6, "the models are those that were measured");
}

#[test]
fn a_real_model_is_brought_to_a_map() {
    let Some(model) = testing::shared_data("city/colmap/bartoszek+test_colmap/sparse/0") else { return };
    let folder = tempfile::tempdir().unwrap();
    let (before, points) = read_with_points(&model).unwrap();
    // Easting, northing, height of the cameras under a similarity of this test's own, one of them
    // far off.
    let place = |p: [f64; 3]| [500_000.0 - 4.0 * p[2], 5_000_000.0 - 4.0 * p[0], 80.0 + 4.0 * p[1]];
    let mut table = "name,easting,northing,height\n".to_owned();
    for (index, view) in before.views.iter().enumerate() {
        let [x, y, z] = place(view.pose.centre);
        table += &format!("some/folder/{},{x},{y},{}\n", view.name, if index == 3 { z + 60.0 } else { z });
    }
    let (csv, out) = (folder.path().join("gps.csv"), folder.path().join("out"));
    std::fs::write(&csv, table).unwrap();
    let mut command = skysweep();
    command.arg("align").arg(&model).arg("--gps").arg(&csv).args(["--crs", "32633"]).arg("-o").arg(&out);
    command.assert().code(0).stdout(predicate::str::contains("22 of 23 agree"));
    let (after, moved) = read_with_points(&out).unwrap();
    let origin = json(out.join("origin.json"));
    let origin = [0, 1, 2].map(|i| origin["origin"][i].as_f64().unwrap());
    assert_eq!((after.lenses.len(), moved.len()), (before.lenses.len(), points.len()));
    for (b, a) in points.iter().zip(&moved) {
        let expected = place(b.position);
        assert!(
            (0..3).all(|i| (a.position[i] + origin[i] - expected[i]).abs() < 1e-5 * (1.0 + expected[i].abs() * 1e-6))
        );
    }
}

#[test]
fn what_cannot_be_aligned_is_said() {
    let folder = tempfile::tempdir().unwrap();
    let (csv, out) = (folder.path().join("gps.csv"), folder.path().join("out"));
    let refused = |table: &str, options: &[&str], words: &str| {
        std::fs::write(&csv, table).unwrap();
        let mut command = skysweep();
        command.arg("align").arg(reference("model")).arg("--gps").arg(&csv).arg("-o").arg(&out).args(options);
        command.assert().code(2).stderr(predicate::str::contains(words.to_owned()));
        assert!(!out.exists(), "nothing is written");
    };
    refused("name,lon,lat\n", &[], "expected lon, lat and height");
    refused("name,lon,lat,height\nother.jpg,5,43,1\n", &[], "none of the positions");
    refused("name,lon,lat,height\nstreet/001.jpg,5,43,1\n", &[], "at least 3");
    refused("name,lon,lat,height\n001.jpg,5,43,1\n001.jpg,5,43,2\n", &[], "two positions");
    refused("name,easting,northing,height\n001.jpg,5,43,1\n", &[], "--crs");
    refused("name,lon,lat,height\n001.jpg,5,43,1\n", &["--crs", "4326"], "metres");
    refused("name,lon,lat,height\n", &["--threshold", "0"], "--threshold");
    let gps = reference("gps_wrong.csv");
    let mut command = skysweep();
    command
        .arg("align")
        .arg(reference("model"))
        .arg("--gps")
        .arg(&gps)
        .arg("-o")
        .arg(&out)
        .args(["--max-rmse", "1e-12"]);
    command.assert().code(1);
    let again = skysweep().arg("align").arg(reference("model")).arg("--gps").arg(&gps).arg("-o").arg(&out).assert();
    again.code(2).stderr(predicate::str::contains("--overwrite"));
}

/// The page ends after its time. Without a save it has not done what it was started for.
#[test]
fn a_page_over_a_map_takes_the_place_of_positions() {
    let folder = tempfile::tempdir().unwrap();
    let out = folder.path().join("out");
    let town = Path::new(env!("CARGO_MANIFEST_DIR")).join("data-samples/town");
    let by_hand = |more: &[&str]| {
        let mut command = skysweep();
        command.arg("align").arg(reference("model")).arg("-o").arg(&out).args(more);
        command.assert()
    };
    let map = town.join("truth/dsm.tif").display().to_string();
    let ended = by_hand(&["--page", &map, "--for", "0.2"]).code(1);
    let printed = String::from_utf8_lossy(&ended.get_output().stdout).into_owned();
    assert!(printed.starts_with("http://127.0.0.1:") && printed.contains("saved      nothing"), "{printed}");
    assert!(!out.exists(), "nothing was written");
    by_hand(&[]).code(2).stderr(predicate::str::contains("--positions"));
    by_hand(&["--open"]).code(2).stderr(predicate::str::contains("--page"));
    by_hand(&["--page", &map, "--positions", "gps.csv"])
        .code(2)
        .stderr(predicate::str::contains("cannot be used with"));
    let image = town.join("view_1.tif").display().to_string();
    by_hand(&["--page", &image]).code(2).stderr(predicate::str::contains("no coordinate system"));
}
