//! `skysweep rpc` as its user sees it: output, exit codes, one clear message, nothing half-written.

use assert_cmd::Command;
use predicates::prelude::*;
use tempfile::TempDir;

/// An RPC that can be worked by hand: line = 1000 − 1000 P, sample = 2000 + 2000 L, without height.
fn plain_rpc() -> String {
    let mut text = String::from(
        "LINE_OFF: 1000 pixels\nSAMP_OFF: 2000 pixels\nLAT_OFF: 45 degrees\nLONG_OFF: 7 degrees\nHEIGHT_OFF: 300 \
         meters\n\
         LINE_SCALE: 1000 pixels\nSAMP_SCALE: 2000 pixels\nLAT_SCALE: 0.01 degrees\nLONG_SCALE: 0.02 degrees\n\
         HEIGHT_SCALE: 500 meters\n",
    );
    for (poly, term, value) in [("LINE_NUM", 3, -1.0), ("LINE_DEN", 1, 1.0), ("SAMP_NUM", 2, 1.0), ("SAMP_DEN", 1, 1.0)]
    {
        for i in 1..=20 {
            text.push_str(&format!("{poly}_COEFF_{i}: {}\n", if i == term { value } else { 0.0 }));
        }
    }
    text
}

fn folder() -> TempDir {
    let folder = TempDir::new().expect("a folder for the test");
    std::fs::write(folder.path().join("a_RPC.TXT"), plain_rpc()).expect("a file in it");
    folder
}

fn skysweep(folder: &TempDir) -> Command {
    let mut command = Command::cargo_bin("skysweep").expect("the program");
    command.current_dir(folder.path()).arg("rpc");
    command
}

/// The only file of the folder, so nothing else was left there.
fn holds_only_the_input(folder: &TempDir) -> bool {
    std::fs::read_dir(folder.path()).expect("the folder").count() == 1
}

#[test]
fn info_tells_people_format_offsets_and_validity() {
    let said = predicate::str::contains("RPC text (KEY: value)")
        .and(predicate::str::contains("offset 1000, scale 1000 px"))
        .and(predicate::str::contains("longitude 6.980000 to 7.020000 deg"))
        .and(predicate::str::contains("incidence 0.00 deg"));
    skysweep(&folder()).args(["info", "a_RPC.TXT"]).assert().success().stdout(said);
}

#[test]
fn info_tells_programs_the_same_in_json() {
    let output =
        skysweep(&folder()).args(["info", "a_RPC.TXT", "--json"]).assert().success().get_output().stdout.clone();
    let info: serde_json::Value = serde_json::from_slice(&output).expect("JSON");
    assert_eq!(info["format"], "text");
    assert_eq!(info["rpc"]["samp_off"], 2000.0);
    assert_eq!(info["validity"]["height_m"], serde_json::json!([-200.0, 800.0]));
    // A pixel of the line is 0.01° / 1000 of latitude; a degree at 45° has 111,132 m on the
    // ellipsoid, and 300 m higher more.
    let gsd = info["centre"]["gsd_line_m"].as_f64().expect("a number");
    assert!((gsd - 1.1114).abs() < 1e-3, "{gsd}");
}

#[test]
fn project_and_localize_take_a_point() {
    let folder = folder();
    let point = ["--lon", "7.01", "--lat", "44.995", "--height", "10"];
    skysweep(&folder)
        .args(["project", "a_RPC.TXT"])
        .args(point)
        .assert()
        .success()
        .stdout("3000.000000000 1500.000000000\n");
    let pixel = ["--sample", "3000", "--line", "1500", "--height", "10"];
    skysweep(&folder)
        .args(["localize", "a_RPC.TXT"])
        .args(pixel)
        .assert()
        .success()
        .stdout("7.010000000000 44.995000000000 10\n");
}

#[test]
fn a_negative_coordinate_is_no_option() {
    let pixel = ["--sample", "-3.5", "--line", "-1", "--height", "-10", "--json"];
    let said = predicate::str::contains("\"sample\":-3.5").and(predicate::str::contains("\"height_m\":-10.0"));
    skysweep(&folder()).args(["localize", "a_RPC.TXT"]).args(pixel).assert().success().stdout(said);
}

#[test]
fn points_come_from_standard_input_or_a_file() {
    let folder = folder();
    let points = "# lon lat h\n7 45 300\n\n7.02,45.01,0\n";
    let expected = "2000.000000000 1000.000000000\n4000.000000000 0.000000000\n";
    skysweep(&folder).args(["project", "a_RPC.TXT"]).write_stdin(points).assert().success().stdout(expected);
    std::fs::write(folder.path().join("p.txt"), points).expect("a file");
    skysweep(&folder).args(["project", "a_RPC.TXT", "--points", "p.txt"]).assert().success().stdout(expected);
}

