//! `skysweep priors` for satellite images, against the simulator's height of every pixel.

use std::path::{Path, PathBuf};

use assert_cmd::Command;
use formats::raster::ImageSource;
use raster::Grid;
use serde_json::Value;

/// Terrain and buildings without what LoD2 leaves out.
fn scene(folder: &Path) {
    let run = |arguments: &[&str]| {
        let assert = Command::cargo_bin("skysweep")
            .unwrap()
            .current_dir(folder)
            .arg("simulate")
            .args(arguments)
            .assert()
            .code(0);
        String::from_utf8(assert.get_output().stdout.clone()).unwrap()
    };
    let mut text = run(&["town", "--size", "140", "--views", "2", "--template"]);
    for (from, to) in [
        ("details = true", "details = false"),
        ("trees_per_ha = 25.0", "trees_per_ha = 0.0"),
        ("parked_share = 0.35", "parked_share = 0.0"),
    ] {
        assert!(text.contains(from), "{from:?} is not in\n{text}");
        text = text.replace(from, to);
    }
    std::fs::write(folder.join("bare.toml"), text).unwrap();
    run(&["bare.toml", "-o", "scene", "--progress", "none"]);
}

fn priors(folder: &Path, arguments: &[&str]) -> assert_cmd::assert::Assert {
    let mut command = Command::cargo_bin("skysweep").unwrap();
    command.current_dir(folder).args(["priors", "scene/truth/buildings.city.json", "--progress", "none"]);
    command.args(arguments).assert()
}

fn band(path: PathBuf, number: usize) -> Grid<f32> {
    let source = ImageSource::open(path).unwrap();
    source.read_samples(number, source.window()).unwrap()
}

#[test]
fn heights_are_those_that_the_simulator_saw() {
    let folder = tempfile::tempdir().unwrap();
    scene(folder.path());
    let images = ["scene/truth/heights_1.tif", "scene/truth/heights_2.tif"];
    let told = priors(folder.path(), &["--cameras", images[0], images[1], "-o", "out", "--json"]).code(0);
    let report: Value = serde_json::from_slice(&told.get_output().stdout).unwrap();
    assert!(report["notes"].to_string().contains("taken as the ellipsoid"), "{report}");
    for number in 0..2 {
        let row = &report["images"][number];
        assert!(row["line_of_sight_error_m"].as_f64().unwrap() < 2e-3, "{row}");
        let out = |kind: &str| folder.path().join(format!("out/{kind}/heights_{}.tif", number + 1));
        // The maps say where they are as the image does.
        let rpc = |path: &Path| formats::rpc::read_for_image(path).unwrap().rpc;
        assert_eq!(rpc(&out("height")), rpc(&folder.path().join(images[number])));
        let (found, truth) = (band(out("height"), 1), band(folder.path().join(images[number]), 1));
        let (up, mask) = (band(out("normal"), 3), band(out("mask"), 1));
        let (mut errors, mut covered) = (Vec::new(), 0);
        for (at, (&height, &seen)) in found.data().iter().zip(truth.data()).enumerate() {
            assert_eq!(height > -1000.0, mask.data()[at] == 1.0);
            let is_seen = mask.data()[at] == 1.0 && seen.is_finite();
            // Terrain hides the feet of walls, which stand in it.
            if is_seen && up.data()[at] > 0.1 {
                errors.push((height - seen).abs());
            }
            covered += usize::from(is_seen);
        }
        assert_eq!(row["hit_pixels"].as_u64().unwrap(), mask.data().iter().filter(|m| **m == 1.0).count() as u64);
        errors.sort_unstable_by(f32::total_cmp);
        let at = |share: f64| errors[(share * (errors.len() - 1) as f64) as usize];
        assert!(covered > 10_000 && errors.len() > covered / 2, "{covered} {}", errors.len());
        // Corners of the model are rounded to a millimetre; at edges the one may see a roof and the
        // other what is below.
        assert!(at(0.5) < 0.002 && at(0.99) < 0.01, "{} {} {}", at(0.5), at(0.99), at(1.0));
    }
    let files = ["height", "distance", "normal", "mask", "class", "object"];
    let bytes =
        |out: &str| files.map(|kind| std::fs::read(folder.path().join(out).join(kind).join("heights_2.tif")).unwrap());
    let labels: Value = serde_json::from_slice(&std::fs::read(folder.path().join("out/labels.json")).unwrap()).unwrap();
    assert!(labels["objects"][0]["id"].as_str().unwrap().starts_with("building-"));
    priors(folder.path(), &["--cameras", images[1], "-o", "one", "--threads", "1", "-q"]).code(0);
    assert!(bytes("out") == bytes("one"), "the number of threads, or of images, changes the maps");
    check_options(folder.path());
}

/// Pointing, datum and what is refused, on the same scene.
fn check_options(folder: &Path) {
    let image = ["--cameras", "scene/truth/heights_1.tif"];
    let run = |out: &str, more: &[&str]| priors(folder, &[&image[..], &["-o", out, "-q"], more].concat());
    let refused = |more: &[&str], words: &str| {
        let assert = run("refused", more).code(2);
        let told = String::from_utf8_lossy(&assert.get_output().stderr).into_owned();
        assert!(told.contains(words) && !folder.join("refused").exists(), "{words:?} is not in\n{told}");
    };
    let correction = r#"{"images": [{"path": "scene/truth/heights_1.tif", "applied_correction":
        {"translation_px": [7.0, -4.0], "linear": [[0.0, 0.0], [0.0, 0.0]],
        "centre": {"sample": 0.0, "line": 0.0}}}]}"#;
    std::fs::write(folder.join("report.json"), correction).unwrap();
    run("moved", &["--corrections", "report.json"]).code(0);
    let mask = |out: &str| band(folder.join(out).join("mask/heights_1.tif"), 1);
    let (still, moved) = (mask("out"), mask("moved"));
    let same = |row: usize, column: usize| still[(column, row)] == moved[(column + 7, row - 4)];
    let (rows, columns) = (4..still.height(), still.width() - 7);
    let count =
        rows.flat_map(|row| (0..columns).map(move |column| (row, column))).filter(|&(r, c)| !same(r, c)).count();
    assert!(count * 100 < still.data().len(), "{count} pixels of the corrected mask are elsewhere");
    // The undulation of EGM96 is about 50 m in the south of France.
    run("geoid", &["--vertical", "egm96"]).code(0);
    let top =
        |out: &str| band(folder.join(out).join("height/heights_1.tif"), 1).data().iter().copied().fold(0.0, f32::max);
    assert!((45.0..55.0).contains(&(top("geoid") - top("out"))), "{}", top("geoid") - top("out"));
    refused(&["--offset", "1", "2", "3"], "satellite images find the model");
    refused(&["--crs", "EPSG:4326"], "expected a projected one in metres");
    refused(&["--crs", "EPSG:32633"], "no image has a building in it");
    refused(&["--cameras", "scene/truth/heights_1.tif", "scene/scene.json"], "something else");
    refused(&["--cameras", "scene/truth/dsm.tif"], "RPC");
    // A folder of images serves as well.
    priors(folder, &["--cameras", "scene", "-o", "views", "-q"]).code(0);
    assert!(folder.join("views/height/view_2.tif").is_file());
}
