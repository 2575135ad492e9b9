//! `skysweep simulate` end to end: the files it writes, the loop through `dsm` and `eval`, and what
//! it refuses.

use std::path::Path;

use crate::common::skysweep;
use predicates::prelude::*;
use serde_json::Value;

const SMALL: [&str; 8] = ["simulate", "town", "--size", "60", "--gsd", "1", "--views", "2"];

const FILES: [&str; 14] = [
    "view_1.tif",
    "view_2.tif",
    "truth/dsm.tif",
    "truth/dtm.tif",
    "truth/classes.tif",
    "truth/buildings.tif",
    "truth/ortho.tif",
    "truth/visibility.tif",
    "truth/heights_1.tif",
    "truth/heights_2.tif",
    "truth/buildings.city.json",
    "scene.toml",
    "scene.json",
    "scene.html",
];

fn json(path: &Path) -> Value {
    serde_json::from_slice(&std::fs::read(path).unwrap()).unwrap()
}

#[test]
fn a_simulation_is_written_whole_and_the_same_each_time() {
    let folder = tempfile::tempdir().unwrap();
    let (first, second) = (folder.path().join("a"), folder.path().join("b"));
    skysweep().args(SMALL).arg("-o").arg(&first).assert().code(0);
    assert!(!first.join("cameras").exists());
    // The parameters that were written make the same scene again.
    skysweep().arg("simulate").arg(first.join("scene.toml")).arg("-o").arg(&second).assert().code(0);
    for name in FILES {
        let bytes = std::fs::read(first.join(name)).unwrap();
        assert!(!bytes.is_empty() && bytes == std::fs::read(second.join(name)).unwrap(), "{name} differs");
    }
    let tifs = std::fs::read_dir(&first).unwrap().filter_map(Result::ok).map(|e| e.file_name().into_string().unwrap());
    let mut tifs: Vec<String> = tifs.filter(|name| name.ends_with(".tif")).collect();
    tifs.sort_unstable();
    assert_eq!(tifs, ["view_1.tif", "view_2.tif"], "only views may be TIFFs at the top of a scene");
    let record = json(&first.join("scene.json"));
    assert_eq!(record["views"].as_array().unwrap().len(), 2);
    assert_eq!(record["epsg"], 32631);
    assert!(record["views"][0]["rpc_fit_error_px"].as_f64().unwrap() < 1e-3);
}

/// A folder holds one scene: nothing is left of a larger one.
#[test]
fn overwriting_leaves_nothing_of_an_earlier_scene() {
    let folder = tempfile::tempdir().unwrap();
    let scene = folder.path().join("scene");
    let simulate = |more: &[&str]| {
        let arguments = SMALL.iter().take(if more.contains(&"--views") { 6 } else { 8 });
        let text =
            skysweep().args(arguments).args(more).arg("-o").arg(&scene).args(["--progress", "none"]).assert().code(0);
        String::from_utf8(text.get_output().stdout.clone()).unwrap()
    };
    let told = simulate(&["--views", "4", "--flight", "3"][..]);
    assert!(told.contains("4 views") && told.contains(scene.to_str().unwrap()), "{told}");
    std::fs::write(scene.join("view_mine.tif"), b"mine").unwrap();
    for name in ["view_4.tif", "truth/heights_3.tif", "cameras/sparse/0/images.txt", "cameras/images/flight_03.png"] {
        assert!(scene.join(name).is_file(), "{name}");
    }
    simulate(&["--overwrite"]);
    for name in [
        "view_3.tif",
        "view_4.tif",
        "truth/heights_3.tif",
        "truth/heights_4.tif",
        "truth/flight_surface.ply",
        "cameras/sparse/0/images.txt",
        "cameras/images/flight_03.png",
    ] {
        assert!(!scene.join(name).exists(), "{name}");
    }
    assert!(FILES.iter().all(|name| scene.join(name).is_file()) && scene.join("view_mine.tif").is_file());
}

#[test]
fn the_buildings_come_as_a_city_model_of_level_2() {
    let folder = tempfile::tempdir().unwrap();
    skysweep().args(SMALL).arg("-o").arg(folder.path()).assert().code(0);
    let city = json(&folder.path().join("truth/buildings.city.json"));
    assert_eq!((&city["type"], &city["version"]), (&Value::from("CityJSON"), &Value::from("2.0")));
    assert!(city["metadata"]["referenceSystem"].as_str().unwrap().ends_with("32631"));
    let objects = city["CityObjects"].as_object().unwrap();
    let geometries: Vec<&Value> = objects.values().filter_map(|o| o["geometry"].get(0)).collect();
    assert!(geometries.len() > 10);
    for geometry in geometries {
        assert_eq!((&geometry["type"], &geometry["lod"]), (&Value::from("Solid"), &Value::from("2")));
        let classes: Vec<&str> = geometry["semantics"]["surfaces"]
            .as_array()
            .unwrap()
            .iter()
            .map(|surface| surface["type"].as_str().unwrap())
            .collect();
        for class in ["RoofSurface", "WallSurface", "GroundSurface"] {
            assert!(classes.contains(&class), "{class} is missing in {classes:?}");
        }
    }
}

