//! `skysweep mesh` end to end: the prior depths of the town become its buildings again, in their
//! place on the map; and what is refused.

use std::path::{Path, PathBuf};
use std::sync::OnceLock;

use crate::common::{sample, skysweep};
use predicates::prelude::*;

/// The priors of the town. Made once.
fn dataset() -> &'static Path {
    static DATASET: OnceLock<PathBuf> = OnceLock::new();
    DATASET.get_or_init(|| {
        let folder = PathBuf::from(env!("CARGO_TARGET_TMPDIR")).join("mesh_dataset");
        skysweep()
            .arg("priors")
            .arg(sample("truth/buildings.city.json"))
            .arg("--cameras")
            .arg(sample("cameras"))
            .args(["--points", "2000", "--overwrite", "-o"])
            .arg(&folder)
            .assert()
            .success();
        folder
    })
}

fn mesh(arguments: &[&str], output: &Path) -> assert_cmd::assert::Assert {
    let mut command = skysweep();
    command.arg("mesh").arg(dataset()).args(arguments).arg("-o").arg(output).assert()
}

fn depths() -> String {
    dataset().join("raw_depth").display().to_string()
}

#[test]
fn prior_depths_become_the_buildings_again() {
    let out = tempfile::tempdir().unwrap();
    let path = out.path().join("town.ply");
    let model = sample("truth/buildings.city.json").display().to_string();
    let coarse = ["--depths", &depths(), "--voxel", "1", "--masked"];
    mesh(&[&coarse[..], &["--reference", &model]].concat(), &path)
        .success()
        .stdout(predicate::str::contains("Chamfer"));
    let text = std::fs::read_to_string(out.path().join("town.report.json")).unwrap();
    let report: serde_json::Value = serde_json::from_str(&text).unwrap();
    // The cameras see no floors, and not all walls.
    let mean = report["comparison"]["result"]["accuracy"]["mean_m"].as_f64().unwrap();
    assert!(mean < 0.25, "{mean} m from the mesh to the model");
    assert!(out.path().join("town.report.html").is_file());
    let surface = cityfiles::surfaces::read(&path, &city::MeshConfig::default()).unwrap();
    assert_eq!(surface.triangles.len() as u64, report["triangles"].as_u64().unwrap());
    // The same mesh in any number of threads, and as glTF.
    let again = out.path().join("again.ply");
    mesh(&[&coarse[..], &["--threads", "1"]].concat(), &again).success();
    assert!(std::fs::read(&path).unwrap() == std::fs::read(&again).unwrap(), "threads change the mesh");
    let glb = out.path().join("binary.glb");
    mesh(&coarse, &glb).success();
    assert_eq!(&std::fs::read(&glb).unwrap()[..4], b"glTF");
}

#[test]
fn what_cannot_be_fused_is_refused() {
    let out = tempfile::tempdir().unwrap();
    let refused = |arguments: &[&str], name: &str, what: &str| {
        mesh(arguments, &out.path().join(name)).code(2).stderr(predicate::str::contains(what.to_owned()));
        assert!(!out.path().join(name).exists());
    };
    let depths = depths();
    refused(&["--depths", "nowhere"], "a.ply", "none of 12 cameras has a depth map");
    refused(&["--depths", &depths, "--voxel", "0"], "a.ply", "edge of a voxel is 0");
    refused(&["--depths", &depths, "--memory", "0.001"], "a.ply", "larger voxels");
    refused(&["--depths", &depths], "a.obj", ".ply or .glb");
    refused(&[], "a.ply", "--splats");
    std::fs::write(out.path().join("b.ply"), b"old").unwrap();
    mesh(&["--depths", &depths], &out.path().join("b.ply")).code(2).stderr(predicate::str::contains("exists"));
}
