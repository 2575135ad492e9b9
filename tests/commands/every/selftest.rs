//! `skysweep selftest` as its user sees it.

use assert_cmd::Command;

#[test]
fn an_installation_that_works_says_so_and_leaves_nothing() {
    let folder = tempfile::tempdir().unwrap();
    let mut command = Command::cargo_bin("skysweep").unwrap();
    let assert = command.arg("selftest").arg("--folder").arg(folder.path()).arg("--json").assert().code(0);
    let report: serde_json::Value = serde_json::from_slice(&assert.get_output().stdout).unwrap();
    let checks = report["checks"].as_array().unwrap();
    let state = |name: &str| checks.iter().find(|check| check["name"] == name).unwrap()["state"].clone();
    for name in ["formats", "map projections", "surface model"] {
        assert_ne!(state(name), "failed", "{report:#}");
    }
    assert_eq!(state("surface model"), "passed", "{report:#}");
    assert_eq!(std::fs::read_dir(folder.path()).unwrap().count(), 0);
}

#[test]
fn what_does_not_work_is_named() {
    let mut command = Command::cargo_bin("skysweep").unwrap();
    let assert = command.args(["selftest", "--folder", "/no/such/folder"]).assert().code(1);
    let output = assert.get_output();
    let (told, error) = (String::from_utf8_lossy(&output.stdout), String::from_utf8_lossy(&output.stderr));
    assert!(told.contains("FAILED") && told.contains("folder for temporary files"), "{told}");
    assert!(error.contains("the installation does not work: surface model"), "{error}");
}