/// A raster's cells, which do not depend on the version of GDAL that compressed them.
fn cells(path: &Path) -> Vec<f32> {
    formats::raster::read_dem(path).unwrap().heights.into_vec()
}

#[test]
fn the_sample_scenes_are_what_their_parameters_make() {
    let folder = tempfile::tempdir().unwrap();
    for sample in ["hills", "high-rise-dates"] {
        let kept = Path::new(env!("CARGO_MANIFEST_DIR")).join("data-samples").join(sample);
        let made = folder.path().join(sample);
        skysweep().arg("simulate").arg(kept.join("scene.toml")).arg("-o").arg(&made).assert().code(0);
        let records = [&made, &kept].map(|scene| json(&scene.join("scene.json")));
        for key in ["config", "epsg", "origin_m", "buildings", "trees"] {
            assert_eq!(records[0][key], records[1][key], "{sample}: {key}");
        }
        for name in ["truth/dsm.tif", "truth/dtm.tif"] {
            assert!(cells(&made.join(name)) == cells(&kept.join(name)), "{sample}/{name} differs");
        }
    }
}

#[test]
fn a_scene_goes_through_dsm_and_eval() {
    let folder = tempfile::tempdir().unwrap();
    let (scene, out) = (folder.path().join("s"), folder.path().join("d"));
    skysweep()
        .args(["simulate", "town", "--size", "120", "-o"])
        .arg(&scene)
        .args(["--progress", "none"])
        .assert()
        .code(0);
    let views = [1, 2, 3].map(|k| scene.join(format!("view_{k}.tif")));
    skysweep().arg("dsm").args(views).arg("-o").arg(&out).arg("-q").assert().code(0);
    let evaluation = skysweep()
        .arg("eval")
        .arg(out.join("dsm/dsm.tif"))
        .arg(scene.join("truth/dsm.tif"))
        .args(["--align", "xyz", "--json", "--buildings"])
        .arg(scene.join("truth/buildings.tif"))
        .output()
        .unwrap();
    let evaluation: Value = serde_json::from_slice(&evaluation.stdout).unwrap();
    let completeness = evaluation["metrics"]["completeness_1"].as_f64().unwrap();
    assert!(completeness > 0.6, "completeness {completeness}");
    // What the run says about its cells lies beside the surface.
    let at = |pointer: &str| evaluation.pointer(pointer).and_then(Value::as_f64);
    assert!(at("/origins/observed/metrics/valid_ratio") > Some(0.5), "{}", evaluation["origins"]);
    assert!(at("/sigma/observed/n") > Some(1000.0) && at("/reliability/tenths/9/to") == Some(1.0));
    assert!(
        at("/objects/buildings") > Some(3.0) && at("/outlines/median_cells").is_some(),
        "{}",
        evaluation["objects"]
    );
}

#[test]
fn a_template_is_a_parameter_file_and_presets_are_listed() {
    let listed = skysweep().args(["simulate", "--list"]).output().unwrap();
    let listed = String::from_utf8(listed.stdout).unwrap();
    let names: Vec<&str> = listed.lines().filter_map(|line| line.split_whitespace().next()).collect();
    assert_eq!(names.len(), 12);
    let folder = tempfile::tempdir().unwrap();
    for name in names {
        let template = skysweep().args(["simulate", name, "--template", "--dates", "2"]).output().unwrap();
        let file = folder.path().join("scene.toml");
        std::fs::write(&file, &template.stdout).unwrap();
        let again = skysweep().arg("simulate").arg(&file).arg("--template").output().unwrap();
        assert!(!template.stdout.is_empty() && template.stdout == again.stdout, "{name}");
    }
    let seasons = ["simulate", "suburb", "--template", "--seasons", "--views", "4"];
    let text = String::from_utf8(skysweep().args(seasons).output().unwrap().stdout).unwrap();
    for line in ["dates = 4", "[seasons]", "crowns = \"natural\"", "texture_share"] {
        assert!(text.contains(line), "{line} in {text}");
    }
    let fewer = skysweep().args(seasons).args(["--dates", "2"]).output().unwrap();
    assert!(String::from_utf8(fewer.stdout).unwrap().contains("dates = 2"));
}

