//! `skysweep batch`: scenes that fail do not stop the others, and a batch that is killed again and
//! again ends with the bytes of one that was left alone.

use std::collections::BTreeMap;
use std::fmt::Write as _;
use std::path::{Path, PathBuf};
use std::process::{Command, Stdio};
use std::time::Duration;

use crate::common::{band, sample, skysweep};
use numeric::RandomByIndex;
use serde_json::Value;

/// Files that a complete batch has among others.
const PRODUCTS: [&str; 11] = [
    "both/dsm/dsm.tif",
    "both/dsm/source.tif",
    "both/dsm/relief.png",
    "both/used_config.toml",
    "both/ortho/ortho.tif",
    "both/ortho/ortho_mask.tif",
    "both/priors/report.html",
    "chunks/dsm/dsm.tif",
    "chunks/dsm/confidence.tif",
    "chunks/used_config.toml",
    "chunks/heightmap.tif",
];

/// Code of masked cells in `dsm/source.tif`.
const MASKED: f32 = 13.0;
/// Side of the small scenes, metres.
const PART_M: f64 = 100.0;

/// A batch file whose results go to `night`: seven scenes that can be computed and three that
/// cannot. The variable `TOWN` names the folder of the images.
fn batch_file(folder: &Path) -> PathBuf {
    let town = sample("");
    let file = folder.join("batch.toml");
    let mut text = format!(
        "output = 'night'\n\
         [limits]\nparallel = 2\nthreads = 2\n\
         [defaults]\ntasks = ['dsm']\ndsm = {{ gsd_m = 2.0, preset = 'fast' }}\n\
         [[scene]]\nname = 'both'\nimages = ['{town}/view_[13].tif']\ntasks = ['dsm', 'ortho', 'eval', 'priors']\n\
         area = {{ file = 'areas.geojson', name = 'middle' }}\n\
         eval.reference = '{town}/truth/dsm.tif'\npriors = {{ model = '{town}/truth/buildings.city.json' }}\n\
         [[scene]]\nname = 'no_rpc'\nimages = ['{town}/view_1.tif', 'plain.png']\ntasks = ['dsm', 'ortho']\n\
         [[scene]]\nname = 'corrupt'\nimages = ['{town}/view_1.tif', 'corrupt.tif']\n\
         [[scene]]\nname = 'apart'\nimages = ['{town}/view_1.tif', 'far.tif']\n\
         [[scene]]\nname = 'chunks'\nimages = ['{town}/view_1.tif', '{town}/view_3.tif']\ntasks = ['heightmap', 'dsm']\n\
         dsm.chunk = 128\nheightmap.stand = {{ source = {{ position = {{ lon_deg = 5.4, lat_deg = 43.53 }} }} }}\n",
        town = town.display()
    );
    for part in 0..5 {
        let (x, y) = (693_760.0 + 110.0 * f64::from(part % 3), 4_822_280.0 + 120.0 * f64::from(part / 3));
        write!(
            text,
            "[[scene]]\nname = 'part {part}'\nimages = ['${{TOWN}}/view_[13].tif']\n\
             bounds = [{x:.1}, {y:.1}, {:.1}, {:.1}]\ndsm.masks = ['water.geojson']\n",
            x + PART_M,
            y + PART_M
        )
        .unwrap();
    }
    std::fs::write(&file, text).unwrap();
    file
}

/// Writes a rectangle of longitudes and latitudes as GeoJSON.
fn write_area(path: &Path, [west, south, east, north]: [f64; 4]) {
    let polygon = format!("[[[{west},{south}],[{east},{south}],[{east},{north}],[{west},{north}],[{west},{south}]]]");
    let geometry = format!("{{\"type\":\"Polygon\",\"coordinates\":{polygon}}}");
    let feature = format!("{{\"type\":\"Feature\",\"properties\":{{\"name\":\"middle\"}},\"geometry\":{geometry}}}");
    std::fs::write(path, format!("{{\"type\":\"FeatureCollection\",\"features\":[{feature}]}}")).unwrap();
}

