//! `skysweep diff` end to end on the sample town: a house that is gone, its volume in a polygon,
//! and what is refused.

use std::path::{Path, PathBuf};

use crate::common::{band, skysweep, write_like};
use formats::raster::{BandData, read_dem};
use predicates::prelude::*;
use raster::Grid;
use serde_json::Value;

fn town() -> PathBuf {
    Path::new(env!("CARGO_MANIFEST_DIR")).join("data-samples/town/truth")
}

fn json(path: &Path) -> Value {
    serde_json::from_slice(&std::fs::read(path).unwrap()).unwrap()
}

/// Writes the town with a little noise and without the building of the largest area; returns its
/// volume and the rectangle around it in longitude and latitude.
fn without_a_house(path: &Path) -> (f64, [f64; 4]) {
    let surface = read_dem(town().join("dsm.tif")).unwrap();
    let (numbers, ground) = (band(&town().join("buildings.tif"), 1), band(&town().join("dtm.tif"), 1));
    let inner = |at: usize| {
        let (x, y) = (at % surface.heights.width(), at / surface.heights.width());
        x > 20 && y > 20 && x + 20 < surface.heights.width() && y + 20 < surface.heights.height()
    };
    let most = numbers.data().iter().copied().fold(0.0, f32::max) as usize;
    let mut areas = vec![0usize; most + 1];
    (0..numbers.data().len()).filter(|at| inner(*at) && numbers.data()[*at] > 0.0).for_each(|at| {
        areas[numbers.data()[at] as usize] += 1;
    });
    let house = (1..=most).max_by_key(|n| areas[*n]).unwrap() as f32;
    let mut later = surface.heights.clone();
    let (mut volume, mut bounds) = (0.0, [usize::MAX, usize::MAX, 0, 0]);
    let cell = surface.geotransform.cell_size();
    for at in 0..later.data().len() {
        let noise = 0.1 * ((at * 7919 % 1013) as f32 / 1013.0 - 0.5);
        let (x, y) = (at % later.width(), at / later.width());
        if numbers.data()[at] == house {
            volume += f64::from(ground.data()[at] - later.data()[at]) * cell.0 * cell.1;
            bounds = [bounds[0].min(x), bounds[1].min(y), bounds[2].max(x), bounds[3].max(y)];
            later.data_mut()[at] = ground.data()[at];
        }
        later.data_mut()[at] += noise;
    }
    write_like(path, &surface, BandData::F32(&later), true);
    let map = crs::MapProjection::from_epsg(surface.horizontal_epsg.unwrap()).unwrap();
    let corner = |x: f64, y: f64| {
        let (x, y) = surface.geotransform.map_from_cell(x, y);
        map.lonlat_from_map(x, y).unwrap()
    };
    let (west, north) = corner(bounds[0] as f64 - 6.0, bounds[1] as f64 - 6.0);
    let (east, south) = corner(bounds[2] as f64 + 6.0, bounds[3] as f64 + 6.0);
    (volume, [west, south, east, north])
}