#[test]
fn a_point_without_an_answer_keeps_its_line_and_the_exit_code_says_so() {
    let points = "7 45 300\nnan 45 300\n7 45 300\n";
    skysweep(&folder())
        .args(["project", "a_RPC.TXT"])
        .write_stdin(points)
        .assert()
        .code(1)
        .stdout("2000.000000000 1000.000000000\nnan nan\n2000.000000000 1000.000000000\n")
        .stderr(predicate::str::contains("line 2").and(predicate::str::contains("1 points have no answer")));
}

#[test]
fn points_that_are_no_numbers_name_the_line() {
    for bad in ["7 45\n", "7 45 300 1\n", "7 45 high\n", &"1".repeat(10_000)] {
        let said = predicate::str::starts_with("error: line 2 of the points").and(predicate::str::contains("expected"));
        let input = format!("7 45 300\n{bad}");
        skysweep(&folder()).args(["project", "a_RPC.TXT"]).write_stdin(input).assert().code(2).stderr(said);
    }
}

#[test]
fn convert_keeps_every_number_in_every_format() {
    let folder = folder();
    for (from, to) in [("a_RPC.TXT", "b.RPB"), ("b.RPB", "c.json"), ("c.json", "d_RPC.TXT")] {
        skysweep(&folder).args(["convert", from, "-o", to]).assert().success().stdout("").stderr("");
    }
    let read = |name: &str| formats::rpc::read(&folder.path().join(name)).expect("the written file").rpc;
    let (first, last) = (read("a_RPC.TXT"), read("d_RPC.TXT"));
    // RPB has no way to leave the errors out.
    assert_eq!(last, camera::Rpc { err_bias_m: Some(0.0), err_rand_m: Some(0.0), ..first });
}

#[test]
fn convert_replaces_only_when_told_to() {
    let folder = folder();
    std::fs::write(folder.path().join("b.json"), "mine").expect("a file");
    let convert = ["convert", "a_RPC.TXT", "-o", "b.json"];
    skysweep(&folder).args(convert).assert().code(2).stderr(predicate::str::contains("--overwrite"));
    assert_eq!(std::fs::read_to_string(folder.path().join("b.json")).expect("still there"), "mine");
    skysweep(&folder).args(convert).arg("--overwrite").assert().success();
    assert!(formats::rpc::read(&folder.path().join("b.json")).is_ok());
}

#[test]
fn convert_to_an_unknown_ending_or_folder_writes_nothing() {
    let folder = folder();
    let convert = |out: &str| skysweep(&folder).args(["convert", "a_RPC.TXT", "-o", out]).assert().code(2);
    convert("b.xyz").stderr(predicate::str::contains("--format"));
    convert("b.tif").stderr(predicate::str::contains("not a raster"));
    let told =
        predicate::str::starts_with("error: cannot write the file").and(predicate::str::contains("nowhere/b.json"));
    convert("nowhere/b.json").stderr(told);
    assert!(holds_only_the_input(&folder));
}

#[test]
fn a_file_without_rpc_is_one_error_with_exit_code_2() {
    let folder = folder();
    std::fs::write(folder.path().join("notes.txt"), "nothing of the kind").expect("a file");
    let said = predicate::str::starts_with("error: no RPC found (tried ").and(predicate::str::contains("notes.txt"));
    skysweep(&folder).args(["info", "notes.txt"]).assert().code(2).stdout("").stderr(said);
    let said = predicate::str::starts_with("error: cannot read missing.tif\n  caused by: ");
    skysweep(&folder).args(["info", "missing.tif"]).assert().code(2).stdout("").stderr(said);
    skysweep(&folder).args(["info", "."]).assert().code(2).stderr(predicate::str::contains("expected a file"));
}

#[test]
fn a_broken_entry_is_named_with_its_line() {
    let folder = folder();
    let broken = plain_rpc().replace("HEIGHT_SCALE: 500", "HEIGHT_SCALE: 5OO");
    std::fs::write(folder.path().join("b_RPC.TXT"), broken).expect("a file");
    let said = predicate::str::starts_with("error: HEIGHT_SCALE is \"5OO\" (line 10), expected a number");
    skysweep(&folder).args(["info", "b_RPC.TXT"]).assert().code(2).stderr(said);
}

#[test]
fn usage_errors_have_exit_code_2_too() {
    skysweep(&folder()).args(["project", "a_RPC.TXT", "--lon", "7"]).assert().code(2);
    skysweep(&folder()).args(["unknown"]).assert().code(2);
}

