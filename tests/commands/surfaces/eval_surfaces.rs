//! `skysweep eval` on meshes, city models, clouds and camera maps, from files to exit code.

use std::path::{Path, PathBuf};

use assert_cmd::Command;
use las::{Builder, Writer};
use predicates::prelude::PredicateBooleanExt;
use predicates::str::contains;
use serde_json::Value;
use tempfile::TempDir;

const EAST: f64 = 690_000.0;
const NORTH: f64 = 5_336_000.0;

/// A roof of 10 × 6 m with two slopes at a height, as OBJ in map coordinates.
fn roof_obj(folder: &TempDir, name: &str, lift: f64) -> PathBuf {
    let corners = [(0, 0, 3), (10, 0, 3), (10, 3, 5), (0, 3, 5), (10, 6, 3), (0, 6, 3)];
    let mut text = String::new();
    for (x, y, z) in corners {
        let (x, y, z) = (EAST + f64::from(x), NORTH + f64::from(y), f64::from(z) + lift);
        text += &format!("v {x} {y} {z}\n");
    }
    text += "f 1 2 3 4\nf 4 3 5 6\n";
    write(folder, name, text.as_bytes())
}

/// Points on the same roof, every 0.2 m.
fn roof_points(lift: f64) -> Vec<[f64; 3]> {
    let point = |i: usize, j: usize| {
        let (x, y) = (0.1 + 0.2 * i as f64, 0.1 + 0.2 * j as f64);
        let z = 3.0 + (2.0 / 3.0) * y.min(6.0 - y) + lift;
        [EAST + x, NORTH + y, z]
    };
    (0..50).flat_map(|i| (0..30).map(move |j| point(i, j))).collect()
}

fn las(folder: &TempDir, name: &str, points: &[[f64; 3]]) -> PathBuf {
    let path = folder.path().join(name);
    let mut builder = Builder::from((1, 4));
    builder.transforms.x = las::Transform { scale: 1e-4, offset: EAST };
    builder.transforms.y = las::Transform { scale: 1e-4, offset: NORTH };
    builder.transforms.z = las::Transform { scale: 1e-4, offset: 0.0 };
    let mut writer = Writer::from_path(&path, builder.into_header().unwrap()).unwrap();
    for &[x, y, z] in points {
        writer.write_point(las::Point { x, y, z, ..Default::default() }).unwrap();
    }
    writer.close().unwrap();
    path
}

fn write(folder: &TempDir, name: &str, content: &[u8]) -> PathBuf {
    let path = folder.path().join(name);
    std::fs::write(&path, content).unwrap();
    path
}

fn skysweep(arguments: &[&str], test: &Path, reference: &Path) -> assert_cmd::assert::Assert {
    Command::cargo_bin("skysweep").unwrap().arg("eval").args([test, reference]).args(arguments).assert()
}

fn json(arguments: &[&str], test: &Path, reference: &Path) -> Value {
    let output = skysweep(&[arguments, &["--json"]].concat(), test, reference).success().get_output().stdout.clone();
    serde_json::from_slice(&output).unwrap()
}

#[track_caller]
fn near(value: &Value, expected: f64, tolerance: f64) {
    let value = value.as_f64().unwrap();
    assert!((value - expected).abs() <= tolerance, "{value}, expected {expected}");
}

/// Distance between the planes of roofs that are 0.3 m above one another.
fn apart() -> f64 {
    0.3 / (1.0_f64 + 4.0 / 9.0).sqrt()
}

