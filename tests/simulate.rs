//! `skysweep simulate` end to end: the files it writes, and what it refuses.

use assert_cmd::Command;
use predicates::prelude::*;

fn skysweep() -> Command {
    Command::cargo_bin("skysweep").expect("the binary is built with the tests")
}

const SMALL: [&str; 7] = ["simulate", "--size", "60", "--gsd", "1", "--views", "2"];

#[test]
fn a_simulation_is_written_whole_and_the_same_each_time() {
    let folder = tempfile::tempdir().unwrap();
    let (first, second) = (folder.path().join("a"), folder.path().join("b"));
    for output in [&first, &second] {
        skysweep().args(SMALL).arg("-o").arg(output).assert().code(0);
    }
    for name in ["view_1.tif", "view_2.tif", "truth/dsm.tif", "truth/classes.tif", "scene.json"] {
        let bytes = std::fs::read(first.join(name)).unwrap();
        assert!(!bytes.is_empty() && bytes == std::fs::read(second.join(name)).unwrap(), "{name} differs");
    }
    let record: serde_json::Value = serde_json::from_slice(&std::fs::read(first.join("scene.json")).unwrap()).unwrap();
    assert_eq!(record["views"].as_array().unwrap().len(), 2);
    assert_eq!(record["epsg"], 32631);
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
fn bad_requests_name_the_number_and_write_nothing() {
    let folder = tempfile::tempdir().unwrap();
    let output = folder.path().join("out");
    for (arguments, named) in [(["--size", "1e9"], "size"), (["--views", "1"], "views"), (["--gsd", "nan"], "sampling")]
    {
        skysweep()
            .arg("simulate")
            .args(arguments)
            .arg("-o")
            .arg(&output)
            .assert()
            .code(2)
            .stderr(predicate::str::contains(named));
        assert!(!output.exists());
    }
}
