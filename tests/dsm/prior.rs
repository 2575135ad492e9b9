//! `skysweep dsm --prior`: a city model that is right helps, and one that is wrong does no harm.

use std::path::{Path, PathBuf};
use std::sync::LazyLock;

use predicates::prelude::*;
use serde_json::{Value, json};

use crate::common::{sample, skysweep};

/// Class of roofs in the class raster.
const ROOF: &str = "6";
/// Place of the wrong building: an open place of the town, EPSG:32631, and its ground, metres above
/// the ellipsoid.
const OPEN_PLACE: [f64; 3] = [693_830.5, 4_822_578.5, 182.3];
/// Half the side of a square around the wrong building, metres.
const HALF_M: f64 = 10.0;

/// The town's surface model without a prior, made once.
static WITHOUT: LazyLock<PathBuf> =
    LazyLock::new(|| surface(Path::new(env!("CARGO_TARGET_TMPDIR")), "dsm_prior_without", None));

/// Makes the town's surface model with a prior or without; returns its file.
fn surface(folder: &Path, name: &str, prior: Option<&Path>) -> PathBuf {
    let out = folder.join(name);
    let mut command = skysweep();
    command
        .arg("dsm")
        .args(["view_1.tif", "view_2.tif", "view_3.tif"].map(sample))
        .args(["-q", "--overwrite", "-o"])
        .arg(&out);
    if let Some(path) = prior {
        command.arg("--prior").arg(path);
    }
    command.assert().code(0);
    out.join("dsm/dsm.tif")
}

fn evaluation(dsm: &Path) -> Value {
    let mut command = skysweep();
    command.arg("eval").arg(dsm).arg(sample("truth/dsm.tif")).args(["--align", "xyz", "--json", "--classes"]);
    let output = command.arg(sample("truth/classes.tif")).assert().code(0).get_output().stdout.clone();
    serde_json::from_slice(&output).unwrap()
}

fn mae(evaluation: &Value, path: &str) -> f64 {
    evaluation.pointer(path).and_then(Value::as_f64).unwrap_or_else(|| panic!("{path} is missing: {evaluation}"))
}

/// Collects every vertex index of nested boundaries.
fn indices(boundaries: &Value, found: &mut Vec<usize>) {
    match boundaries {
        Value::Array(parts) => parts.iter().for_each(|part| indices(part, found)),
        other => found.extend(other.as_u64().map(|i| i as usize)),
    }
}

fn moved(boundaries: &Value, by: usize) -> Value {
    match boundaries {
        Value::Array(parts) => parts.iter().map(|part| moved(part, by)).collect(),
        other => json!(other.as_u64().unwrap() as usize + by),
    }
}

/// Writes the town's model without its largest building and with a copy of another one in an open
/// place.
fn wrong_model(path: &Path) {
    let mut model: Value =
        serde_json::from_slice(&std::fs::read(sample("truth/buildings.city.json")).unwrap()).unwrap();
    let numbers =
        |value: &Value| -> Vec<f64> { value.as_array().unwrap().iter().map(|v| v.as_f64().unwrap()).collect() };
    let (scale, start) = (numbers(&model["transform"]["scale"]), numbers(&model["transform"]["translate"]));
    let vertices: Vec<Vec<f64>> = model["vertices"].as_array().unwrap().iter().map(numbers).collect();
    let extent = |object: &Value| {
        let mut used = Vec::new();
        indices(&object["geometry"][0]["boundaries"], &mut used);
        let along = |axis: usize| used.iter().map(|&i| vertices[i][axis]).collect::<Vec<_>>();
        [0, 1, 2].map(|axis| {
            let all = along(axis);
            let (lo, hi) = all.iter().fold((f64::MAX, f64::MIN), |a, v| (a.0.min(*v), a.1.max(*v)));
            (lo * scale[axis] + start[axis], (hi - lo) * scale[axis])
        })
    };
    let objects = model["CityObjects"].as_object().unwrap().clone();
    let largest = |most_m: f64| {
        let sides = |object: &Value| [0, 1].map(|axis| extent(object)[axis].1);
        let whole = objects.iter().filter(|(_, object)| object.pointer("/geometry/0").is_some());
        let fits = whole.filter(|(_, object)| sides(object).iter().all(|side| *side < most_m));
        fits.max_by(|a, b| (sides(a.1)[0] * sides(a.1)[1]).total_cmp(&(sides(b.1)[0] * sides(b.1)[1]))).unwrap()
    };
    let (gone, _) = largest(f64::MAX);
    let (_, copied) = largest(2.0 * HALF_M - 2.0);
    let place = extent(copied);
    let lowest = [OPEN_PLACE[0] - 0.5 * place[0].1, OPEN_PLACE[1] - 0.5 * place[1].1, OPEN_PLACE[2]];
    let by: Vec<f64> = (0..3).map(|axis| ((lowest[axis] - place[axis].0) / scale[axis]).round()).collect();
    let mut extra = copied.clone();
    extra["geometry"][0]["boundaries"] = moved(&copied["geometry"][0]["boundaries"], vertices.len());
    let copies = vertices.iter().map(|v| json!((0..3).map(|axis| (v[axis] + by[axis]) as i64).collect::<Vec<_>>()));
    model["vertices"].as_array_mut().unwrap().extend(copies);
    let all = model["CityObjects"].as_object_mut().unwrap();
    all.remove(gone);
    all.insert("not-there".to_owned(), extra);
    std::fs::write(path, serde_json::to_vec(&model).unwrap()).unwrap();
}