/// Writes the images that cannot be used, the area of a scene, and the water of others.
fn inputs(folder: &Path) {
    write_area(&folder.join("areas.geojson"), [5.398, 43.528, 5.402, 43.531]);
    let map = crs::MapProjection::from_epsg(32631).unwrap();
    let (west, south) = map.lonlat_from_map(693_900.0, 4_822_430.0).unwrap();
    write_area(&folder.join("water.geojson"), [west, south, west + 4e-4, south + 3e-4]);
    formats::raster::write_png_gray(folder.join("plain.png"), &raster::Grid::filled(64, 64, 7), false).unwrap();
    let bytes = std::fs::read(sample("view_2.tif")).unwrap();
    std::fs::write(folder.join("corrupt.tif"), &bytes[..bytes.len() / 2]).unwrap();
    let mut rpc = formats::rpc::read_for_image(&sample("view_3.tif")).unwrap().rpc;
    rpc.long_off += 0.5;
    let pixels = raster::Grid::filled(722, 752, 100u16);
    let bands = [formats::raster::Band { description: "pan", data: formats::raster::BandData::U16(&pixels) }];
    formats::raster::write_image_with_rpc(folder.join("far.tif"), &bands, &rpc, None, false).unwrap();
}

/// Runs a batch to its end and returns its report.
#[track_caller]
fn run(file: &Path, code: i32) -> Value {
    let assert = skysweep().env("TOWN", sample("")).arg("batch").arg(file).args(["-q", "--json"]).assert().code(code);
    serde_json::from_slice(&assert.get_output().stdout).unwrap()
}

/// State and reason of the tasks of a report: (scene, task, state, reason).
fn states(report: &Value) -> Vec<(String, String, String, String)> {
    let text = |value: &Value| value.as_str().unwrap_or_default().to_owned();
    let scenes = report["scenes"].as_array().unwrap().iter();
    let of_scene = |scene: &Value| -> Vec<_> {
        let tasks = scene["tasks"].as_array().unwrap().iter();
        let state =
            |task: &Value| (text(&scene["name"]), text(&task["task"]), text(&task["state"]), text(&task["reason"]));
        tasks.map(state).collect()
    };
    scenes.flat_map(of_scene).collect()
}

/// Times and warnings of the tasks that are complete, by scene and task.
fn courses(report: &Value) -> BTreeMap<String, (f64, Vec<String>)> {
    let mut found = BTreeMap::new();
    for scene in report["scenes"].as_array().unwrap() {
        for task in scene["tasks"].as_array().unwrap() {
            if task["state"] == "done" || task["state"] == "done_before" {
                let warnings = task["warnings"].as_array().into_iter().flatten();
                let warnings = warnings.map(|warning| warning.as_str().unwrap().to_owned()).collect();
                let name = format!("{} {}", scene["name"], task["task"]);
                found.insert(name, (task["seconds"].as_f64().unwrap(), warnings));
            }
        }
    }
    found
}

/// Truncates, changes and deletes products of a batch that is done, and runs it again.
fn damaged_products_are_made_again(file: &Path, night: &Path, expected: &BTreeMap<PathBuf, Vec<u8>>) {
    let damage = |name: &str, change: &dyn Fn(&mut Vec<u8>)| {
        let path = night.join(name);
        let mut bytes = std::fs::read(&path).unwrap();
        change(&mut bytes);
        std::fs::write(&path, bytes).unwrap();
    };
    damage("part 0/dsm/dsm.tif", &|bytes| bytes.truncate(bytes.len() / 2));
    damage("part 1/dsm/source.tif", &|bytes| bytes.last_mut().into_iter().for_each(|last| *last ^= 1));
    damage("part 2/report/report.html", &Vec::clear);
    damage("chunks/heightmap.tif", &|bytes| bytes[1000] ^= 1);
    for gone in ["part 3/dsm/dsm.tif", "part 4/stac/item.json", "both/eval/report.html", "both/ortho/ortho_mask.tif"] {
        std::fs::remove_file(night.join(gone)).unwrap();
    }
    let report = run(file, 1);
    let states = states(&report);
    let again: Vec<_> = states.iter().filter(|s| s.2 == "done").map(|s| format!("{} {}", s.0, s.1)).collect();
    let wanted =
        ["both ortho", "both eval", "chunks heightmap", "part 0 dsm", "part 1 dsm", "part 2 dsm", "part 3 dsm"];
    assert_eq!(again, [&wanted[..], &["part 4 dsm"]].concat(), "{report}");
    assert_eq!(states.iter().filter(|s| s.2 == "done_before").count(), 3, "{report}");
    assert!(products(night) == *expected && night.join("both/eval/report.html").is_file());
}

