//! `skysweep register` end to end on a simulated town: planted shifts come back to a tenth of a
//! pixel against a surface and against splats, the correction goes into every RPC format, and what
//! is refused.
//!
//! Views of this town match one another with a constant offset, whatever was planted: 0.13 pixels
//! on the exact surface. Planted shifts are measured from it, and it has bounds of its own.

use std::path::{Path, PathBuf};
use std::sync::OnceLock;

use crate::common::{sample, simulated, skysweep};
use camera::{ImagePoint, Rpc};
use crs::Crs;
use formats::raster::{Band, BandData, CogRaster, read_dem, write_cog};
use geodesy::LonLatHeight;
use predicates::prelude::*;
use raster::Grid;
use serde_json::Value;

/// A town of 160 m whose images point where their RPCs say; made once.
fn town() -> &'static Path {
    static TOWN: OnceLock<PathBuf> = OnceLock::new();
    let pointing = ("pointing_error_px = [1.0, 3.0]", "pointing_error_px = [0.0, 0.0]");
    TOWN.get_or_init(|| simulated("register", &[("size_m = 320.0", "size_m = 160.0"), pointing]))
}

fn rpc_of(image: &Path) -> Rpc {
    formats::rpc::read_for_image(image).unwrap().rpc
}

/// Writes view 3 of the town with an RPC that is off by some pixels; returns the RPC that it should
/// have.
fn misplaced(path: &Path, [sample, line]: [f64; 2]) -> Rpc {
    let image = town().join("view_3.tif");
    let right = rpc_of(&image);
    let wrong = Rpc { samp_off: right.samp_off + sample, line_off: right.line_off + line, ..right.clone() };
    formats::raster::copy_image_with_rpc(&image, path, &wrong, true).unwrap();
    right
}

fn json(path: &Path) -> Value {
    serde_json::from_slice(&std::fs::read(path).unwrap()).unwrap()
}

/// Distance of the places of a ground point under two RPCs, pixels.
fn apart(a: &Rpc, b: &Rpc) -> f64 {
    let ground = |[lon, lat]: [f64; 2]| {
        LonLatHeight::new(a.long_off + lon * a.long_scale, a.lat_off + lat * a.lat_scale, a.height_off)
    };
    let place = |rpc: &Rpc, at: [f64; 2]| -> ImagePoint { rpc.project(ground(at)).unwrap() };
    let distance = |at: [f64; 2]| {
        let (p, q) = (place(a, at), place(b, at));
        (p.sample - q.sample).hypot(p.line - q.line)
    };
    [[0.0, 0.0], [0.3, -0.2], [-0.4, 0.4]].into_iter().map(distance).fold(0.0, f64::max)
}

#[test]
fn planted_shifts_come_back_and_go_into_every_format() {
    let folder = tempfile::tempdir().unwrap();
    let (image, report) = (folder.path().join("new.tif"), folder.path().join("new.json"));
    let mut constant = [0.0; 2];
    for (number, planted) in [[0.0, 0.0], [3.3, -5.7], [-12.4, 9.8]].into_iter().enumerate() {
        let right = misplaced(&image, planted);
        let mut command = skysweep();
        command.arg("register").arg(&image).arg("--dsm").arg(town().join("truth/dsm.tif")).arg("--images");
        command.args(["view_1.tif", "view_2.tif"].map(|view| town().join(view)));
        command.arg("-o").arg(&report).args(["--progress", "none", "--overwrite"]).assert().code(0);
        let found = json(&report);
        for axis in 0..2 {
            let shift = found["shift_px"][axis].as_f64().unwrap();
            if number == 0 {
                constant[axis] = shift;
                assert!(shift.abs() < 0.15, "{found}");
            }
            assert!((shift + planted[axis] - constant[axis]).abs() < 0.1, "{planted:?}: {found}");
        }
        if number != 1 {
            continue;
        }
        for name in ["new_RPC.TXT", "new.rpb", "new_rpc.json", "corrected.tif"] {
            let out = folder.path().join(name);
            let mut convert = skysweep();
            convert.args(["rpc", "convert"]).arg(&image).arg("--corrections").arg(&report).arg("-o").arg(&out);
            convert.assert().code(0);
            let written = formats::rpc::read(&out).unwrap().rpc;
            assert!(apart(&written, &right) < 0.15, "{name}: {}", apart(&written, &right));
            std::fs::remove_file(&out).unwrap();
        }
        let page = std::fs::read_to_string(report.with_extension("html")).unwrap();
        assert!(page.contains("Residuals in the image") && page.contains("<svg"), "no map of residuals");
        let mut other = skysweep();
        other.args(["rpc", "convert"]).arg(sample("view_3.tif")).arg("--corrections").arg(&report);
        let told = predicate::str::contains("no pointing correction of");
        other.arg("-o").arg(folder.path().join("other.json")).assert().code(2).stderr(told);
        let mut of_model = skysweep();
        of_model.args(["rpc", "convert"]).arg(town().join("view_1.tif")).arg("--corrections").arg(&report);
        of_model.arg("-o").arg(folder.path().join("model.json")).assert().code(0);
        let mut unknown = skysweep();
        unknown.args(["rpc", "convert"]).arg(sample("truth/heights_1.tif")).arg("--corrections").arg(&report);
        unknown.arg("-o").arg(folder.path().join("unknown.json")).assert().code(2);
    }
}

