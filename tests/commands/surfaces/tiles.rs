//! `skysweep tiles` end to end on the sample town: the files of a tile lie on the same pixels, show
//! what the whole ortho shows, and are made once.

use std::path::{Path, PathBuf};

use crate::common::{band, sample, skysweep};
use assert_cmd::Command;
use crs::MapProjection;
use formats::raster::{Dem, read_dem};
use predicates::prelude::*;
use serde_json::Value;
use tempfile::TempDir;

/// Two cameras of which the second stands on the tile of the first, and one far from the town.
const CAMERAS: &str =
    "id,lon,lat,heading,height_m\ncorner,5.4000,43.5300,37,\nbeside,5.4003,43.5301,100,195\nfar,5.5,43.6,0,\n";
const SIDE: usize = 192;

fn list(folder: &TempDir) -> PathBuf {
    let path = folder.path().join("cameras.csv");
    std::fs::write(&path, CAMERAS).unwrap();
    path
}

fn tiles(folder: &TempDir, images: &[&str]) -> Command {
    let mut command = skysweep();
    command.arg("tiles").arg(sample("truth/dsm.tif")).arg("--positions").arg(list(folder));
    command.arg("--images").args(images.iter().map(|name| sample(name)));
    command.args(["--size", &SIDE.to_string(), "--confidence", "--progress", "none", "-o"]);
    command.arg(folder.path().join("tiles"));
    command
}

fn json(path: &Path) -> Value {
    serde_json::from_slice(&std::fs::read(path).unwrap()).unwrap()
}

fn projection(dem: &Dem) -> MapProjection {
    MapProjection::from_definition(dem.crs_wkt.as_deref().unwrap()).unwrap()
}

const VIEWS: [&str; 3] = ["view_1.tif", "view_2.tif", "view_3.tif"];

#[test]
fn a_tile_has_height_map_ortho_and_cameras_on_the_same_pixels() {
    let folder = tempfile::tempdir().unwrap();
    let told = tiles(&folder, &VIEWS[..1]).assert().code(1).stderr(predicate::str::contains("far: "));
    told.stdout(predicate::str::contains("2 made, 0 kept, 1 failed"));
    let tile = folder.path().join("tiles/corner");
    let (height, ortho) = (read_dem(tile.join("height.tif")).unwrap(), read_dem(tile.join("ortho.tif")).unwrap());
    assert_eq!((height.heights.width(), ortho.heights.width()), (SIDE, SIDE));
    assert_eq!((height.geotransform, &height.crs_wkt), (ortho.geotransform, &ortho.crs_wkt));

    let page = std::fs::read_to_string(folder.path().join("tiles/tiles.html")).unwrap();
    assert!(page.contains("corner: ortho") && page.contains("beside: heights") && page.contains("far"));
    let world = std::fs::read_to_string(tile.join("ortho.pgw")).unwrap();
    let lines: Vec<f64> = world.lines().map(|line| line.parse().unwrap()).collect();
    let (x, y) = ortho.geotransform.map_from_cell(0.0, 0.0);
    assert!((lines[4] - x).hypot(lines[5] - y) < 1e-6, "{world}");

    // The same map as that of the command for height maps.
    let alone = folder.path().join("alone.tif");
    let mut command = skysweep();
    command.arg("heightmap").arg(sample("truth/dsm.tif")).args(["--center", "5.4", "43.53", "--heading", "37"]);
    command.args(["--confidence", "--no-preview", "--size", &SIDE.to_string(), "-o"]).arg(&alone).assert().code(0);
    assert_eq!(band(&alone, 1), band(&tile.join("height.tif"), 1));

    // The ortho of the whole surface shows the same at the same places, hidden cells included: what
    // stands beside the tile hides its rim, too.
    let whole = folder.path().join("whole.tif");
    let mut command = skysweep();
    command.arg("ortho").arg(sample(VIEWS[0])).arg("--dsm").arg(sample("truth/dsm.tif")).arg("-o").arg(&whole);
    command.arg("-q").assert().code(0);
    let (town, state) = (read_dem(&whole).unwrap(), band(&folder.path().join("whole_mask.tif"), 1));
    let own = band(&tile.join("ortho_mask.tif"), 1);
    let (from, to) = (projection(&ortho), projection(&town));
    let (mut same, mut hidden, mut both, mut pairs) = (0, 0, 0, Vec::new());
    for row in 0..SIDE {
        for column in 0..SIDE {
            let (x, y) = ortho.geotransform.map_from_cell(column as f64, row as f64);
            let (lon, lat) = from.lonlat_from_map(x, y).unwrap();
            let at = to.map_from_lonlat(lon, lat).unwrap();
            let (c, r) = town.geotransform.cell_from_map(at.x, at.y).unwrap();
            let (near, found) = ((c.round() as usize, r.round() as usize), own[(column, row)]);
            same += usize::from(state[near] == found);
            hidden += usize::from(state[near] == 1.0);
            both += usize::from(state[near] == 1.0 && found == 1.0);
            let value = raster::bilinear(&town.heights, c, r);
            if found == 0.0 && value.is_finite() {
                pairs.push((f64::from(ortho.heights[(column, row)]), f64::from(value)));
            }
        }
    }
    let cells = SIDE * SIDE;
    assert!(same as f64 > 0.98 * cells as f64, "{same} of {cells} cells have the same state");
    // What is hidden is a few cells wide, so the nearest cell of the other grid is often beyond its
    // edge.
    assert!(hidden > 1000 && both as f64 > 0.8 * hidden as f64, "{both} of {hidden} hidden cells are found");
    let correlation = correlation(&pairs);
    assert!(
        pairs.len() as f64 > 0.9 * (cells - hidden) as f64 && correlation > 0.97,
        "{} cells, correlation {correlation}",
        pairs.len()
    );
}