#[test]
fn a_house_that_is_gone_is_found_with_its_volume() {
    let folder = tempfile::tempdir().unwrap();
    let (later, layer) = (folder.path().join("later.tif"), folder.path().join("plots.geojson"));
    let (volume, [west, south, east, north]) = without_a_house(&later);
    let ring = format!("[[{west},{south}],[{east},{south}],[{east},{north}],[{west},{north}],[{west},{south}]]");
    let feature = format!(
        r#"{{"type":"Feature","properties":{{"plot":"a 1"}},"geometry":{{"type":"Polygon","coordinates":[{ring}]}}}}"#
    );
    std::fs::write(&layer, format!(r#"{{"type":"FeatureCollection","features":[{feature}]}}"#)).unwrap();
    let run = |out: &Path, threads: &str| {
        let mut command = skysweep();
        command.arg("diff").arg(town().join("dsm.tif")).arg(&later).arg("-o").arg(out);
        command.arg("--areas").arg(&layer).args(["--areas-field", "plot", "--sigma-m", "0.1"]);
        command.args(["--threads", threads, "--progress", "none", "--json"]).assert()
    };
    let out = folder.path().join("a");
    let printed = run(&out, "1").code(0).get_output().stdout.clone();
    let report: Value = serde_json::from_slice(&printed).unwrap();
    assert_eq!(report, json(&out.join("diff.json")));
    let regions = report["regions"].as_array().unwrap();
    assert_eq!(regions.len(), 1, "{regions:?}");
    for found in [
        &regions[0]["volume_m3"],
        &report["areas"][0]["net_m3"],
        &json(&out.join("changes.geojson"))["features"][0]["properties"]["volume_m3"],
    ] {
        assert!((found.as_f64().unwrap() / volume - 1.0).abs() < 0.05, "{found} for {volume}");
    }
    assert_eq!(report["areas"][0]["name"], "a 1");
    assert_eq!(json(&out.join("areas.geojson"))["features"][0]["properties"]["name"], "a 1");
    let page = std::fs::read_to_string(out.join("diff.html")).unwrap();
    // Without dates in the files the page says so; every number has its unit and its deviation.
    for words in [
        "One region changed significantly from unknown to unknown",
        "Significance",
        "of it decided",
        "independent cells",
        "±\u{a0}",
        "\u{a0}m³",
        "href=\"./areas.geojson\"",
        "@media print",
    ] {
        assert!(page.contains(words), "{words}");
    }
    let regions: Grid<f32> = band(&out.join("regions.tif"), 1);
    let area = regions.data().iter().filter(|n| **n == 1.0).count();
    let significance = band(&out.join("significance.tif"), 1);
    assert!(significance.data().iter().filter(|z| **z < -8.0).count() as f64 > 0.5 * area as f64);

    // The number of threads changes nothing, and nothing is replaced unasked.
    let other = folder.path().join("b");
    run(&other, "2").code(0);
    for name in ["change.tif", "significance.tif", "regions.tif", "changes.geojson"] {
        assert!(std::fs::read(out.join(name)).unwrap() == std::fs::read(other.join(name)).unwrap(), "{name}");
    }
    run(&out, "1").code(2).stderr(predicate::str::contains("change.tif"));
}

#[test]
fn a_house_whose_heights_are_rather_wrong_is_no_change() {
    let folder = tempfile::tempdir().unwrap();
    let later = folder.path().join("later.tif");
    without_a_house(&later);
    let surface = read_dem(&later).unwrap();
    let change = |probability: &dyn Fn(f32) -> f32| {
        let before = band(&town().join("dsm.tif"), 1);
        let heights = before.data().iter().zip(surface.heights.data());
        let stated = heights.map(|(before, after)| probability((before - after).abs())).collect();
        let grid = Grid::from_vec(before.width(), before.height(), stated).unwrap();
        write_like(&folder.path().join("confidence.tif"), &surface, BandData::F32(&grid), false);
        let mut command = skysweep();
        command.arg("diff").arg(town().join("dsm.tif")).arg(&later).arg("-o").arg(folder.path().join("out"));
        command.args(["--sigma-m", "0.1", "--progress", "none", "--json", "--overwrite"]);
        let report: Value = serde_json::from_slice(&command.assert().code(0).get_output().stdout).unwrap();
        assert!(report["notes"].to_string().contains("the first surface has no probabilities"), "{}", report["notes"]);
        report
    };
    let sure = change(&|_| 0.9);
    let region = &sure["regions"][0];
    assert!((region["probability"].as_f64().unwrap() - 0.9).abs() < 0.01 && region["independent_cells"].is_f64());
    assert!(region["decided_m2"].as_f64() > region["area_m2"].as_f64().map(|area| 0.9 * area), "{region}");
    let weak = change(&|moved| if moved > 0.5 { 0.2 } else { 0.9 });
    assert_eq!(weak["regions"].as_array().unwrap().len(), 0, "{weak}");
    assert!(weak["deciding_cells"].as_u64() < sure["deciding_cells"].as_u64());
}

#[test]
fn what_cannot_be_compared_is_refused_with_a_reason() {
    let folder = tempfile::tempdir().unwrap();
    let surface = town().join("dsm.tif");
    let refused = |later: &Path, more: &[&str], reason: &str| {
        let out = folder.path().join("out");
        let mut command = skysweep();
        command.arg("diff").arg(&surface).arg(later).arg("-o").arg(&out).args(["--progress", "none"]).args(more);
        command.assert().code(2).stderr(predicate::str::contains(reason));
        assert!(!out.exists());
    };
    refused(&folder.path().join("none.tif"), &[], "none.tif");
    refused(&surface, &["--confidence", "1.5"], "confidence");
    refused(&surface, &["--sigma-m=-1"], "-1");
    refused(&surface, &["--areas", "none.geojson"], "none.geojson");
    refused(&surface, &["--after-vertical", "egm2008", "--align", "none"], "egm2008");
}

/// Jitter of the second surface, a wave along its rows, is no change where blocks are moved on
/// their own.
#[test]
fn jitter_is_removed_by_blocks() {
    let folder = tempfile::tempdir().unwrap();
    let later = folder.path().join("later.tif");
    let surface = read_dem(town().join("dsm.tif")).unwrap();
    let (width, height) = (surface.heights.width(), surface.heights.height());
    let moved = (0..width * height).map(|at| {
        let (column, row) = ((at % width) as f64, (at / width) as f64);
        let noise = 0.1 * ((at * 7919 % 1013) as f32 / 1013.0 - 0.5);
        let (sideways, up) = (3.0 * (row / 100.0).sin(), 0.002 * (row - 320.0));
        eval::bilinear(&surface.heights, column - sideways, row).map_or(f32::NAN, |h| (h + up) as f32 + noise)
    });
    let moved = Grid::from_vec(width, height, moved.collect()).unwrap();
    write_like(&later, &surface, BandData::F32(&moved), true);
    let run = |name: &str, options: &[&str]| {
        let mut command = skysweep();
        command.arg("diff").arg(town().join("dsm.tif")).arg(&later).arg("-o").arg(folder.path().join(name));
        command.args(["--sigma-m", "0.1", "--progress", "none", "--json"]).args(options).assert()
    };
    let report = |name: &str, options: &[&str]| -> Value {
        serde_json::from_slice(&run(name, options).code(0).get_output().stdout).unwrap()
    };
    let whole = report("whole", &[]);
    assert!(whole["blocks"].is_null());
    let blocks = report("blocks", &["--align-blocks", "64"]);
    let found = &blocks["blocks"];
    assert_eq!(found["count"], 25);
    assert!((0.8..2.0).contains(&found["largest_sideways_m"].as_f64().unwrap()), "{found}");
    let spread = |report: &Value| report["detection_m"].as_f64().unwrap();
    assert!(spread(&blocks) < 0.5 * spread(&whole), "{} {}", spread(&blocks), spread(&whole));
    assert_eq!(blocks["regions"].as_array().unwrap().len(), 0, "{}", blocks["regions"]);
    let page = std::fs::read_to_string(folder.path().join("blocks/diff.html")).unwrap();
    assert!(page.contains("moved by blocks"));
    run("small", &["--align-blocks", "10"]).code(2).stderr(predicate::str::contains("too small"));
}
