//! Helpers that tests of the command share: the binary, the sample town, simulated towns, bands of
//! rasters and reports.
//!
//! Tests that need shared data or an installed program use the crate `testing`, which prints skips.

#![allow(dead_code, reason = "no test file uses all of it")]

use std::path::{Path, PathBuf};
use std::sync::OnceLock;

use assert_cmd::Command;
use crs::Crs;
use formats::raster::{Band, BandData, CogRaster, Dem, ImageSource, write_cog};
use raster::Grid;
use serde_json::Value;

/// Returns the command.
pub(crate) fn skysweep() -> Command {
    Command::cargo_bin("skysweep").expect("the binary is built with the tests")
}

/// Returns the path of a file of the sample town.
pub(crate) fn sample(name: &str) -> PathBuf {
    Path::new(env!("CARGO_MANIFEST_DIR")).join("data-samples/town").join(name)
}

/// Returns the path of a file of a town on a quarter of the sample town's area, made once by each
/// test program: for what holds on every scene, whatever its size.
pub(crate) fn small_town(name: &str) -> PathBuf {
    static SCENE: OnceLock<PathBuf> = OnceLock::new();
    let folder = concat!("small_town_", env!("CARGO_CRATE_NAME"));
    SCENE.get_or_init(|| simulated(folder, &[("size_m = 320.0", "size_m = 160.0")])).join(name)
}

/// Simulates the sample town with changed parameters (from, to). `name` is a folder that belongs to
/// the test file.
pub(crate) fn simulated(name: &str, changes: &[(&str, &str)]) -> PathBuf {
    let folder = Path::new(env!("CARGO_TARGET_TMPDIR")).join(name);
    std::fs::create_dir_all(&folder).unwrap();
    let mut parameters = std::fs::read_to_string(sample("scene.toml")).unwrap();
    for (from, to) in changes {
        assert!(parameters.contains(from), "{from} is no parameter of the town");
        parameters = parameters.replace(from, to);
    }
    let (file, scene) = (folder.join("scene.toml"), folder.join("town"));
    std::fs::write(&file, parameters).unwrap();
    let mut command = skysweep();
    command.arg("simulate").arg(&file).arg("-o").arg(&scene).args(["--overwrite", "--progress", "none"]);
    command.assert().code(0);
    scene
}

/// Reads a band of a raster. Bands are counted from 1.
pub(crate) fn band(path: &Path, number: usize) -> Grid<f32> {
    let source = ImageSource::open(path).unwrap();
    source.read_samples(number, source.window()).unwrap()
}

/// Writes a raster on the cells and the map of a surface.
pub(crate) fn write_like(path: &Path, surface: &Dem, data: BandData<'_>, holds_heights: bool) {
    let bands = [Band { description: "layer", data }];
    let crs = Crs::ellipsoidal(surface.horizontal_epsg.unwrap());
    let raster = CogRaster { holds_heights, ..CogRaster::new(&bands, surface.geotransform, crs) };
    write_cog(path, &raster, true).unwrap();
}

/// Checks that a command succeeded, and parses its JSON output.
pub(crate) fn json(output: std::process::Output) -> Value {
    assert!(output.status.success(), "{}", String::from_utf8_lossy(&output.stderr));
    serde_json::from_slice(&output.stdout).unwrap()
}
