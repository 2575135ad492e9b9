//! Outputs on a disk that fails: whatever a command leaves under a final name is complete, and it
//! exits with 0 only when everything is.
//!
//! The shell limits the size of the files that the command may write (`ulimit -f`) and ignores the
//! signal, so that a write beyond the limit fails as on a full disk. The limits go from nothing to
//! more than the largest file.

#![cfg(unix)]

mod commands;
#[path = "../common/mod.rs"]
mod common;
mod links;
mod small_disks;

use std::collections::BTreeMap;
use std::path::{Path, PathBuf};
use std::process::Command;
use std::sync::OnceLock;

use common::{sample, simulated};

/// Limits, blocks of 1024 bytes.
const LIMITS: [u32; 7] = [0, 2, 8, 32, 64, 128, 256];

/// Files of a run that hold its times.
const HOLD_TIMES: &[&str] = &["report.json", "report.html", "collection.json", "item.json", "used_config.toml"];

/// Runs a command of the toolkit in a shell with a limit on the size of files. The output folder is
/// the working folder.
fn limited(folder: &Path, kib: Option<u32>, arguments: &[String]) -> i32 {
    let limit = kib.map_or("true".to_owned(), |kib| format!("ulimit -f {kib}"));
    let script = format!("trap '' XFSZ; {limit}; exec \"$0\" \"$@\"");
    let run = Command::new("bash")
        .args(["-c", &script])
        .arg(assert_cmd::cargo::cargo_bin("skysweep"))
        .args(arguments)
        .current_dir(folder)
        .output()
        .unwrap();
    run.status.code().unwrap_or_else(|| panic!("{arguments:?} under {kib:?}: {run:?}"))
}

/// Returns the content of every file below a folder, by its name.
fn files(folder: &Path) -> BTreeMap<PathBuf, Vec<u8>> {
    let mut found = BTreeMap::new();
    let mut open = vec![folder.to_owned()];
    while let Some(next) = open.pop() {
        for entry in std::fs::read_dir(next).unwrap().map(Result::unwrap) {
            let path = entry.path();
            if path.is_dir() {
                open.push(path);
            } else {
                let content = std::fs::read(&path).unwrap();
                found.insert(path.strip_prefix(folder).unwrap().to_owned(), content);
            }
        }
    }
    found
}

/// Runs a command under all limits. Files that end in `varying` hold times, so their bytes differ.
fn check(arguments: &[&str], varying: &[&str]) {
    let arguments: Vec<String> = arguments.iter().map(|a| (*a).to_owned()).collect();
    let whole = tempfile::tempdir().unwrap();
    assert_eq!(limited(whole.path(), None, &arguments), 0, "{arguments:?}");
    let whole = files(whole.path());
    assert!(!whole.is_empty());
    let mut refused = 0;
    for kib in LIMITS {
        let folder = tempfile::tempdir().unwrap();
        let code = limited(folder.path(), Some(kib), &arguments);
        let left = files(folder.path());
        assert!(matches!(code, 0..=2), "{arguments:?} under {kib} KiB ends with {code}");
        refused += usize::from(code != 0);
        if code == 0 {
            assert!(left.keys().eq(whole.keys()), "{arguments:?} under {kib} KiB: {:?}", left.keys());
        }
        for (name, content) in left {
            let expected = whole.get(&name).unwrap_or_else(|| panic!("{} is left under {kib} KiB", name.display()));
            let is_varying = varying.iter().any(|end| name.ends_with(end));
            let is_whole = if is_varying { ends_as(&name, &content, expected) } else { content == *expected };
            assert!(is_whole, "{} is broken under {kib} KiB", name.display());
        }
    }
    assert!(refused > 0, "{arguments:?}: no limit was too small");
}