/// Names and contents of all files of a batch but those that hold times.
fn products(output: &Path) -> BTreeMap<PathBuf, Vec<u8>> {
    let mut found = BTreeMap::new();
    let mut folders = vec![output.to_owned()];
    while let Some(folder) = folders.pop() {
        for path in std::fs::read_dir(folder).unwrap().map(|entry| entry.unwrap().path()) {
            let name = path.file_name().unwrap().to_string_lossy().into_owned();
            // A height map names the state of its source's file.
            let has_times = name.contains("report.") || name == "plan.json" || name == "heightmap.tif";
            // Logs, and items of STAC, tell the time.
            if path.is_dir() && name != "tasks" && name != "stac" {
                folders.push(path);
            } else if path.is_file() && !has_times {
                let inside = path.strip_prefix(output).unwrap().to_owned();
                found.insert(inside, std::fs::read(path).unwrap());
            }
        }
    }
    found
}

/// Names of files and folders that a killed run could have left.
fn temporary(folder: &Path) -> Vec<PathBuf> {
    let mut found = Vec::new();
    for path in std::fs::read_dir(folder).unwrap().map(|entry| entry.unwrap().path()) {
        let name = path.file_name().unwrap().to_string_lossy().into_owned();
        if path.is_dir() {
            found.extend(temporary(&path));
        }
        if name.starts_with('.') || name.ends_with(".partial") || name == "chunks" && path.join("0000").exists() {
            found.push(path);
        }
    }
    found
}

#[test]
fn killed_again_and_again_a_batch_ends_as_if_it_had_been_left_alone() {
    let folder = tempfile::tempdir().unwrap();
    inputs(folder.path());
    let file = batch_file(folder.path());
    let report = run(&file, 1);
    let expected = [
        ("both", "dsm", "done", ""),
        ("both", "ortho", "done", ""),
        ("both", "eval", "done", ""),
        ("both", "priors", "done", ""),
        ("no_rpc", "dsm", "failed", "no usable RPC"),
        ("no_rpc", "ortho", "not_begun", "no surface model"),
        ("corrupt", "dsm", "failed", "corrupt.tif"),
        ("apart", "dsm", "failed", "share no ground"),
        ("chunks", "dsm", "done", ""),
        ("chunks", "heightmap", "done", ""),
        ("part 0", "dsm", "done", ""),
        ("part 1", "dsm", "done", ""),
        ("part 2", "dsm", "done", ""),
        ("part 3", "dsm", "done", ""),
        ("part 4", "dsm", "done", ""),
    ];
    let check = |report: &Value| {
        let states = states(report);
        assert_eq!(states.len(), expected.len(), "{report}");
        for ((scene, task, state, reason), wanted) in states.iter().zip(expected) {
            let is_state = state == wanted.2 || wanted.2 == "done" && state == "done_before";
            assert!(
                (scene.as_str(), task.as_str()) == (wanted.0, wanted.1) && is_state,
                "{scene} {task} {state}: {reason}"
            );
            assert!(reason.contains(wanted.3), "{scene} {task}: {reason}");
        }
    };
    check(&report);
    let night = folder.path().join("night");
    let expected_bytes = products(&night);
    assert!(PRODUCTS.iter().all(|name| night.join(name).is_file()));
    assert!(night.join("both/eval/report.html").is_file() && night.join("both/tasks/dsm.jsonl").is_file());
    let source = band(&night.join("part 4/dsm/source.tif"), 1);
    let masked = source.data().iter().filter(|code| **code == MASKED).count();
    assert!((50..400).contains(&masked), "{masked} cells of 2 m under a mask of 32 × 33 m");
    let page = std::fs::read_to_string(night.join("batch_report.html")).unwrap();
    assert!(page.contains("share no ground"), "{page}");
    // The corner of the area. A polygon of longitudes and latitudes is not level on the map.
    let dsm = formats::raster::read_dem(night.join("both/dsm/dsm.tif")).unwrap();
    let corner = crs::MapProjection::from_epsg(32631).unwrap().map_from_lonlat(5.398, 43.531).unwrap();
    let (x, y) = dsm.geotransform.map_from_cell(-0.5, -0.5);
    assert!((x - corner.x).abs() < 15.0 && (y - corner.y).abs() < 15.0, "{x} {y} {corner:?}");
    // Once more: what is complete is left alone.
    let again = run(&file, 1);
    assert_eq!(states(&again).iter().filter(|state| state.2 == "done_before").count(), 11, "{again}");
    let courses = courses(&report);
    assert!(courses.values().any(|(_, warnings)| !warnings.is_empty()), "{report}");
    assert_eq!(self::courses(&again), courses, "times and warnings are those of the run that did the task");
    damaged_products_are_made_again(&file, &night, &expected_bytes);

    std::fs::remove_dir_all(&night).unwrap();
    let moments = RandomByIndex::new(18, 1);
    for kill in 0..10 {
        let mut command = Command::new(assert_cmd::cargo::cargo_bin("skysweep"));
        let mut batch = command
            .env("TOWN", sample(""))
            .arg("batch")
            .arg(&file)
            .arg("-q")
            .stderr(Stdio::null())
            .stdout(Stdio::null())
            .spawn()
            .unwrap();
        // The result does not depend on the moment.
        std::thread::sleep(Duration::from_millis(20 + (1500.0 * moments.uniform(kill)) as u64));
        // It may have ended by itself.
        let _ = batch.kill();
        batch.wait().unwrap();
    }
    let report = run(&file, 1);
    check(&report);
    let found = products(&night);
    let other: Vec<_> =
        expected_bytes.iter().filter(|(name, bytes)| found.get(*name) != Some(bytes)).map(|(name, _)| name).collect();
    assert!(other.is_empty() && found.len() == expected_bytes.len(), "other bytes: {other:?}");
    assert!(temporary(&night).is_empty(), "{:?}", temporary(&night));
    // A changed setting is noticed, in its scene only.
    let text = std::fs::read_to_string(&file).unwrap();
    std::fs::write(&file, text.replace("dsm.chunk = 128", "dsm.chunk = 150")).unwrap();
    let report = run(&file, 1);
    let states = states(&report);
    let of = |scene: &str, task: &str| states.iter().find(|s| s.0 == scene && s.1 == task).unwrap().2.clone();
    assert_eq!([of("both", "dsm"), of("chunks", "dsm")], ["done_before", "done"]);
}

