//! `skysweep ortho` end to end on a simulated town: hidden cells against the exact scene, grey values against the simulator's own
//! picture from above, and what is refused.

use std::path::{Path, PathBuf};

use assert_cmd::Command;
use io::raster::ImageSource;
use predicates::prelude::*;
use raster::Grid;
use serde_json::Value;
use tempfile::TempDir;

fn skysweep() -> Command {
    Command::cargo_bin("skysweep").expect("the binary is built with the tests")
}

fn sample(name: &str) -> PathBuf {
    Path::new(env!("CARGO_MANIFEST_DIR")).join("data-samples/town").join(name)
}

/// A town seen from straight above (view 1) and from the north under 18° (view 2). RPCs point where they say; vehicles are in no
/// surface model, and parapets and chimneys are thinner than its cells: both are left out.
fn town(folder: &Path) -> PathBuf {
    let parameters = std::fs::read_to_string(sample("scene.toml")).unwrap();
    let looks = "looks = [{ incidence_deg = 0.5, azimuth_deg = 280.0 }, { incidence_deg = 18.0, azimuth_deg = 350.0 }]";
    let parameters = parameters
        .replace("size_m = 320.0", "size_m = 200.0")
        .replace("views = 3", "views = 2")
        .replace("looks = []", looks)
        .replace("details = true", "details = false")
        .replace("parked_share = 0.35", "parked_share = 0.0")
        .replace("pointing_error_px = [1.0, 3.0]", "pointing_error_px = [0.0, 0.0]");
    let (file, scene) = (folder.join("scene.toml"), folder.join("town"));
    std::fs::write(&file, parameters).unwrap();
    skysweep().arg("simulate").arg(&file).arg("-o").arg(&scene).args(["--progress", "none"]).assert().code(0);
    scene
}

fn band(path: &Path, number: usize) -> Grid<f32> {
    let source = ImageSource::open(path).unwrap();
    source.read_samples(number, source.window()).unwrap()
}

/// The ortho of one view of a town, and what its cells are.
fn ortho(folder: &TempDir, scene: &Path, view: &str) -> (Grid<f32>, Grid<f32>) {
    let out = folder.path().join(format!("{view}.tif"));
    let mut command = skysweep();
    command.arg("ortho").arg(scene.join(format!("view_{view}.tif"))).arg("--dsm").arg(scene.join("truth/dsm.tif"));
    command.arg("-o").arg(&out).args(["--progress", "none", "-q"]).assert().code(0);
    (band(&out, 1), band(&folder.path().join(format!("{view}_mask.tif")), 1))
}

#[test]
fn hidden_cells_are_the_hidden_ones_and_the_others_look_as_from_above() {
    let folder = tempfile::tempdir().unwrap();
    let scene = town(folder.path());
    let (above, seen_above) = ortho(&folder, &scene, "1");
    let (aside, state) = ortho(&folder, &scene, "2");
    let truth = band(&scene.join("truth/visibility.tif"), 2);
    let cells = || state.data().iter().zip(truth.data()).filter(|(state, _)| **state <= 1.0);
    let count =
        |hidden: bool, truly: bool| cells().filter(|(s, t)| (**s == 1.0, **t == 0.0) == (hidden, truly)).count();
    let (right, wrong, missed) = (count(true, true) as f64, count(true, false) as f64, count(false, true) as f64);
    let (precision, recall) = (right / (right + wrong), right / (right + missed));
    assert!(right > 5000.0, "{right} cells are hidden");
    assert!(precision >= 0.95 && recall >= 0.95, "precision {precision:.4}, recall {recall:.4}");

    // The sensor's own account of its noise: photons and read noise.
    let report: Value = serde_json::from_slice(&std::fs::read(scene.join("scene.json")).unwrap()).unwrap();
    let sensor = |key: &str| report["views"][0]["sensor"][key].as_f64().unwrap();
    assert_eq!(sensor("gamma"), 1.0);
    let sigma = |dn: f64| {
        let electrons = ((dn - sensor("offset")) / sensor("gain") * sensor("electrons_at_white")).max(0.0);
        (electrons + sensor("read_noise_electrons").powi(2)).sqrt() * sensor("gain") / sensor("electrons_at_white")
    };
    let both = (0..state.data().len()).filter(|&i| state.data()[i] == 0.0 && seen_above.data()[i] == 0.0);
    let mut differences: Vec<f64> = both
        .map(|i| {
            let (a, b) = (f64::from(above.data()[i]), f64::from(aside.data()[i]));
            (a - b).abs() / (std::f64::consts::SQRT_2 * sigma(b))
        })
        .collect();
    differences.sort_by(f64::total_cmp);
    assert!(differences.len() > 140_000);
    // Of two pictures that differ by noise alone, the median difference is 0.67 σ.
    let median = differences[differences.len() / 2];
    assert!(median < 0.75, "the median difference is {median:.3} of the noise of both");
    let within = differences.partition_point(|&d| d < 3.0) as f64 / differences.len() as f64;
    assert!(within > 0.95, "{within:.4} of the cells are within three times the noise");
}

#[test]
fn a_mosaic_fills_what_one_view_hides() {
    let folder = tempfile::tempdir().unwrap();
    let out = folder.path().join("ortho.tif");
    let mut command = skysweep();
    command.arg("ortho").args(["view_1.tif", "view_2.tif", "view_3.tif"].map(sample)).arg("--dsm");
    command.arg(sample("truth/dsm.tif")).arg("-o").arg(&out).args(["--gsd", "1", "--json", "--progress", "none"]);
    let output = command.assert().code(0).get_output().stdout.clone();
    let report: Value = serde_json::from_slice(&output).unwrap();
    assert_eq!(report["images"].as_array().map(Vec::len), Some(3));
    let (state, view) =
        (band(&folder.path().join("ortho_mask.tif"), 1), band(&folder.path().join("ortho_mask.tif"), 2));
    assert_eq!((state.width(), state.height()), (320, 320));
    let share = |wanted: f32| state.data().iter().filter(|s| **s == wanted).count() as f64 / 102_400.0;
    assert!(share(0.0) > 0.97 && share(1.0) < 0.03, "{} seen, {} hidden", share(0.0), share(1.0));
    // The steepest view gives most, and the others what it does not see.
    let used = |number: f32| view.data().iter().filter(|v| **v == number).count();
    assert!(used(2.0) > 50_000 && used(1.0) + used(3.0) > 300, "{} {} {}", used(1.0), used(2.0), used(3.0));
}

#[test]
fn what_makes_no_ortho_is_refused() {
    let folder = tempfile::tempdir().unwrap();
    let out = folder.path().join("ortho.tif");
    let (dsm, view) = (sample("truth/dsm.tif"), sample("view_1.tif"));
    let refused = |image: &Path, dsm: &Path, options: &[&str], words: &str| {
        let mut command = skysweep();
        command.arg("ortho").arg(image).arg("--dsm").arg(dsm).arg("-o").arg(&out).args(options);
        command.assert().code(2).stderr(predicate::str::contains(words.to_owned()));
        assert_eq!(std::fs::read_dir(folder.path()).unwrap().count(), 0, "nothing is written");
    };
    refused(&view, &dsm, &["--gsd", "0"], "--gsd");
    refused(&view, &dsm, &["--tolerance=-1"], "--tolerance");
    refused(&dsm, &dsm, &[], "RPC");
    refused(&view, &view, &[], "geotransform");
    refused(Path::new("none.tif"), &dsm, &[], "none.tif");
}