/// Writes the town's model with every other building, or every one, too high or too low by 4 to
/// 7 m: a building keeps its walls' feet.
fn model_with_wrong_heights(path: &Path, every: usize) -> usize {
    let mut model: Value =
        serde_json::from_slice(&std::fs::read(sample("truth/buildings.city.json")).unwrap()).unwrap();
    let scale = model["transform"]["scale"][2].as_f64().unwrap();
    let mut vertices = model["vertices"].as_array().unwrap().clone();
    let mut wrong = 0;
    for (number, object) in model["CityObjects"].as_object().unwrap().values().enumerate() {
        let mut used = Vec::new();
        object["geometry"].as_array().into_iter().flatten().for_each(|g| indices(&g["boundaries"], &mut used));
        if used.is_empty() || number % every != 0 {
            continue;
        }
        let height = |i: &usize| vertices[*i][2].as_i64().unwrap();
        let (low, by_m) = (used.iter().map(height).min().unwrap(), [4.0, -5.0, 7.0][number / every % 3]);
        used.sort_unstable();
        used.dedup();
        for i in used.into_iter().filter(|i| height(i) as f64 * scale > low as f64 * scale + 0.5).collect::<Vec<_>>() {
            vertices[i][2] = json!(vertices[i][2].as_i64().unwrap() + (by_m / scale) as i64);
        }
        wrong += 1;
    }
    model["vertices"] = json!(vertices);
    std::fs::write(path, serde_json::to_vec(&model).unwrap()).unwrap();
    wrong
}

/// Heights within the square around the open place.
fn heights_in_the_open_place(dsm: &Path) -> Vec<f64> {
    let dem = formats::raster::read_dem(dsm).unwrap();
    let steps = || (0..40).map(|i| -HALF_M + 0.5 * f64::from(i));
    let places = steps().flat_map(|dy| steps().map(move |dx| (OPEN_PLACE[0] + dx, OPEN_PLACE[1] + dy)));
    let cell = |(x, y)| dem.geotransform.cell_from_map(x, y).map(|(c, r)| (c.round() as usize, r.round() as usize));
    places.filter_map(cell).map(|at| f64::from(dem.heights[at])).collect()
}

#[test]
fn a_model_that_lacks_a_building_and_has_one_too_many_still_helps() {
    let folder = tempfile::tempdir().unwrap();
    let model = folder.path().join("wrong.city.json");
    wrong_model(&model);
    let with = surface(folder.path(), "with", Some(model.as_path()));
    let report: Value =
        serde_json::from_slice(&std::fs::read(folder.path().join("with/report/report.json")).unwrap()).unwrap();
    let wrong = report["prior"]["left_out"].as_array().unwrap().iter().find(|b| b["id"] == "not-there").unwrap();
    let number = |name: &str| wrong[name].as_u64().unwrap();
    assert!(number("views") == number("of_views") && number("compared_pixels") > 100, "{wrong}");
    assert!(number("agreeing_pixels") * 10 < number("compared_pixels"), "{wrong}");
    assert!(report["choices"].as_array().unwrap().iter().any(|choice| choice["name"] == "buildings left out"));
    let (before, after) = (evaluation(&WITHOUT), evaluation(&with));
    let roofs = format!("/classes/{ROOF}/mae");
    for (name, path, share) in
        [("all", "/metrics/mae", 0.96), ("roofs", roofs.as_str(), 0.85), ("edges", "/edges/edge/mae", 0.97)]
    {
        let (before, after) = (mae(&before, path), mae(&after, path));
        assert!(after < share * before, "{name}: MAE {before} without, {after} with the prior");
    }
    let (rest, worse) = (mae(&before, "/edges/rest/mae"), mae(&after, "/edges/rest/mae"));
    assert!(worse <= rest, "away from edges the prior costs accuracy: {rest} m without, {worse} m with");
    let (open, beside) = (heights_in_the_open_place(&WITHOUT), heights_in_the_open_place(&with));
    let changed = open.iter().zip(&beside).filter(|(a, b)| (*a - *b).abs() > 1.0).count();
    assert!(changed * 50 < open.len(), "the wrong building shows in {changed} of {} cells", open.len());
}