/// Products, change and one scene at a time: what a dry run announces is what a run does, and the
/// page shows it.
#[test]
fn a_dry_run_says_what_is_done_and_one_scene_is_worked_on() {
    let folder = tempfile::tempdir().unwrap();
    let (file, night) = (folder.path().join("batch.toml"), folder.path().join("night"));
    let town = sample("");
    let text = format!(
        "output = 'night'\n[defaults]\ndsm = {{ gsd_m = 2.0, preset = 'fast' }}\n\
         products = {{ products = ['contours'] }}\n\
         [[scene]]\nname = 'one two'\nimages = ['{0}/view_1.tif', '{0}/view_3.tif']\n\
         tasks = ['dsm', 'eval', 'dtm', 'classes', 'products', 'diff']\n\
         bounds = [693812.0, 4822332.0, 693992.0, 4822512.0]\n\
         eval.reference = '{0}/truth/dsm.tif'\ndiff = {{ before = '{0}/truth/dsm.tif', sigma_m = 0.3 }}\n\
         [[scene]]\nname = 'lost'\nimages = ['{0}/view_9*.tif']\n",
        town.display()
    );
    std::fs::write(&file, &text).unwrap();
    let batch = |arguments: &[&str], code: i32| -> Value {
        let mut command = skysweep();
        let assert = command.arg("batch").arg(&file).args(["-q", "--json"]).args(arguments).assert().code(code);
        serde_json::from_slice(&assert.get_output().stdout).unwrap()
    };
    let of =
        |report: &Value| states(report).into_iter().map(|s| format!("{} {} {}", s.0, s.1, s.2)).collect::<Vec<_>>();
    let tasks = ["dsm", "eval", "dtm", "classes", "products", "diff"];
    let with = |state: &str| tasks.map(|task| format!("one two {task} {state}"));
    let looked = batch(&["--dry-run"], 1);
    assert_eq!(of(&looked), [&with("to_do")[..], &["lost dsm failed".to_owned()]].concat(), "{looked}");
    assert!(states(&looked)[6].3.contains("no file matches the pattern"), "{looked}");
    assert!(!night.exists(), "a dry run writes nothing");
    batch(&["--dry-run", "--only", "one two"], 0);
    let refused = skysweep().arg("batch").arg(&file).args(["--only", "two"]).assert().code(2);
    let told = String::from_utf8_lossy(&refused.get_output().stderr).into_owned();
    assert!(told.contains("no scene \"two\"; there are one two, lost"), "{told}");

    let done = batch(&["--only", "one two"], 0);
    assert_eq!(of(&done), [&with("done")[..], &["lost dsm not_begun".to_owned()]].concat(), "{done}");
    assert_eq!((&done["scenes"][1]["left_out"], &done["incomplete"]), (&Value::Bool(true), &0.into()));
    let again = batch(&["--dry-run", "--only", "one two"], 0);
    assert_eq!(of(&again)[..6], with("done_before"), "{again}");
    let page = std::fs::read_to_string(night.join("batch_report.html")).unwrap();
    let targets: Vec<&str> = page.split("<a href=\"").skip(1).filter_map(|rest| rest.split('"').next()).collect();
    for result in
        ["report/report.html", "dtm/dtm.html", "classes/classes.html", "products/products.html", "diff/diff.html"]
    {
        assert!(targets.contains(&format!("./one%20two/{result}").as_str()), "{result} of {targets:?}");
    }
    for target in targets {
        assert!(night.join(target.replace("%20", " ")).exists(), "{target}");
    }
    let errors: Value =
        serde_json::from_slice(&std::fs::read(night.join("one two/eval/report.json")).unwrap()).unwrap();
    let mae = report::sensible(errors["metrics"]["mae"].as_f64().unwrap(), "m");
    assert!(
        page.contains(&format!("<td>{mae} m</td>")) && page.contains("class=\"thumb\""),
        "{mae} is not on the page"
    );
    // Products made by hand of a scene of a batch leave its pages as the batch knows them.
    skysweep()
        .arg("products")
        .arg(night.join("one two"))
        .args(["--only", "contours", "--overwrite", "-q"])
        .assert()
        .code(0);
    assert_eq!(of(&batch(&["--dry-run", "--only", "one two"], 0))[0], "one two dsm done_before");

    // A surface model that is to be made again takes what rests on it along.
    std::fs::write(&file, text.replace("gsd_m = 2.0", "gsd_m = 2.5")).unwrap();
    assert_eq!(of(&batch(&["--dry-run", "--only", "one two"], 0))[..6], with("to_do"));
    std::fs::write(&file, text.replace("preset = 'fast'", "products = ['dtm']")).unwrap();
    let refused = skysweep().arg("batch").arg(&file).arg("--dry-run").assert().code(2);
    let told = String::from_utf8_lossy(&refused.get_output().stderr).into_owned();
    assert!(told.contains("which write the same folder"), "{told}");
}