/// Returns whether a file that holds times is there to its end, as the `whole` one of another run
/// is.
fn ends_as(name: &Path, content: &[u8], whole: &[u8]) -> bool {
    match name.extension().and_then(|e| e.to_str()) {
        // The status of a chunk is JSON without an extension.
        Some("json") | None => serde_json::from_slice::<serde_json::Value>(content).is_ok(),
        // SQLite counts its pages in the header (file format, 1.3.8), and makes no fewer for the
        // same content.
        Some("gpkg") => {
            let pages = |file: &[u8]| file.get(28..32).map(|count| count.to_vec());
            content.starts_with(b"SQLite format 3") && content.len() == whole.len() && pages(content) == pages(whole)
        }
        Some("toml") => content.ends_with(b"\n"),
        _ => content.trim_ascii_end().ends_with(b"</html>"),
    }
}

fn path(name: &str) -> String {
    sample(name).to_str().unwrap().to_owned()
}

/// The folder of a scene of 80 m, made once: a command runs eight times on it.
fn scene() -> &'static Path {
    static SCENE: OnceLock<PathBuf> = OnceLock::new();
    SCENE.get_or_init(|| simulated("failing_disk", &[("size_m = 320.0", "size_m = 80.0")]))
}

fn small(name: &str) -> String {
    scene().join(name).to_str().unwrap().to_owned()
}

#[test]
fn simulated_scenes_are_whole() {
    let parameters = tempfile::tempdir().unwrap();
    let file = parameters.path().join("scene.toml");
    let text = std::fs::read_to_string(sample("scene.toml")).unwrap();
    std::fs::write(&file, text.replace("size_m = 320.0", "size_m = 60.0")).unwrap();
    check(&["simulate", file.to_str().unwrap(), "-o", "scene", "-q", "--progress", "none"], &[]);
}

#[test]
fn orthos_are_whole() {
    let (image, dsm) = (path("view_1.tif"), path("truth/dsm.tif"));
    check(&["ortho", &image, "--dsm", &dsm, "-o", "ortho.tif", "-q", "--progress", "none"], &[]);
}

#[test]
fn height_maps_are_whole() {
    let dsm = path("truth/dsm.tif");
    let place = ["--center", "5.4", "43.53"];
    let common = ["-o", "map.tif", "-q", "--progress", "none", "--size", "200"];
    check(&[&["heightmap", dsm.as_str()], &place[..], &common[..]].concat(), &[]);
}

#[test]
fn clouds_splats_and_city_models_are_whole() {
    let folder = tempfile::tempdir().unwrap();
    let (dsm, map) = (path("truth/dsm.tif"), folder.path().join("map.tif"));
    let place = ["--center", "5.4", "43.53", "--size", "200", "-q", "--progress", "none"];
    let mut command = common::skysweep();
    command.args(["heightmap", dsm.as_str(), "-o"]).arg(&map).args(place).assert().code(0);
    let quiet = ["-q", "--progress", "none"];
    for cloud in ["points.las", "points.ply"] {
        check(&[&["heightmap", "unproject", map.to_str().unwrap(), "-o", cloud], &quiet[..]].concat(), &[]);
    }
    let (surface, view) = (small("truth/dsm.tif"), small("view_1.tif"));
    check(&[&["splats", surface.as_str(), view.as_str(), "-o", "s.ply"], &quiet[..]].concat(), &[]);
    let town = path("truth/buildings.city.json");
    for model in ["town.city.json", "town.obj", "town.glb", "town.geojson"] {
        check(&[&["city", "convert", town.as_str(), "-o", model], &quiet[..]].concat(), &[]);
    }
}

#[test]
fn error_maps_are_whole() {
    let (dsm, dtm) = (small("truth/dsm.tif"), small("truth/dtm.tif"));
    check(&["eval", &dsm, &dtm, "--error-map", "error.tif", "--html", "page.html", "-q"], &[]);
}

#[test]
fn surface_models_are_whole() {
    let images = [small("view_1.tif"), small("view_3.tif")];
    let common = ["-o", "out", "-q", "--progress", "none", "--preset", "fast"];
    let arguments = [&["dsm", &images[0], &images[1]], &common[..]].concat();
    check(&arguments, HOLD_TIMES);
    check(&[&arguments[..], &["--chunk", "128"]].concat(), HOLD_TIMES);
}
