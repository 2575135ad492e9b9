//! `skysweep groundview` end to end: depths and normals against the tree of triangles of the same
//! surface, the COLMAP set, masks, crops and compositions, and what is refused.

use std::path::{Path, PathBuf};

use crate::common::skysweep;
use bvh::{Bvh, Ray};
use camera::ImagePoint;
use crs::MapProjection;
use formats::colmap::read_with_points;
use formats::raster::{Dem, ImageSource, read_dem, write_png_rgb};
use formats::splat_ply::LocalOrigin;
use predicates::prelude::*;
use raster::Grid;
use serde_json::Value;
use tempfile::TempDir;

const CENTRE: [&str; 3] = ["--center", "5.4", "43.53"];

fn town(name: &str) -> PathBuf {
    crate::common::sample("truth").join(name)
}

/// A small height map of the town's middle.
fn small_map(folder: &TempDir) -> PathBuf {
    let map = folder.path().join("small.tif");
    let mut command = skysweep();
    command.arg("heightmap").arg(town("dsm.tif")).args(CENTRE).args(["--size", "120", "--no-preview", "-q", "-o"]);
    command.arg(&map).assert().code(0);
    map
}

/// A height map of the town, turned by 37°, and the views from its middle.
fn views(folder: &TempDir, options: &[&str]) -> (PathBuf, PathBuf) {
    let (map, out) = (folder.path().join("map.tif"), folder.path().join("views"));
    let mut command = skysweep();
    command.arg("heightmap").arg(town("dsm.tif")).args(CENTRE).args([
        "--heading",
        "37",
        "--size",
        "300",
        "--no-preview",
        "-q",
    ]);
    command.arg("-o").arg(&map).assert().code(0);
    let mut command = skysweep();
    command.arg("groundview").arg(&map).args(CENTRE).args(["--heading", "37", "-q", "-o"]).arg(&out).args(options);
    command.args(["--width", "360", "--crop-size", "128"]).assert().code(0);
    (map, out)
}

fn origin(folder: &Path) -> LocalOrigin {
    serde_json::from_slice(&std::fs::read(folder.join("origin.json")).unwrap()).unwrap()
}

fn array(path: PathBuf) -> Vec<f64> {
    formats::npy::read(path).unwrap().data.to_f64()
}

/// The triangles of a raster, two to each square of cells, made here anew; metres from the origin.
fn triangles(dem: &Dem, origin: [f64; 3]) -> Bvh {
    let (width, height) = (dem.heights.width(), dem.heights.height());
    let position = |k: usize| {
        let (x, y) = dem.geotransform.map_from_cell((k % width) as f64, (k / width) as f64);
        let z = f64::from(dem.heights.data()[k]);
        [x - origin[0], y - origin[1], if z.is_finite() { z - origin[2] } else { 0.0 }]
    };
    let positions: Vec<[f64; 3]> = (0..width * height).map(position).collect();
    let mut triangles = Vec::new();
    for row in 0..height - 1 {
        for column in 0..width - 1 {
            let k = row * width + column;
            for triangle in [[k, k + 1, k + width], [k + 1, k + width + 1, k + width]] {
                if triangle.iter().all(|&k| dem.heights.data()[k].is_finite()) {
                    triangles.push(triangle.map(|k| k as u32));
                }
            }
        }
    }
    Bvh::new(&positions, &triangles).unwrap()
}

