//! `skysweep buildings` end to end on the sample town: in the pixels of the image, on the surface
//! model, as a cue of the classes, and what is refused.

use std::path::{Path, PathBuf};

use crate::common::{band, skysweep};
use formats::raster::{ImageSource, read_dem};
use predicates::prelude::*;
use serde_json::Value;

fn town() -> PathBuf {
    Path::new(env!("CARGO_MANIFEST_DIR")).join("data-samples/town")
}

fn json(path: &Path) -> Value {
    serde_json::from_slice(&std::fs::read(path).unwrap()).unwrap()
}

fn buildings(image: &Path, out: &Path, more: &[&str]) -> assert_cmd::assert::Assert {
    let mut command = skysweep();
    command.arg("buildings").arg(image).arg("-o").arg(out).args(["--progress", "none"]).args(more).assert()
}

#[test]
fn the_index_lies_in_the_pixels_of_the_image_with_its_rpc() {
    let folder = tempfile::tempdir().unwrap();
    let (image, out, again) = (town().join("view_1.tif"), folder.path().join("a.tif"), folder.path().join("b.tif"));
    let printed = buildings(&image, &out, &["--threads", "1", "--json"]).code(0).get_output().stdout.clone();
    let report: Value = serde_json::from_slice(&printed).unwrap();
    assert_eq!(report, json(&folder.path().join("a_report.json")));
    assert!(folder.path().join("a_report.html").is_file() && folder.path().join("a.qml").is_file());
    assert!((report["gsd_m"].as_f64().unwrap() - 0.5).abs() < 0.1);
    let (own, made) = (ImageSource::open(&image).unwrap(), ImageSource::open(&out).unwrap());
    assert_eq!((made.info().width, made.info().height), (own.info().width, own.info().height));
    assert_eq!(made.metadata("RPC"), own.metadata("RPC"));
    assert!(made.metadata("").iter().any(|(key, value)| key == "SOURCES" && value == "view_1.tif"));
    let values = band(&out, 1);
    assert!(values.data().iter().all(|v| v.is_nan() || (0.0..=1.0).contains(v)));
    assert!(report["pairs"].as_u64().unwrap() > 0 && report["cells_high"].as_u64().unwrap() > 0);

    // The number of threads changes nothing, and nothing is replaced unasked.
    buildings(&image, &again, &["--threads", "2"]).code(0);
    assert!(std::fs::read(&out).unwrap() == std::fs::read(&again).unwrap());
    buildings(&image, &out, &[]).code(2).stderr(predicate::str::contains("--overwrite"));
    buildings(&image, &out, &["--overwrite"]).code(0);
}

#[test]
fn on_the_ground_the_index_tells_buildings_and_helps_the_classes() {
    let folder = tempfile::tempdir().unwrap();
    let (surface, out) = (town().join("truth/dsm.tif"), folder.path().join("index.tif"));
    buildings(&town().join("view_2.tif"), &out, &["--dsm", surface.to_str().unwrap()]).code(0);
    let (own, made) = (read_dem(&surface).unwrap(), read_dem(&out).unwrap());
    assert_eq!((made.geotransform, made.horizontal_epsg), (own.geotransform, own.horizontal_epsg));
    assert_eq!(made.provenance.sources, ["view_2.tif"]);
    let truth = band(&town().join("truth/classes.tif"), 1);
    let mean = |class: f32| {
        let cells = made.heights.data().iter().zip(truth.data());
        let of: Vec<f32> = cells.filter(|(v, c)| **c == class && v.is_finite()).map(|(v, _)| *v).collect();
        of.iter().sum::<f32>() / of.len() as f32
    };
    assert!(mean(6.0) > 2.0 * mean(2.0), "{} on buildings, {} on the ground", mean(6.0), mean(2.0));

    let classes = folder.path().join("classes");
    let mut command = skysweep();
    command.arg("classes").arg(&surface).arg("-o").arg(&classes).arg("--index").arg(&out);
    command.args(["--progress", "none", "-q"]).assert().code(0);
    let report = json(&classes.join("classes.json"));
    assert_eq!((&report["has_building_index"], &report["cells_weak"]), (&Value::Bool(true), &Value::from(0)));
    // A surface is no index.
    let mut command = skysweep();
    command.arg("classes").arg(&surface).arg("-o").arg(folder.path().join("never")).arg("--index").arg(&surface);
    command.args(["--progress", "none"]).assert().code(2).stderr(predicate::str::contains("expected 0 to 1"));
    assert!(!folder.path().join("never").exists());
}

#[test]
fn what_cannot_be_looked_at_is_refused_with_a_reason() {
    let folder = tempfile::tempdir().unwrap();
    let out = folder.path().join("never.tif");
    let refused = |image: &Path, more: &[&str], reason: &str| {
        buildings(image, &out, more).code(2).stderr(predicate::str::contains(reason));
        assert_eq!(std::fs::read_dir(folder.path()).unwrap().count(), 0);
    };
    let image = town().join("view_1.tif");
    refused(&folder.path().join("none.tif"), &[], "none.tif");
    refused(&image, &["--gsd=-1"], "see --gsd");
    refused(&image, &["--gsd", "30"], "a pixel measures 30 m");
    refused(&image, &["--dsm", "none.tif"], "none.tif");
    refused(&image, &["--corrections", "none"], "--dsm");
    refused(&town().join("relief.png"), &[], "give --gsd");
}
