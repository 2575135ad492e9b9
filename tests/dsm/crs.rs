//! A surface model on maps in feet and in degrees is the one on a map in metres, and so are its
//! products.

use std::path::Path;

use crate::common::{json, simulated, skysweep};
use formats::raster::{ImageSource, read_dem};

/// A smaller town in Florida, where maps are in US survey feet, with fewer samples per pixel.
const IN_FLORIDA: [(&str, &str); 4] = [
    ("size_m = 320.0", "size_m = 160.0"),
    ("lat_deg = 43.53", "lat_deg = 30.34"),
    ("lon_deg = 5.4", "lon_deg = -81.66"),
    ("subpixels = 3", "subpixels = 1"),
];
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
    let expected = ground_error_m(&scene, &folder.path().join("EPSG_32617"));
    for crs in [feet, degrees] {
        let run = folder.path().join(crs.replace(':', "_"));
        let found = ground_error_m(&scene, &run);
        assert!((found - expected).abs() < SAME_M, "{crs}: the ground is off by {found} m instead of {expected} m");
        for product in ["contours.gpkg", "cloud.laz", "tileset.json"] {
            assert!(run.join("products").join(product).is_file(), "{crs}: no {product}");
        }
        let report = std::fs::read_to_string(run.join("products/products.json")).unwrap();
        let report: serde_json::Value = serde_json::from_str(&report).unwrap();
        let cell_m = report["mesh"]["glb_cell_m"].as_f64().expect("a number");
        assert!((cell_m - 1.0).abs() < 0.01, "{crs}: cells of the mesh of {cell_m} m");
        let ortho = run.join("ortho.tif");
        let mut command = skysweep();
        command.arg("ortho").arg(scene.join("view_1.tif")).arg("--dsm").arg(&run).arg("-o").arg(&ortho);
        command.args(["--gsd", "2", "-q"]).assert().code(0);
        let of_image = ImageSource::open(&ortho).unwrap().info().geotransform.expect("a place");
        let (wide, high) = cell(crs);
        let ratios = [of_image.0[1] / wide, -of_image.0[5] / high];
        assert!(ratios.iter().all(|ratio| (ratio - 2.0).abs() < 0.01), "{crs}: {ratios:?} cells of the surface");
    }
}

/// Makes all products of a run, and returns the mean absolute error of the ground, metres.
fn ground_error_m(scene: &Path, run: &Path) -> f64 {
    let mut command = skysweep();
    command.arg("products").arg(run).arg("-q").assert().code(0);
    let mut command = skysweep();
    command.arg("eval").arg(run.join("products/dtm/dtm.tif")).arg(scene.join("truth/dtm.tif"));
    let found = json(command.args(["--align", "none", "--json", "--no-report"]).output().unwrap());
    found["metrics"]["mae"].as_f64().expect("a number")
}