#[test]
fn an_earlier_output_is_kept_unless_told_otherwise() {
    let folder = tempfile::tempdir().unwrap();
    std::fs::write(folder.path().join("mine.txt"), "kept").unwrap();
    let refused = predicate::str::contains("--overwrite");
    skysweep().args(SMALL).arg("-o").arg(folder.path()).assert().code(2).stderr(refused);
    skysweep().args(SMALL).arg("--overwrite").arg("-o").arg(folder.path()).assert().code(0);
    skysweep().args(SMALL).arg("--overwrite").arg("-o").arg(folder.path()).assert().code(0);
    assert_eq!(std::fs::read_to_string(folder.path().join("mine.txt")).unwrap(), "kept");
}

#[test]
fn bad_requests_name_what_is_wrong_and_write_nothing() {
    let folder = tempfile::tempdir().unwrap();
    let output = folder.path().join("out");
    let file = folder.path().join("scene.toml");
    std::fs::write(&file, "[terrain]\nsteepness = 3\n").unwrap();
    let file = file.to_str().unwrap();
    for (arguments, named) in [
        (vec!["town", "--size", "1e9"], "size"),
        (vec!["town", "--views", "1"], "views"),
        (vec!["town", "--gsd", "nan"], "sampling"),
        (vec!["town", "--dates", "9"], "dates"),
        (vec!["village"], "high-rise"),
        (vec![file], "steepness"),
        (vec!["missing.toml"], "missing.toml"),
    ] {
        let refused = predicate::str::contains(named);
        skysweep().arg("simulate").args(arguments).arg("-o").arg(&output).assert().code(2).stderr(refused);
        assert!(!output.exists());
    }
}

#[test]
fn a_flight_sees_the_buildings_and_its_points_lie_on_them() {
    let folder = tempfile::tempdir().unwrap();
    let flight = ["--flight", "5", "--flight-arc", "120", "240", "-o"];
    skysweep().args(SMALL).args(flight).arg(folder.path()).assert().code(0);
    let (model, points) = formats::colmap::read_with_points(&folder.path().join("cameras/sparse/0")).unwrap();
    assert_eq!((model.views.len(), model.views[4].name.as_str()), (5, "flight_05.png"));
    let record = json(&folder.path().join("scene.json"));
    let middle = [0, 1].map(|i| record["origin_m"][i].as_f64().unwrap());
    for view in &model.views {
        let ground = record["height_range_m"][0].as_f64().unwrap();
        let [x, y, z] = view.pose.camera_from_world([middle[0], middle[1], ground]);
        // The middle of the scene, at its ground, is near the middle of every image.
        assert!(z > 30.0 && (x / z).abs() < 0.1 && (y / z).abs() < 0.2, "{:?}", [x / z, y / z, z]);
        assert!(view.pose.centre[1] < middle[1], "the arc is in the south");
        let picture =
            formats::raster::ImageSource::open(folder.path().join("cameras/images").join(&view.name)).unwrap();
        let pixels = picture.read_colour(picture.window()).unwrap();
        assert_eq!((pixels.width(), pixels.height()), (640, 480));
        let values: Vec<f32> = pixels.data().iter().map(|p| p[0]).collect();
        let spread = |share: usize| {
            let mut sorted = values.clone();
            sorted.sort_by(f32::total_cmp);
            sorted[sorted.len() * share / 100]
        };
        assert!(spread(90) - spread(10) > 40.0, "{} {}", spread(10), spread(90));
    }
    assert!(points.len() > 500, "{}", points.len());
    // The points of a reconstruction lie near the exact surface.
    let near = |name: &str| {
        let truth =
            cityfiles::surfaces::read(folder.path().join("truth").join(name), &city::MeshConfig::default()).unwrap();
        let distance = |p: &[f64; 3], q: &[f64; 3]| (0..3).map(|i| (p[i] - q[i]).powi(2)).sum::<f64>().sqrt();
        let closest = |p: &[f64; 3]| truth.positions.iter().map(|q| distance(p, q)).fold(f64::INFINITY, f64::min);
        let mut distances: Vec<f64> = points.iter().step_by(20).map(|p| closest(&p.position)).collect();
        distances.sort_by(f64::total_cmp);
        (distances[distances.len() / 2], distances[distances.len() * 9 / 10])
    };
    let (median, most) = near("flight_surface.ply");
    assert!(median < 0.2 && most < 0.5, "{median} {most}");
    assert!(near("flight_buildings.ply").1 > most, "buildings are a part of the surface");
    for (setting, named) in [
        (&["--flight-arc", "0", "400"][..], "arc of the flight is 400"),
        (&["--flight-spacing", "0"], "spacing of the exact surface is 0"),
    ] {
        let mut command = skysweep();
        command.args(SMALL).args(["--flight", "2"]).args(setting).arg("-o").arg(folder.path().join("x"));
        command.assert().code(2).stderr(predicate::str::contains(named));
    }
}