fn correlation(pairs: &[(f64, f64)]) -> f64 {
    let n = pairs.len() as f64;
    let (a, b) = pairs.iter().fold((0.0, 0.0), |(a, b), p| (a + p.0 / n, b + p.1 / n));
    let sums = pairs.iter().fold([0.0; 3], |[ab, aa, bb], p| {
        let (x, y) = (p.0 - a, p.1 - b);
        [ab + x * y, aa + x * x, bb + y * y]
    });
    sums[0] / (sums[1] * sums[2]).sqrt()
}

#[test]
fn the_description_names_cameras_in_the_frame_of_the_tile() {
    let folder = tempfile::tempdir().unwrap();
    tiles(&folder, &VIEWS[1..]).assert().code(1);
    let tile = json(&folder.path().join("tiles/corner/tile.json"));
    let cameras = tile["ground_cameras"].as_array().unwrap();
    assert_eq!(cameras.iter().map(|c| c["id"].as_str().unwrap()).collect::<Vec<_>>(), ["corner", "beside"]);
    let number = |value: &Value| value.as_f64().unwrap();
    // 24.2 m east and 11.1 m north, seen from a camera that looks to 37 degrees.
    let (east, north) = (0.0003 * 80_800.0, 0.0001 * 111_110.0);
    let (sin, cos) = 37f64.to_radians().sin_cos();
    let beside = &cameras[1];
    let place = [0, 1].map(|i| number(&beside["right_forward_m"][i]));
    let expected = [east * cos - north * sin, east * sin + north * cos];
    assert!((place[0] - expected[0]).abs() < 0.1 && (place[1] - expected[1]).abs() < 0.1, "{place:?} {expected:?}");
    let middle = (SIDE as f64 - 1.0) / 2.0;
    let pixel = [0, 1].map(|i| number(&beside["pixel"][i]));
    assert!((pixel[0] - middle - 2.0 * place[0]).abs() < 0.01, "{pixel:?}");
    assert!((pixel[1] - middle + 2.0 * place[1]).abs() < 0.01, "{pixel:?}");
    assert_eq!(number(&beside["relative_heading_deg"]), 63.0);
    let satellites = tile["satellites"].as_array().unwrap();
    assert_eq!(satellites.len(), 2);
    for satellite in satellites {
        let [right, forward, up] = [0, 1, 2].map(|i| number(&satellite["towards_sensor"][i]));
        assert!((right.hypot(forward).hypot(up) - 1.0).abs() < 1e-9);
        let azimuth = (right.atan2(forward).to_degrees() + 37.0).rem_euclid(360.0);
        assert!((azimuth - number(&satellite["azimuth_deg"])).abs() < 1e-6);
    }
}

#[test]
fn tiles_are_made_once_and_other_tiles_are_not_replaced() {
    let folder = tempfile::tempdir().unwrap();
    tiles(&folder, &VIEWS[..1]).assert().code(1);
    let picture = folder.path().join("tiles/beside/ortho.png");
    let made = std::fs::metadata(&picture).unwrap().modified().unwrap();
    tiles(&folder, &VIEWS[..1]).assert().code(1).stdout(predicate::str::contains("0 made, 2 kept, 1 failed"));
    assert_eq!(std::fs::metadata(&picture).unwrap().modified().unwrap(), made);
    let told = tiles(&folder, &VIEWS[..2]).assert().code(2);
    told.stderr(predicate::str::contains("not the tile asked for").and(predicate::str::contains("--overwrite")));
    assert_eq!(std::fs::metadata(&picture).unwrap().modified().unwrap(), made);
    tiles(&folder, &VIEWS[..2]).arg("--overwrite").assert().code(1);
    assert_eq!(json(&folder.path().join("tiles/beside/tile.json"))["satellites"].as_array().unwrap().len(), 2);
    let left: Vec<String> = std::fs::read_dir(folder.path().join("tiles"))
        .unwrap()
        .map(|entry| entry.unwrap().file_name().into_string().unwrap())
        .filter(|name| name.starts_with('.'))
        .collect();
    assert!(left.is_empty(), "{left:?}");
}

#[test]
fn what_makes_no_tiles_says_why() {
    let folder = tempfile::tempdir().unwrap();
    let mut command = skysweep();
    command
        .arg("tiles")
        .arg(sample("truth/dsm.tif"))
        .args(["--center", "5.4", "43.53", "-o"])
        .arg(folder.path().join("t"));
    command.assert().code(2).stderr(predicate::str::contains("no images").and(predicate::str::contains("--images")));
    assert!(!folder.path().join("t").exists());
}