#[test]
fn depths_are_those_of_the_triangles_and_the_set_is_a_colmap_model() {
    let folder = tempfile::tempdir().unwrap();
    let (map, out) = views(&folder, &[]);
    let (dem, origin) = (read_dem(&map).unwrap(), origin(&out));
    let bvh = triangles(&dem, origin.origin);
    let (model, points) = read_with_points(&out.join("sparse/0")).unwrap();
    assert_eq!((model.views.len(), model.lenses.len()), (4, 1));
    let mut differences = Vec::new();
    for view in &model.views {
        let lens = &model.lenses[view.lens];
        let stem = view.name.strip_suffix(".png").unwrap();
        let depth = array(out.join("depth").join(format!("{stem}.npy")));
        let normal = array(out.join("normal").join(format!("{stem}.npy")));
        for k in 0..128 * 128 {
            let [x, y] = lens.direction(ImagePoint::new((k % 128) as f64, (k / 128) as f64)).unwrap();
            let direction = [0, 1, 2].map(|i| {
                let r = &view.pose.rotation;
                r[0][i] * x + r[1][i] * y + r[2][i]
            });
            let hit = bvh.closest_hit(&Ray { origin: view.pose.centre, direction, end: f64::INFINITY });
            assert_eq!(hit.is_some(), depth[k].is_finite(), "{stem} {k}");
            if let Some(hit) = hit {
                differences.push((hit.t - depth[k]).abs());
                let length: f64 = (0..3).map(|i| normal[3 * k + i].powi(2)).sum();
                let towards: f64 = (0..3).map(|i| normal[3 * k + i] * direction[i]).sum();
                assert!((length - 1.0).abs() < 1e-5 && towards <= 1e-6);
            }
        }
    }
    differences.sort_by(f64::total_cmp);
    let median = differences[differences.len() / 2];
    assert!(differences.len() > 20_000 && median < 0.02, "the median difference is {median} m");
    assert!(*differences.last().unwrap() < 0.02, "the largest is {:?} m", differences.last());

    // Points lie where their pixels see them, and on the height map.
    assert!(points.len() > 2000);
    for point in &points {
        let observation = point.track[0];
        let view = &model.views[observation.view as usize];
        let [x, y, z] = view.pose.camera_from_world(point.position);
        let at = model.lenses[view.lens].project(x / z, y / z).unwrap();
        assert!((at.sample - observation.pixel.sample).hypot(at.line - observation.pixel.line) < 1e-6);
        let [x, y, _] = [0, 1, 2].map(|i| point.position[i] + origin.origin[i]);
        let (c, r) = dem.geotransform.cell_from_map(x, y).unwrap();
        let around = [(c.floor(), r.floor()), (c.ceil(), r.floor()), (c.floor(), r.ceil()), (c.ceil(), r.ceil())];
        let heights = around.map(|(c, r)| f64::from(dem.heights[(c as usize, r as usize)]) - origin.origin[2]);
        let (low, high) = heights.iter().fold((f64::MAX, f64::MIN), |(l, h), &z| (l.min(z), h.max(z)));
        assert!(
            point.position[2] > low - 0.01 && point.position[2] < high + 0.01 || heights.iter().any(|h| h.is_nan())
        );
    }
}

#[test]
fn panoramas_look_along_the_heading_and_masks_say_what_is_what() {
    let folder = tempfile::tempdir().unwrap();
    let (map, out) = views(&folder, &["--ground-offset", "30"]);
    let (depth, origin) = (array(out.join("depth/panorama.npy")), origin(&out));
    let mask = |kind: &str, name: &str| {
        let source = ImageSource::open(out.join(kind).join(name)).unwrap();
        source.read_samples(1, source.window()).unwrap()
    };
    let (seen, sky) = (mask("mask", "panorama.png"), mask("sky", "panorama.png"));
    assert_eq!((seen.width(), seen.height()), (360, 180));
    for (k, depth) in depth.iter().enumerate() {
        assert_eq!(depth.is_finite(), seen.data()[k] == 255.0);
        assert!(!(depth.is_finite() && sky.data()[k] == 255.0));
    }
    // The zenith is sky, the nadir 30 m below; a crop's middle is the panorama's at its azimuth.
    assert!(sky[(0, 0)] == 255.0 && (depth[179 * 360 + 7] - 30.0).abs() < 0.1, "{}", depth[179 * 360 + 7]);
    let report: Value = serde_json::from_slice(&std::fs::read(out.join("report.json")).unwrap()).unwrap();
    let centre = [0, 1, 2].map(|i| report["views"][0]["centre"][i].as_f64().unwrap());
    let projection = MapProjection::from_definition(&origin.crs).unwrap();
    let (lon, lat) = projection.lonlat_from_map(centre[0] + origin.origin[0], centre[1] + origin.origin[1]).unwrap();
    assert!((lon - 5.4).abs() < 1e-9 && (lat - 43.53).abs() < 1e-9);
    // A degree to the right of the heading, 40° down, by the panorama and by the map.
    let dem = read_dem(&map).unwrap();
    let bvh = triangles(&dem, origin.origin);
    let (azimuth, down) = ((37.0f64 + 0.5).to_radians(), 40.5f64.to_radians());
    let direction = [azimuth.sin() * down.cos(), azimuth.cos() * down.cos(), -down.sin()];
    let hit = bvh.closest_hit(&Ray { origin: centre, direction, end: f64::INFINITY }).unwrap();
    assert!((hit.t - depth[130 * 360 + 180]).abs() < 1e-3, "{} {}", hit.t, depth[130 * 360 + 180]);
    // What is seen: the cells under the camera, and not all.
    let cells = ImageSource::open(out.join("visibility.tif")).unwrap();
    let cells = cells.read_samples(1, cells.window()).unwrap();
    assert!(cells[(150, 150)] == 1.0 && cells.data().contains(&0.0));
    assert!(out.join("previews/panorama.png").is_file());
    let told = [0, 1].map(|i| report["cells_seen"][i].as_u64().unwrap());
    assert_eq!(told[0] as usize, cells.data().iter().filter(|c| **c > 0.0).count());
}

