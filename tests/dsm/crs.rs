//! A surface model on maps in feet and in degrees is the one on a map in metres.

use std::path::Path;

use crate::common::{json, simulated, skysweep};
use io::raster::read_dem;

/// The sample town in Florida, where maps are in US survey feet, with fewer samples per pixel.
const IN_FLORIDA: [(&str, &str); 3] =
    [("lat_deg = 43.53", "lat_deg = 30.34"), ("lon_deg = 5.4", "lon_deg = -81.66"), ("subpixels = 3", "subpixels = 1")];
/// Largest difference of the errors on different maps, metres: their cells lie elsewhere.
const SAME_M: f64 = 0.03;

/// Makes the surface model of the town on a map, and returns its mean absolute error in metres and
/// the share of cells that have a height.
fn made(scene: &Path, folder: &Path, crs: &str) -> (f64, f64) {
    let out = folder.join(crs.replace(':', "_"));
    let mut command = skysweep();
    command.arg("dsm").args([1, 2, 3].map(|n| scene.join(format!("view_{n}.tif")))).arg("-o").arg(&out);
    command.args(["--crs", crs, "--gsd", "1", "--vertical", "egm96", "-q"]).assert().code(0);
    let mut command = skysweep();
    command.arg("eval").arg(out.join("dsm/dsm.tif")).arg(scene.join("truth/dsm.tif"));
    let found = json(command.args(["--align", "none", "--json", "--no-report"]).output().unwrap());
    let all = &found["metrics"];
    let number = |name: &str| all[name].as_f64().unwrap_or_else(|| panic!("{name} in {all}"));
    (number("mae"), number("valid_ratio"))
}

#[test]
fn maps_in_feet_and_in_degrees_hold_the_same_surface() {
    let scene = simulated("dsm_crs", &IN_FLORIDA);
    let folder = tempfile::tempdir().unwrap();
    let (metres, feet, degrees) = ("EPSG:32617", "EPSG:2236", "EPSG:4326");
    let (mae, valid) = made(&scene, folder.path(), metres);
    for crs in [feet, degrees] {
        let (other, other_valid) = made(&scene, folder.path(), crs);
        assert!((other - mae).abs() < SAME_M, "{crs}: MAE {other} m instead of {mae} m");
        assert!((other_valid - valid).abs() < 0.02, "{crs}: {other_valid} of the cells instead of {valid}");
    }
    let cell = |crs: &str| {
        let dem = read_dem(folder.path().join(crs.replace(':', "_")).join("dsm/dsm.tif")).unwrap();
        (dem.geotransform.0[1], -dem.geotransform.0[5])
    };
    // A US survey foot is 1200 / 3937 m. Degrees are shorter along the parallel by cos(latitude).
    let (x, y) = cell(feet);
    assert!((x - 3937.0 / 1200.0).abs() < 1e-9 && x == y, "{x} {y}");
    let (x, y) = cell(degrees);
    assert!((x * 111_320.0 * 30.34_f64.to_radians().cos() - 1.0).abs() < 0.01, "{x}");
    assert!((y * 110_850.0 - 1.0).abs() < 0.01, "{y}");
}