/// The cameras of the dataset are those of the run, in cut images, and an earlier dataset goes.
#[test]
fn a_run_becomes_a_dataset_of_images_and_cameras() {
    let folder = TempDir::new().unwrap();
    let town = std::path::Path::new(env!("CARGO_MANIFEST_DIR")).join("data-samples/town");
    let views: Vec<_> = (1..=3).map(|view| town.join(format!("view_{view}.tif"))).collect();
    let truth = formats::raster::read_dem(town.join("truth/dsm.tif")).unwrap();
    let (x, y) = truth.geotransform.map_from_cell(100.0, 300.0);
    let bounds = [x, y, x + 60.0, y + 60.0].map(|side| format!("{side:.0}"));
    let mut dsm = Command::cargo_bin("skysweep").unwrap();
    dsm.current_dir(folder.path()).arg("dsm").args(&views).args(["-o", "run", "--gsd", "1", "--preset", "fast", "-q"]);
    dsm.arg("--bounds").args(bounds).assert().success();

    let refused = skysweep(&folder).args(["export", "run", "-o", "set"]).assert().code(2);
    refused.stderr(predicate::str::contains("where the sun stood").and(predicate::str::contains("--sun")));
    let export = |more: &[&str]| {
        let mut command = skysweep(&folder);
        command.args(["export", "run", "-o", "set", "--sun", "150", "50", "--hold-out", "3"]).args(more);
        command.assert()
    };
    export(&[]).success().stdout(predicate::str::contains("1 are held out"));
    let cameras = folder.path().join("set/cameras");
    let read = |name: &str| std::fs::read_to_string(cameras.join(name)).unwrap();
    assert_eq!((read("train.txt"), read("test.txt")), ("view_2.json\nview_3.json".into(), "view_1.json".into()));
    let record: serde_json::Value = serde_json::from_str(&read("view_2.json")).unwrap();
    let (low, high) = (record["min_alt"].as_f64().unwrap(), record["max_alt"].as_f64().unwrap());
    assert_eq!((&record["sun_elevation"], &record["sun_azimuth"]), (&"+50".into(), &"150".into()));
    assert!(high - low >= 2.0 && low > 100.0, "{low} {high}");
    let size = [&record["width"], &record["height"]].map(|side| side.as_u64().unwrap() as usize);
    let image = formats::raster::ImageSource::open(folder.path().join("set/images/view_2.tif")).unwrap();
    assert_eq!(([image.info().width, image.info().height], image.info().bands), (size, 3));
    assert!(size[0] < 400 && size[1] < 400, "the image is not cut: {size:?}");

    // The camera of the file and that of the image see what the corrected camera sees.
    let set: serde_json::Value =
        serde_json::from_str(&std::fs::read_to_string(folder.path().join("set/dataset.json")).unwrap()).unwrap();
    let origin = [0, 1].map(|axis| set["images"][1]["origin_px"][axis].as_f64().unwrap());
    let camera = jobs::rpc::camera_of_run(&folder.path().join("run"), &views[1]).unwrap();
    for file in [cameras.join("view_2.json"), folder.path().join("set/images/view_2.tif")] {
        let rpc = formats::rpc::read(&file).unwrap().rpc;
        for (sample, line) in [(5.0, 5.0), (60.0, 80.0)] {
            let ground = rpc.localize(camera::ImagePoint::new(sample, line), (low + high) / 2.0).unwrap();
            let at = camera.project(ground).unwrap();
            let off = (at.sample - origin[0] - sample).hypot(at.line - origin[1] - line);
            assert!(off < 1e-3, "{}: {off}", file.display());
        }
    }

    export(&[]).code(2).stderr(predicate::str::contains("not empty"));
    std::fs::write(cameras.join("scene.loc"), "{}").unwrap();
    export(&["--overwrite"]).success();
    assert!(!cameras.join("scene.loc").exists(), "what the trainer made of earlier cameras is gone");
    std::fs::write(cameras.join("notes.txt"), "mine").unwrap();
    export(&["--overwrite"]).code(2).stderr(predicate::str::contains("notes.txt"));
}

#[test]
fn info_tells_what_the_image_is() {
    let view = concat!(env!("CARGO_MANIFEST_DIR"), "/data-samples/town/view_1.tif");
    let said = predicate::str::contains("samples, ")
        .and(predicate::str::contains("1 band"))
        .and(predicate::str::contains("unknown: the file does not say"))
        .and(predicate::str::contains("lower right"));
    skysweep(&folder()).args(["info", view]).assert().success().stdout(said);
}