#[test]
fn cameras_of_a_model_see_the_same_and_meshes_are_surfaces_too() {
    let folder = tempfile::tempdir().unwrap();
    let (map, out) = views(&folder, &["--threads", "1"]);
    let again = folder.path().join("again");
    let mut command = skysweep();
    command.arg("groundview").arg(&map).arg("--cameras").arg(out.join("sparse/0")).arg("-o").arg(&again);
    command.args(["--threads", "2"]).assert().code(0).stdout(predicate::str::contains("panorama_003"));
    for name in ["panorama_000", "panorama_003"] {
        let depth = |folder: &Path| array(folder.join("depth").join(format!("{name}.npy")));
        let (a, b) = (depth(&out), depth(&again));
        // Poses go through quaternions.
        let close = |a: f64, b: f64| (a.is_nan() && b.is_nan()) || (a - b).abs() < 1e-3 * b;
        assert!(a.iter().zip(&b).filter(|(a, b)| !close(**a, **b)).count() < 20);
    }
    let mesh = folder.path().join("mesh");
    let mut command = skysweep();
    command.arg("groundview").arg(town("buildings.city.json")).args(CENTRE).args(["--camera-height", "190"]);
    command.args(["--vertical", "ellipsoid", "--crops", "2", "--width", "180", "--json", "-o"]).arg(&mesh);
    let report: Value = serde_json::from_slice(&command.assert().code(0).get_output().stdout).unwrap();
    assert!(report["views"][0]["ground_share"].as_f64().unwrap() > 0.02 && report["cells_seen"].is_null());
    assert!(!mesh.join("visibility.tif").exists() && mesh.join("sparse/0/images.bin").is_file());
}

#[test]
fn pictures_are_cut_and_layers_laid_over_each_other() {
    let folder = tempfile::tempdir().unwrap();
    let pictures = folder.path().join("pictures");
    std::fs::create_dir(&pictures).unwrap();
    // A picture whose columns tell the azimuth: red is 255 · c / 360.
    let value = |k: usize| [((k % 360) as f64 * 255.0 / 360.0).round() as u8, 90, 0];
    let picture = Grid::from_vec(360, 180, (0..360 * 180).map(value).collect()).unwrap();
    write_png_rgb(pictures.join("panorama.png"), &picture, false).unwrap();
    let (_, out) = views(&folder, &["--pictures", pictures.to_str().unwrap()]);
    let red = |name: &str| {
        let source = ImageSource::open(out.join("images").join(name)).unwrap();
        source.read_samples(1, source.window()).unwrap()[(64, 64)]
    };
    // Ahead is the middle column, right and left a quarter beside it.
    for (name, column) in [("panorama_000.png", 180.0), ("panorama_001.png", 270.0), ("panorama_003.png", 90.0)] {
        assert!((red(name) - column * 255.0 / 360.0).abs() < 2.0, "{name}: {}", red(name));
    }
    let (_, points) = read_with_points(&out.join("sparse/0")).unwrap();
    assert!(points.iter().all(|point| point.color[1] == 90), "points have the picture's colours");

    let layer = |name: &str, value: [u8; 3]| {
        let path = folder.path().join(name);
        write_png_rgb(&path, &Grid::filled(3, 2, value), false).unwrap();
        path
    };
    let (ground, alpha) = (layer("ground.png", [50, 20, 0]), layer("alpha.png", [51, 51, 51]));
    let (satellite, composed) = (layer("satellite.png", [100, 200, 250]), folder.path().join("composed.png"));
    let mut command = skysweep();
    command.args(["groundview", "compose"]).arg(&ground).arg(&alpha).arg(&satellite).arg("-o").arg(&composed);
    command.assert().code(0);
    let source = ImageSource::open(&composed).unwrap();
    let bands = [1, 2, 3].map(|band| source.read_samples(band, source.window()).unwrap()[(1, 1)]);
    assert_eq!(bands, [130.0, 180.0, 200.0]);
    command.assert().code(2).stderr(predicate::str::contains("--overwrite"));
}