/// The template of a study becomes a page with a picture and the errors of each way.
#[test]
fn a_study_compares_settings_on_a_patch() {
    let folder = tempfile::tempdir().unwrap();
    let file = folder.path().join("study.toml");
    let template = String::from_utf8(skysweep().args(["template", "study"]).output().unwrap().stdout).unwrap();
    let town = sample("").display().to_string();
    let study = template
        .replace("images/*.tif", &format!("{town}/view_[13].tif"))
        .replace("693000.0, 4822000.0, 693400.0, 4822400.0", "693812.0, 4822332.0, 693912.0, 4822432.0")
        .replace("\"reference.tif\"", &format!("\"{town}/truth/dsm.tif\""))
        .replace("# gsd_m = 0.5", "gsd_m = 1.0");
    std::fs::write(&file, study).unwrap();
    let states = states(&run(&file, 0));
    assert_eq!(states.len(), 8, "{states:?}");
    assert!(states.iter().all(|(_, _, state, _)| state == "done"), "{states:?}");
    let page = std::fs::read_to_string(folder.path().join("study/batch_report.html")).unwrap();
    for name in ["fast", "balanced", "accurate", "balanced-measured-only"] {
        assert!(page.contains(name), "{name}");
    }
    assert!(page.matches("<img").count() >= 4, "each way has a picture");
}