#[test]
fn meshes_and_clouds_in_any_combination() {
    let folder = TempDir::new().unwrap();
    let (low, high) = (roof_obj(&folder, "low.obj", 0.0), roof_obj(&folder, "high.obj", 0.3));
    let cloud = las(&folder, "cloud.las", &roof_points(0.3));
    for test in [&high, &cloud] {
        let found = json(&[], test, &low);
        assert_eq!(found["kind"], "surfaces");
        // At the eaves and gables the nearest point is straight below or beside, never nearer than
        // the plane.
        near(&found["result"]["accuracy"]["median_m"], apart(), 1e-4);
        let m3c2 = &found["result"]["m3c2"]["median_m"];
        near(m3c2, apart(), 0.01);
        assert_eq!(found["protocol"]["local_origin"], serde_json::json!([690_005.0, 5_336_003.0, 4.0]));
    }
    let against_cloud = json(&[], &low, &cloud);
    near(&against_cloud["result"]["completeness"]["median_m"], apart(), 1e-4);
    near(&against_cloud["result"]["m3c2"]["median_m"], -apart(), 0.01);
    let clouds = json(&[], &cloud, &cloud);
    assert_eq!((&clouds["result"]["chamfer_m"], &clouds["result"]["voc"]["voc"]), (&0.0.into(), &1.0.into()));
    let same = json(&["--thresholds", "0.05"], &low, &low);
    assert_eq!(same["result"]["scores"][0]["f_score"], 1.0);
    skysweep(&[], &high, &low).success().stdout(contains("accuracy").and(contains("M3C2")).and(contains("VOC")));
}

/// Normals of a handful of points differ between programs and between clouds.
#[test]
fn sparse_normals_are_told() {
    let folder = TempDir::new().unwrap();
    let cloud = las(&folder, "cloud.las", &roof_points(0.3));
    let notes =
        |normal_scale: &str| json(&["--normal-scale", normal_scale], &cloud, &cloud)["protocol"]["notes"].to_string();
    let (alone, sparse, dense) = (notes("0.3"), notes("0.6"), notes("3"));
    assert!(alone.contains("M3C2: no distances"), "{alone}");
    assert!(sparse.contains("M3C2: the normals rest on"), "{sparse}");
    assert!(!dense.contains("M3C2"), "{dense}");
}

#[test]
fn the_origin_of_a_ply_is_added_and_systems_are_brought_together() {
    let folder = TempDir::new().unwrap();
    let reference = write(
        &folder,
        "reference.ply",
        &[
            b"ply\nformat ascii 1.0\ncomment origin 690000 5336000 500\ncomment crs EPSG:25832\n".as_slice(),
            b"element vertex 4\nproperty float x\nproperty float y\nproperty float z\n",
            b"element face 1\nproperty list uchar int vertex_indices\nend_header\n0 0 0\n10 0 0\n10 6 0\n0 6 0\n4 0 \
              1 2 3\n",
        ]
        .concat(),
    );
    // The middle of the square in UTM 33N, as PROJ has it.
    let to = crs::MapProjection::from_epsg(25833).unwrap();
    let (lon, lat) = crs::MapProjection::from_epsg(25832).unwrap().lonlat_from_map(EAST + 5.0, NORTH + 3.0).unwrap();
    let there = to.map_from_lonlat(lon, lat).unwrap();
    let header = "ply\nformat ascii 1.0\nelement vertex 1\nproperty double x\nproperty double y\nproperty double z\n";
    let origin = format!("comment origin {} {} 0\ncomment crs EPSG:25833\n", there.x, there.y);
    let text = header.replacen("element", &format!("{origin}element"), 1) + "end_header\n0 0 500.25\n";
    let test = write(&folder, "test.ply", text.as_bytes());
    let found = json(&[], &test, &reference);
    near(&found["result"]["accuracy"]["max_m"], 0.25, 1e-6);
    let notes = found["protocol"]["notes"].to_string();
    assert!(
        notes.contains("projected from EPSG:25833 to EPSG:25832") && notes.contains("was added to its positions"),
        "{notes}"
    );
}

#[test]
fn thresholds_decide_the_exit_code_and_the_report_is_written() {
    let folder = TempDir::new().unwrap();
    let (low, high) = (roof_obj(&folder, "low.obj", 0.0), roof_obj(&folder, "high.obj", 0.3));
    skysweep(&["--max-mae", "0.2"], &high, &low).code(1).stderr(contains("mean distance"));
    skysweep(&["--max-mae", "0.4", "--min-completeness", "0.4=0.9"], &high, &low).code(0);
    skysweep(&["--min-completeness", "0.2=0.9"], &high, &low).code(1).stderr(contains("recall_0.2"));
    let report = folder.path().join("out");
    let report_text = report.to_str().unwrap();
    skysweep(&["-o", report_text], &high, &low).success().stdout(contains("report.json"));
    skysweep(&["-o", report_text], &high, &low).success();
    let found: Value = serde_json::from_slice(&std::fs::read(report.join("report.json")).unwrap()).unwrap();
    assert_eq!(found["protocol"]["alignment"], "none");
    std::fs::write(report.join("report.json"), "{}").unwrap();
    skysweep(&["-o", report_text], &high, &low).code(2).stderr(contains("in the way"));
}