#[test]
fn a_bad_row_of_a_list_is_named_and_the_others_are_made() {
    let folder = tempfile::tempdir().unwrap();
    let map = small_map(&folder);
    let (list, pictures, out) =
        (folder.path().join("list.csv"), folder.path().join("pictures"), folder.path().join("views"));
    let rows =
        "id,lon,lat,heading\na,5.4,43.53,37\nfar,6.5,43.5,0\nbad,east,43.53,0\nb,5.4002,43.5301,\nc,5.4001,43.53,\n";
    std::fs::write(&list, rows).unwrap();
    std::fs::create_dir(&pictures).unwrap();
    let picture = Grid::filled(36, 18, [9, 9, 9]);
    for id in ["a", "b"] {
        write_png_rgb(pictures.join(format!("{id}.png")), &picture, false).unwrap();
    }
    std::fs::write(pictures.join("c.png"), "no picture").unwrap();
    let mut command = skysweep();
    command.arg("groundview").arg(&map).arg("--positions").arg(&list).arg("--pictures").arg(&pictures);
    command.args(["--width", "60", "--crops", "2", "--crop-size", "32", "--heading", "90", "--json"]);
    let assert = command.args(["--progress", "json"]).arg("-o").arg(&out).assert().code(1);
    let assert = assert.stderr(predicate::str::contains("far").and(predicate::str::contains("views")));
    let report: Value = serde_json::from_slice(&assert.get_output().stdout).unwrap();
    let names = |key: &str, name: &str| {
        let all = report[key].as_array().unwrap().iter();
        all.map(|v| v[name].as_str().unwrap().to_owned()).collect::<Vec<_>>()
    };
    assert_eq!(names("failed", "id"), ["far", "bad", "c_000", "c_001"]);
    assert_eq!(names("views", "name"), ["a", "a_000", "a_001", "b", "b_000", "b_001", "c"]);
    assert_eq!(read_with_points(&out.join("sparse/0")).unwrap().0.views.len(), 4);
    let told: Value = serde_json::from_slice(&std::fs::read(out.join("report.json")).unwrap()).unwrap();
    assert_eq!(told, report);
}

#[test]
fn a_camera_file_stands_for_its_options() {
    let folder = tempfile::tempdir().unwrap();
    let map = small_map(&folder);
    let file = folder.path().join("camera.json");
    std::fs::write(&file, r#"{"lon_deg": 5.4, "lat_deg": 43.53, "heading_deg": 37.0, "height_m": 240.0}"#).unwrap();
    let centre = |name: &str, options: &[&str]| {
        let mut command = skysweep();
        command.arg("groundview").arg(&map).args(["--width", "60", "--crops", "0", "--json"]);
        command.args(options).arg("-o").arg(folder.path().join(name));
        let report: Value = serde_json::from_slice(&command.assert().code(0).get_output().stdout).unwrap();
        (report["views"][0]["centre"].clone(), array(folder.path().join(name).join("depth/panorama.npy")))
    };
    let options = ["--center", "5.4", "43.53", "--heading", "37", "--camera-height", "240"];
    let (by_file, by_options) = (centre("a", &["--camera", file.to_str().unwrap()]), centre("b", &options));
    assert_eq!(by_file.0, by_options.0);
    assert!(by_file.1.iter().zip(&by_options.1).all(|(a, b)| a.to_bits() == b.to_bits()));
}

#[test]
fn what_cannot_be_seen_is_said() {
    let folder = tempfile::tempdir().unwrap();
    let (out, dsm) = (folder.path().join("views"), town("dsm.tif"));
    for (options, words) in [
        (vec![], "--center"),
        (vec!["--center", "5.5", "43.53"], "--camera-height"),
        (vec!["--center", "5.4", "95"], "(5.4, 95"),
        (vec!["--center", "5.4", "43.53", "--fov", "180"], "--fov"),
        (vec!["--center", "5.4", "43.53", "--width", "1"], "--width"),
        (vec!["--center", "5.4", "43.53", "--heading", "nan"], "heading"),
        (vec!["--center", "5.4", "43.53", "--pictures", "/nonexistent"], "panorama.png"),
        (vec!["--cameras", "/nonexistent"], "cameras"),
    ] {
        let mut command = skysweep();
        command.arg("groundview").arg(&dsm).args(&options).arg("-o").arg(&out);
        command.assert().code(2).stderr(predicate::str::contains(words));
        assert!(!out.exists(), "{options:?}");
    }
    let view = Path::new(env!("CARGO_MANIFEST_DIR")).join("data-samples/town/view_1.tif");
    let mut command = skysweep();
    command.arg("groundview").arg(&view).args(CENTRE).arg("-o").arg(&out);
    command.assert().code(2).stderr(predicate::str::contains("geotransform"));
}