/// A batch replaces what an earlier run of it made, and nothing else.
#[test]
fn results_that_the_batch_did_not_make_stay() {
    let folder = tempfile::tempdir().unwrap();
    let file = folder.path().join("batch.toml");
    for (task, foreign) in
        [("dsm", "dsm/dsm.tif"), ("dsm", "dsm/relief.png"), ("dsm", "plan.json"), ("ortho", "ortho/ortho_mask.tif")]
    {
        let text = format!(
            "output = 'out'\n[[scene]]\nname = 'a'\nimages = ['{0}/view_1.tif', '{0}/view_3.tif']\ntasks = ['{task}']\n",
            sample("").display()
        );
        std::fs::write(&file, text).unwrap();
        let place = folder.path().join("out/a").join(foreign);
        std::fs::create_dir_all(place.parent().unwrap()).unwrap();
        std::fs::write(&place, "precious").unwrap();
        let report = run(&file, 1);
        let state = states(&report).remove(0);
        assert!(
            state.2 == "failed" && state.3.contains("the batch did not make") && state.3.contains(foreign),
            "{state:?}"
        );
        assert_eq!(std::fs::read_to_string(&place).unwrap(), "precious");
        std::fs::remove_dir_all(folder.path().join("out")).unwrap();
    }
}

/// The automatic report of an evaluation may be missing; that of a task may not.
#[test]
fn a_task_that_cannot_write_its_result_is_failed() {
    let folder = tempfile::tempdir().unwrap();
    let file = folder.path().join("batch.toml");
    let town = sample("");
    let text = format!(
        "output = 'out'\n[[scene]]\nname = 'a'\nimages = ['{0}/view_1.tif', '{0}/view_3.tif']\ntasks = ['dsm', 'eval']\n\
         bounds = [693812.0, 4822332.0, 693912.0, 4822432.0]\ndsm = {{ gsd_m = 2.0, preset = 'fast' }}\n\
         eval.reference = '{0}/truth/dsm.tif'\n",
        town.display()
    );
    std::fs::write(&file, text).unwrap();
    let page = folder.path().join("out/a/eval/report.html");
    std::fs::create_dir_all(page.parent().unwrap()).unwrap();
    std::fs::write(&page, "precious").unwrap();
    let states = states(&run(&file, 1));
    assert!(states[0].2 == "done" && states[1].2 == "failed" && states[1].3.contains("report.html"), "{states:?}");
    assert_eq!(std::fs::read_to_string(&page).unwrap(), "precious");
}

#[test]
fn batch_files_are_checked_before_anything_is_done() {
    let folder = tempfile::tempdir().unwrap();
    let file = folder.path().join("batch.toml");
    let scene = "output = 'out'\n[[scene]]\nname = 'a'\nimages = ['a.tif', 'b.tif']\n";
    for (text, words) in [
        ("output = 'out'\n".to_owned(), "the batch has no scene"),
        (scene.replace("images", "image"), "unknown key `image` (line 4); did you mean `images`?"),
        (scene.replace("output = 'out'\n", ""), "no folder for its results"),
        (scene.replace("'a'\n", "'../a'\n"), "cannot be the name of a folder"),
        (format!("{scene}[[scene]]\nname = 'a'\nimages = []\n"), "two scenes have the name"),
        (
            format!("{scene}bounds = [0.0, 0.0, 9.0, 9.0]\narea = {{ file = 'a.geojson' }}\n"),
            "has `bounds` and `area`, which both say where it is",
        ),
        (format!("{scene}tasks = ['dem']\n"), "known are dsm, ortho, eval, heightmap, priors"),
        (format!("{scene}dsm.gsd = 1\n"), "unknown key `gsd`; did you mean `gsd_m`?"),
        (format!("{scene}tasks = ['eval']\n"), "`reference` is missing"),
        (format!("{scene}dsm.output = 'x'\n"), "`output` is set by the batch itself"),
        (format!("{scene}dsm.preset = 'slow'\n"), "unknown variant `slow`"),
        (format!("limits.parallel = 0\n{scene}"), "the limit `parallel` is 0"),
    ] {
        std::fs::write(&file, &text).unwrap();
        let assert = skysweep().arg("batch").arg(&file).assert().code(2);
        let told = String::from_utf8_lossy(&assert.get_output().stderr).into_owned();
        assert!(told.contains(words), "{text}: {told}");
        assert!(!folder.path().join("out").exists());
    }
    let template = skysweep().args(["template", "batch"]).output().unwrap().stdout;
    std::fs::write(&file, template).unwrap();
    let report = run(&file, 1);
    let reasons = states(&report).into_iter().map(|state| state.3).collect::<Vec<_>>();
    assert!(reasons[0].contains("no file matches the pattern"), "{reasons:?}");
}