#[test]
fn what_cannot_be_compared_is_refused() {
    let folder = TempDir::new().unwrap();
    let low = roof_obj(&folder, "low.obj", 0.0);
    skysweep(&["--align", "xyz"], &low, &low).code(2).stderr(contains("--align is for height grids"));
    skysweep(&["--voxel", "0"], &low, &low).code(2).stderr(contains("the edge of the voxels is 0"));
    skysweep(&["--lod", "2.2"], &low, &low).code(2).stderr(contains("none of the 1 objects"));
    let nothing = write(&folder, "nothing.obj", b"v 0 0 0\n");
    skysweep(&[], &nothing, &low).code(2).stderr(contains("nothing.obj"));
    let hostile = write(
        &folder,
        "hostile.ply",
        b"ply\nformat ascii 1.0\nelement vertex 18446744073709551615\nproperty float x\nproperty float y\nproperty \
          float z\nend_header\n0 0 0\n",
    );
    skysweep(&[], &hostile, &low).code(2).stderr(contains("901"));
    let degrees = write(
        &folder,
        "degrees.ply",
        b"ply\nformat ascii 1.0\ncomment origin 0 0 0\ncomment crs EPSG:4326\nelement vertex 1\nproperty float \
          x\nproperty float y\nproperty float z\nend_header\n11 48 0\n",
    );
    skysweep(&[], &degrees, &low).code(2).stderr(contains("not in metres"));
}

#[test]
fn maps_of_depths_normals_and_masks() {
    let folder = TempDir::new().unwrap();
    let at = |name: &str| folder.path().join(name);
    formats::npy::write(at("a.npy"), &[2, 2], &[1.0f32, 2.0, f32::INFINITY, 4.0], false).unwrap();
    formats::npy::write(at("b.npy"), &[2, 2], &[1.5f32, 2.0, 3.0, 0.0], false).unwrap();
    let found = json(&[], &at("a.npy"), &at("b.npy"));
    assert_eq!((&found["kind"], &found["result"]["valid"]["both"]), (&"depth".into(), &2.into()));
    near(&found["result"]["errors"]["mae"], 0.25, 1e-12);
    skysweep(&["--max-mae", "0.2"], &at("a.npy"), &at("b.npy")).code(1);
    skysweep(&[], &at("a.npy"), &at("b.npy")).success().stdout(contains("errors.mae"));
    let normals: Vec<f32> = [[0.0, 0.0, 1.0], [0.0, 1.0, 0.0]].concat();
    formats::npy::write(at("n.npy"), &[1, 2, 3], &normals, false).unwrap();
    formats::npy::write(at("m.npy"), &[1, 2, 3], &[0.0f32, 0.0, 1.0, 0.0, 0.0, 1.0], false).unwrap();
    near(&json(&[], &at("n.npy"), &at("m.npy"))["result"]["angles"]["mean_deg"], 45.0, 1e-9);
    formats::npy::write(at("p.npy"), &[1, 3], &[true, true, false], false).unwrap();
    formats::npy::write(at("q.npy"), &[1, 3], &[true, false, false], false).unwrap();
    near(&json(&[], &at("p.npy"), &at("q.npy"))["result"]["set"]["iou"], 0.5, 1e-12);
    skysweep(&[], &at("a.npy"), &at("n.npy")).code(2).stderr(contains("maps of one camera"));
    skysweep(&["-o", "x"], &at("a.npy"), &at("b.npy")).code(2).stderr(contains("leave -o out"));
    // A raster is a map where it is said to be one.
    let grid = raster::Grid::from_vec(2, 2, vec![1.0f32, 2.5, f32::NAN, 4.0]).unwrap();
    let band = [formats::raster::Band { description: "depth_m", data: formats::raster::BandData::F32(&grid) }];
    formats::raster::write_map(at("c.tif"), &band, Some(-32768.0), &[], false).unwrap();
    let found = json(&["--maps", "depth"], &at("c.tif"), &at("a.npy"));
    near(&found["result"]["errors"]["max_abs"], 0.5, 1e-12);
}
