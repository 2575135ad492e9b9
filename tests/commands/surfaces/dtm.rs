//! `skysweep dtm` end to end on the sample town, whose ground is known under every building and
//! tree, and what is refused.

use std::path::{Path, PathBuf};

use crate::common::{band, skysweep, write_like};
use crs::VerticalDatum;
use formats::raster::{BandData, read_dem};
use numeric::random::{hash64, unit_interval};
use predicates::prelude::*;
use raster::Grid;
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

/// Filled cells beside a surface are no evidence of the ground, and the command says what it read.
#[test]
fn layers_beside_a_surface_say_what_was_not_measured() {
    let folder = tempfile::tempdir().unwrap();
    let surface = folder.path().join("dsm.tif");
    std::fs::copy(town().join("dsm.tif"), &surface).unwrap();
    let job = |job: &str, name: &str, options: &[&str]| {
        let mut command = skysweep();
        command.arg(job).arg(&surface).arg("-o").arg(folder.path().join(name));
        command.args(options).args(["--progress", "none"]).assert()
    };
    let run = |name: &str, options: &[&str]| job("dtm", name, options);
    let classes = |name: &str| job("classes", name, &[]);
    let bare = run("bare", &["--dsm-vertical", "egm96"]);
    bare.code(0).stdout(predicate::str::contains("none beside the surface"));
    assert_eq!(read_dem(folder.path().join("bare/dtm.tif")).unwrap().vertical, Some(VerticalDatum::Egm96));
    classes("bare_classes").code(0).stdout(predicate::str::contains("none beside the surface"));

    let dem = read_dem(&surface).unwrap();
    let (width, height) = (dem.heights.width(), dem.heights.height());
    let layer = |is_weak: &dyn Fn(usize) -> bool, values: [u8; 2]| {
        let cells = (0..width * height).map(|i| values[usize::from(is_weak(i % width))]).collect();
        Grid::from_vec(width, height, cells).unwrap()
    };
    let write = |name: &str, grid: &Grid<u8>| write_like(&folder.path().join(name), &dem, BandData::U8(grid), false);
    // The western quarter was filled.
    write("source.tif", &layer(&|column| column < width / 4, [1, 4]));
    let filled = width / 4 * height;
    let told = format!("{filled} filled cells are no evidence of the ground, and 0 weak ones");
    run("layers", &[]).code(0).stdout(predicate::str::contains(told));
    classes("classes").code(0).stdout(predicate::str::contains(format!("{filled} filled and 0 doubtful cells")));
    let report: Value =
        serde_json::from_slice(&std::fs::read(folder.path().join("classes/classes.json")).unwrap()).unwrap();
    assert_eq!(report["layers"]["cells_filled"], filled);
    let states = band(&folder.path().join("layers/ground.tif"), 1);
    let ground = |from: usize, to: usize| {
        let rows = states.data().chunks(width);
        rows.flat_map(|row| &row[from..to]).filter(|state| **state == 1.0).count()
    };
    assert_eq!(ground(0, width / 4), 0);
    assert!(ground(width / 4, width) > states.data().len() / 4);

    // Nothing was measured.
    std::fs::remove_file(folder.path().join("source.tif")).unwrap();
    write("source.tif", &layer(&|_| true, [1, 4]));
    let told = run("none", &[]).code(1);
    told.stderr(predicate::str::contains("only 0.00 % of the cells with heights show the ground"));
    let cells = width * height;
    classes("no_classes").code(2).stderr(predicate::str::contains(format!("0 of {cells} cells with heights show")));
    for (option, name) in [("--slope=-1", "slope"), ("--widest-object=0", "widest")] {
        for command in ["dtm", "classes"] {
            job(command, "refused", &[option]).code(2).stderr(predicate::str::contains(name));
        }
    }
}

/// Standard errors beside a noisy surface take most of its noise out of the ground.
#[test]
fn standard_errors_beside_a_surface_smooth_its_ground() {
    let folder = tempfile::tempdir().unwrap();
    let surface = folder.path().join("dsm.tif");
    let dem = read_dem(town().join("dsm.tif")).unwrap();
    let (width, height) = (dem.heights.width(), dem.heights.height());
    // Noise of up to 0.4 m that is alike in 3 × 3 cells.
    let noise = |at: usize| {
        let patch = at % width / 3 + 1000 * (at / width / 3);
        0.8 * unit_interval(hash64(patch as u64)) as f32 - 0.4
    };
    let noisy = (0..width * height).map(|at| dem.heights.data()[at] + noise(at)).collect();
    write_like(&surface, &dem, BandData::F32(&Grid::from_vec(width, height, noisy).unwrap()), true);
    let truth = band(&town().join("dtm.tif"), 1);
    let rmse = |name: &str, words: &str| {
        let out = folder.path().join(name);
        let mut command = skysweep();
        command.arg("dtm").arg(&surface).arg("-o").arg(&out).args(["--progress", "none"]);
        command.assert().code(0).stdout(predicate::str::contains(words));
        let (found, states) = (band(&out.join("dtm.tif"), 1), band(&out.join("ground.tif"), 1));
        let above = band(&out.join("height_above_ground.tif"), 1);
        let ground: Vec<usize> = (0..width * height).filter(|&at| states.data()[at] == 1.0).collect();
        assert!(ground.iter().all(|&at| above.data()[at] == 0.0));
        let squares = ground.iter().map(|&at| f64::from(found.data()[at] - truth.data()[at]).powi(2));
        (squares.sum::<f64>() / ground.len() as f64).sqrt()
    };
    let plain = rmse("plain", "none beside the surface");
    write_like(&folder.path().join("sigma.tif"), &dem, BandData::F32(&dem.heights.map(|_| 0.23)), false);
    let smooth = rmse("smooth", "sigma.tif");
    assert!(smooth < 0.5 * plain, "{plain:.3} m, smoothed {smooth:.3} m");
}