#[test]
fn buildings_with_wrong_heights_are_refuted_one_by_one_and_cost_nothing() {
    let folder = tempfile::tempdir().unwrap();
    let before = evaluation(&WITHOUT);
    for every in [1, 2] {
        let (name, model) = (format!("every-{every}"), folder.path().join(format!("{every}.city.json")));
        let wrong = model_with_wrong_heights(&model, every);
        let after = evaluation(&surface(folder.path(), &name, Some(&model)));
        let report = std::fs::read(folder.path().join(&name).join("report/report.json")).unwrap();
        let report: Value = serde_json::from_slice(&report).unwrap();
        let (left_out, seen) =
            (report["prior"]["left_out"].as_array().unwrap().len(), &report["prior"]["buildings_seen"]);
        // A third of the wrong heights are wrong by the same amount, so that the model as a whole
        // may be moved by it and they become right.
        let expected = seen.as_u64().unwrap() as usize * 6 / 10 / every;
        assert!(left_out >= expected, "{left_out} buildings are left out, {wrong} of all are wrong, {seen} are seen");
        for path in ["/metrics/mae".to_owned(), format!("/classes/{ROOF}/mae")] {
            let (without, with) = (mae(&before, &path), mae(&after, &path));
            assert!(with < 1.02 * without, "{path}: {without} m without, {with} m with {wrong} wrong buildings");
        }
    }
}

/// A model beside its place in the images is moved there, or its buildings are left out.
#[test]
fn a_model_that_is_ten_metres_off_costs_nothing() {
    let folder = tempfile::tempdir().unwrap();
    let text = std::fs::read(sample("truth/buildings.city.json")).unwrap();
    let mut model: Value = serde_json::from_slice(&text).unwrap();
    let west = &mut model["transform"]["translate"][0];
    *west = json!(west.as_f64().unwrap() - 10.0);
    let path = folder.path().join("shifted.city.json");
    std::fs::write(&path, serde_json::to_vec(&model).unwrap()).unwrap();
    let before = evaluation(&WITHOUT);
    let after = evaluation(&surface(folder.path(), "with", Some(&path)));
    for path in ["/metrics/mae".to_owned(), format!("/classes/{ROOF}/mae")] {
        let (without, with) = (mae(&before, &path), mae(&after, &path));
        assert!(with < 1.02 * without, "{path}: {without} m without, {with} m with the shifted model");
    }
}

#[test]
fn a_prior_that_is_none_is_refused_before_anything_is_written() {
    let folder = tempfile::tempdir().unwrap();
    let out = folder.path().join("out");
    let path = folder.path().join("empty.city.json");
    let nothing = json!({ "type": "CityJSON", "version": "2.0", "CityObjects": {}, "vertices": [],
        "transform": { "scale": [0.001, 0.001, 0.001], "translate": [0.0, 0.0, 0.0] } });
    std::fs::write(&path, nothing.to_string()).unwrap();
    let mut command = skysweep();
    command.arg("dsm").args(["view_1.tif", "view_3.tif"].map(sample)).args(["--gsd", "1", "-q", "-o"]).arg(&out);
    command.arg("--prior").arg(&path);
    command.assert().code(2).stderr(predicate::str::contains("empty.city.json"));
    assert!(!out.exists());
}

/// A model of another place is no help, and is said to be none.
#[test]
fn a_model_of_another_place_is_named_with_both_extents() {
    let folder = tempfile::tempdir().unwrap();
    let (path, out) = (folder.path().join("away.city.json"), folder.path().join("out"));
    let mut model: Value =
        serde_json::from_slice(&std::fs::read(sample("truth/buildings.city.json")).unwrap()).unwrap();
    let east = model["transform"]["translate"][0].as_f64().unwrap();
    model["transform"]["translate"][0] = json!(east + 3000.0);
    std::fs::write(&path, model.to_string()).unwrap();
    let mut command = skysweep();
    command.arg("dsm").args(["view_1.tif", "view_3.tif"].map(sample)).args(["--gsd", "2", "--preset", "fast", "-o"]);
    let warned = predicate::str::contains("no building of the city model stands in the scene")
        .and(predicate::str::contains("the model covers [69"))
        .and(predicate::str::contains("away.city.json"));
    command.arg(&out).arg("--prior").arg(&path).assert().code(0).stderr(warned);
    let report: Value = serde_json::from_slice(&std::fs::read(out.join("report/report.json")).unwrap()).unwrap();
    let warnings = report["warnings"].as_array().unwrap();
    assert!(warnings.iter().any(|text| text.as_str().unwrap().contains("away.city.json")), "{warnings:?}");
}