#[test]
fn a_drift_is_found_by_evidence_and_filled_strips_do_not_count() {
    let folder = tempfile::tempdir().unwrap();
    let (image, report) = (folder.path().join("new.tif"), folder.path().join("new.json"));
    let register = |surface: &Path| {
        let mut command = skysweep();
        command.arg("register").arg(&image).arg("--dsm").arg(surface).arg("--images");
        command.args(["view_1.tif", "view_2.tif"].map(|view| town().join(view)));
        command.arg("-o").arg(&report).args(["--progress", "none", "--overwrite"]).assert().code(0);
        json(&report)
    };
    let truth = town().join("truth/dsm.tif");
    misplaced(&image, [6.0, -3.0]);
    let shift = register(&truth);
    assert_eq!(shift["order"], "shift");
    // The scale of the lines is off by half a percent, which moves the first and the last of them.
    let right = rpc_of(&town().join("view_3.tif"));
    let wrong = Rpc { line_scale: right.line_scale * 1.005, ..right.clone() };
    formats::raster::copy_image_with_rpc(&town().join("view_3.tif"), &image, &wrong, true).unwrap();
    let drift = register(&truth);
    assert_ne!(drift["order"], "shift", "{drift}");
    assert!(drift["rms_px"].as_f64().unwrap() < shift["rms_px"].as_f64().unwrap() + 0.1, "{drift}");
    // Strips of the surface are filled, so that no window of a chip is whole.
    let folder = folder.path().join("weak");
    std::fs::create_dir(&folder).unwrap();
    std::fs::copy(&truth, folder.join("dsm.tif")).unwrap();
    let dem = read_dem(&truth).unwrap();
    let (width, height) = (dem.heights.width(), dem.heights.height());
    let cells = (0..width * height).map(|i| if i % width % 12 < 2 || i / width % 12 < 2 { 2 } else { 1 });
    let source = Grid::from_vec(width, height, cells.collect::<Vec<u8>>()).unwrap();
    let bands = [Band { description: "layer", data: BandData::U8(&source) }];
    let crs = Crs::ellipsoidal(dem.horizontal_epsg.unwrap());
    write_cog(folder.join("source.tif"), &CogRaster::new(&bands, dem.geotransform, crs), false).unwrap();
    misplaced(&image, [6.0, -3.0]);
    let weak = register(&folder.join("dsm.tif"));
    for axis in 0..2 {
        let (a, b) = (weak["shift_px"][axis].as_f64().unwrap(), shift["shift_px"][axis].as_f64().unwrap());
        assert!((a - b).abs() < 0.1, "{weak}");
    }
}

#[test]
fn splats_are_a_model_too() {
    let folder = tempfile::tempdir().unwrap();
    let (image, report, splats) =
        (folder.path().join("new.tif"), folder.path().join("new.json"), folder.path().join("town.ply"));
    let mut make = skysweep();
    make.arg("splats").arg(town().join("truth/dsm.tif"));
    make.args(["view_1.tif", "view_2.tif"].map(|view| town().join(view))).arg("-o").arg(&splats);
    make.args(["--progress", "none"]).assert().code(0);
    let shift_of = |planted: [f64; 2]| {
        misplaced(&image, planted);
        let mut command = skysweep();
        command.arg("register").arg(&image).arg("--splats").arg(&splats).arg("-o").arg(&report);
        command.args(["--progress", "none", "--overwrite"]).assert().code(0);
        let found = json(&report);
        [0, 1].map(|axis| found["shift_px"][axis].as_f64().unwrap())
    };
    let (planted, constant) = ([-4.6, 2.9], shift_of([0.0, 0.0]));
    assert!(constant[0].hypot(constant[1]) < 0.25, "{constant:?}");
    let shift = shift_of(planted);
    for axis in 0..2 {
        assert!((shift[axis] + planted[axis] - constant[axis]).abs() < 0.1, "{shift:?}, {constant:?}");
    }
}

#[test]
fn what_cannot_be_registered_is_refused() {
    let folder = tempfile::tempdir().unwrap();
    let out = folder.path().join("out.json");
    let dsm = town().join("truth/dsm.tif");
    let refused = |options: &[&str], words: &str| {
        let mut command = skysweep();
        command.arg("register").arg(town().join("view_3.tif")).arg("-o").arg(&out).args(options);
        command.assert().code(2).stderr(predicate::str::contains(words.to_owned()));
        assert!(!out.exists());
    };
    let dsm = dsm.to_str().unwrap();
    refused(&["--dsm", dsm], "--images");
    refused(&["--dsm", dsm, "--images", town().join("view_1.tif").to_str().unwrap(), "--reach", "0.1"], "--reach");
    refused(&["--splats", "none.ply"], "none.ply");
    refused(&[], "--dsm");
}
