//! `skysweep dtm` end to end on the sample town, whose ground is known under every building and
//! tree, and what is refused.

mod common;

use std::path::{Path, PathBuf};

use common::{band, skysweep};
use predicates::prelude::*;
use serde_json::Value;

/// Largest error of the ground under buildings and trees, root mean square, metres.
const RMSE_MAX_M: f64 = 0.3;

fn town() -> PathBuf {
    Path::new(env!("CARGO_MANIFEST_DIR")).join("data-samples/town/truth")
}

#[test]
fn the_ground_of_the_town_is_found_under_its_houses() {
    let folder = tempfile::tempdir().unwrap();
    let run = |out: &Path, threads: &str| {
        let mut command = skysweep();
        command.arg("dtm").arg(town().join("dsm.tif")).arg("-o").arg(out);
        command.args(["--threads", threads, "--progress", "none", "--json"]).assert()
    };
    let out = folder.path().join("a");
    let printed = run(&out, "1").code(0).get_output().stdout.clone();
    let report: Value = serde_json::from_slice(&printed).unwrap();
    let written: Value = serde_json::from_slice(&std::fs::read(out.join("dtm.json")).unwrap()).unwrap();
    assert_eq!(report, written);
    let (found, above) = (band(&out.join("dtm.tif"), 1), band(&out.join("height_above_ground.tif"), 1));
    let (states, surface) = (band(&out.join("ground.tif"), 1), band(&town().join("dsm.tif"), 1));
    let truth = band(&town().join("dtm.tif"), 1);
    let (mut squares, mut count) = (0.0, 0);
    for at in 0..truth.data().len() {
        let (found, top, truth) = (found.data()[at], surface.data()[at], truth.data()[at]);
        assert!((above.data()[at] - (top - found).max(0.0)).abs() < 1e-3);
        if top - truth > 0.5 {
            squares += f64::from(found - truth).powi(2);
            count += 1;
        }
    }
    let rmse = (squares / f64::from(count)).sqrt();
    assert!(rmse < RMSE_MAX_M, "{rmse:.3} m under {count} cells");
    let ground = states.data().iter().filter(|state| **state == 1.0).count();
    assert_eq!(report["cells_ground"], ground);

    // The number of threads changes nothing.
    let other = folder.path().join("b");
    run(&other, "2").code(0);
    for name in ["dtm.tif", "height_above_ground.tif", "ground.tif"] {
        assert!(std::fs::read(out.join(name)).unwrap() == std::fs::read(other.join(name)).unwrap(), "{name}");
    }
    run(&out, "1").code(2).stderr(predicate::str::contains("dtm.tif"));
}

#[test]
fn bad_surfaces_are_refused_with_a_reason() {
    let folder = tempfile::tempdir().unwrap();
    let refused = |surface: &Path, reason: &str| {
        let out = folder.path().join("out");
        let mut command = skysweep();
        command.arg("dtm").arg(surface).arg("-o").arg(&out).args(["--progress", "none"]);
        command.assert().code(2).stderr(predicate::str::contains(reason));
        assert!(!out.exists());
    };
    refused(&folder.path().join("none.tif"), "none.tif");
    refused(folder.path(), folder.path().to_str().unwrap());
    let text = folder.path().join("text.tif");
    std::fs::write(&text, "no raster").unwrap();
    refused(&text, "text.tif");
}
