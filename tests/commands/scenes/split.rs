//! `skysweep split` on real COLMAP models against a brute-force choice by Python sets, and what it
//! refuses.

use std::path::{Path, PathBuf};

use crate::common::skysweep;
use predicates::prelude::*;
use serde_json::Value;

fn root() -> &'static Path {
    Path::new(env!("CARGO_MANIFEST_DIR"))
}

fn model() -> PathBuf {
    root().join("tests/reference/align/model")
}

fn names(report: &Value, key: &str) -> String {
    let choices = report[key].as_array().unwrap();
    choices.iter().map(|choice| choice["image"].as_str().unwrap()).collect::<Vec<_>>().join(",")
}

#[test]
fn real_models_are_split_as_brute_force_does() {
    let Some(data) = testing::shared_data("city/colmap") else { return };
    let reference = std::fs::read_to_string(root().join("tests/reference/split/reference.txt")).unwrap();
    assert_eq!(reference.lines().count(), 12);
    for line in reference.lines() {
        let [model, preset, contexts, deviation, chosen, targets] = line.split(' ').collect::<Vec<_>>()[..] else {
            panic!("{line}");
        };
        let output = skysweep()
            .arg("split")
            .arg(data.join(model))
            .args(["--preset", preset, "--contexts", contexts, "--json"])
            .output()
            .unwrap();
        let report: Value = serde_json::from_slice(&output.stdout).unwrap();
        assert_eq!(
            (names(&report, "contexts"), names(&report, "targets")),
            (chosen.to_owned(), targets.to_owned()),
            "{line}"
        );
        assert!((report["deviation"].as_f64().unwrap() - deviation.parse::<f64>().unwrap()).abs() < 1e-8);
    }
}

#[test]
fn options_are_obeyed_and_nonsense_is_refused() {
    let folder = tempfile::tempdir().unwrap();
    let out = folder.path().join("split.json");
    let run = || {
        let mut command = skysweep();
        command.arg("split").arg(model()).arg("-o").arg(&out);
        command.args(["--first", "street/007.jpg", "--target-ious", "0.1,0.3", "--context-iou", "0.2"]);
        command
    };
    run().assert().code(0).stdout(predicate::str::contains("street/007.jpg"));
    assert!(std::fs::read_to_string(out.with_extension("html")).unwrap().contains("street/007.jpg"));
    let report: Value = serde_json::from_slice(&std::fs::read(&out).unwrap()).unwrap();
    assert_eq!(report["contexts"][0]["image"], "street/007.jpg");
    assert_eq!(
        (report["contexts"][1]["wanted_iou"].as_f64(), report["targets"][1]["wanted_iou"].as_f64()),
        (Some(0.2), Some(0.3))
    );
    run().assert().code(2).stderr(predicate::str::contains("--overwrite"));
    let refused = |options: &[&str], words: &str| {
        skysweep()
            .arg("split")
            .arg(model())
            .args(options)
            .assert()
            .code(2)
            .stderr(predicate::str::contains(words.to_owned()));
    };
    refused(&["--first", "none.jpg"], "none.jpg");
    refused(&["--target-ious", "1.5"], "overlap of 1.5");
    refused(&["--contexts", "0"], "no contexts");
    refused(&["--contexts", "38"], "42 are to be chosen");
    let empty = folder.path().join("empty");
    std::fs::create_dir(&empty).unwrap();
    skysweep().arg("split").arg(&empty).assert().code(2).stderr(predicate::str::contains("cameras.txt"));
}
