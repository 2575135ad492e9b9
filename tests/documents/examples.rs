//! Runs every program of `examples/` on the sample town.

use std::path::PathBuf;
use std::process::Command;

/// Path of an example's executable, which `cargo test` builds beside the tests.
fn executable(name: &str) -> PathBuf {
    let tests = std::env::current_exe().expect("the path of the test is known");
    let folder = tests.parent().and_then(|deps| deps.parent()).expect("tests lie in target/PROFILE/deps");
    let path = folder.join("examples").join(name);
    assert!(path.is_file(), "{} is missing: build it with cargo build --examples", path.display());
    path
}

/// Runs an example and returns what it prints.
fn output_of(name: &str, arguments: &[&str]) -> String {
    let output = Command::new(executable(name)).args(arguments).output().expect("the example starts");
    assert!(output.status.success(), "{name}: {}", String::from_utf8_lossy(&output.stderr));
    String::from_utf8(output.stdout).expect("an example prints UTF-8")
}

#[test]
fn a_point_is_projected_and_found_again() {
    let text = output_of("project_a_point", &[]);
    assert!(text.contains("is seen at sample") && text.contains("one pixel is 0.5"), "{text}");
}

#[test]
fn a_surface_model_is_made_of_two_images() {
    let folder = tempfile::tempdir().expect("a temporary folder");
    let out = folder.path().join("dsm");
    let text = output_of("dsm_from_two_images", &[out.to_str().expect("UTF-8")]);
    assert!(text.contains("cells observed") && out.join("dsm/dsm.tif").is_file(), "{text}");
}

#[test]
fn a_surface_model_is_evaluated() {
    assert!(output_of("evaluate", &[]).contains("NMAD"));
}

#[test]
fn priors_of_a_tile_are_made() {
    let folder = tempfile::tempdir().expect("a temporary folder");
    let out = folder.path().join("priors");
    output_of("priors_of_a_tile", &[out.to_str().expect("UTF-8")]);
    assert!(out.join("height/view_1.tif").is_file());
}

#[test]
fn a_height_map_is_made() {
    let folder = tempfile::tempdir().expect("a temporary folder");
    let map = folder.path().join("map.tif");
    output_of("height_map", &[map.to_str().expect("UTF-8")]);
    assert!(map.is_file());
}
