//! `skysweep ortho` end to end on simulated towns: hidden cells against the exact scene, grey
//! values against the simulator's own picture from above, and what is refused.

use std::path::Path;

use crate::common::{band, sample, simulated, skysweep};
use predicates::prelude::*;
use raster::Grid;
use serde_json::Value;
use tempfile::TempDir;

/// Vehicles are in no surface model. RPCs point where they say, and pixels are sampled once where
/// grey values do not matter.
const STILL: [(&str, &str); 2] = [
    ("parked_share = 0.35", "parked_share = 0.0"),
    ("pointing_error_px = [1.0, 3.0]", "pointing_error_px = [0.0, 0.0]"),
];
const QUICK: (&str, &str) = ("subpixels = 3", "subpixels = 1");

/// The ortho of one view of a town, and what its cells are.
fn ortho(folder: &TempDir, scene: &Path, view: &str) -> (Grid<f32>, Grid<f32>) {
    let out = folder.path().join(format!("{view}.tif"));
    let mut command = skysweep();
    command.arg("ortho").arg(scene.join(format!("view_{view}.tif"))).arg("--dsm").arg(scene.join("truth/dsm.tif"));
    command.arg("-o").arg(&out).args(["--progress", "none", "-q"]).assert().code(0);
    (band(&out, 1), band(&folder.path().join(format!("{view}_mask.tif")), 1))
}

/// (precision, recall) of the cells of a view that are said to be hidden, out of at least `least`.
fn hidden(scene: &Path, view: u8, least: f64) -> (f64, f64) {
    let folder = tempfile::tempdir().unwrap();
    let (_, state) = ortho(&folder, scene, &view.to_string());
    let truth = band(&scene.join("truth/visibility.tif"), view.into());
    let cells = || state.data().iter().zip(truth.data()).filter(|(state, _)| **state <= 1.0);
    let count =
        |hidden: bool, truly: bool| cells().filter(|(s, t)| (**s == 1.0, **t == 0.0) == (hidden, truly)).count() as f64;
    let (right, wrong, missed) = (count(true, true), count(true, false), count(false, true));
    assert!(right > least, "{right} cells are hidden");
    (right / (right + wrong), right / (right + missed))
}

/// The town as it is sold: parapets thinner than the cells, chimneys, plant rooms, trees, and its
/// own three views, the middle one only 6° from the vertical. There what a house hides is two cells
/// wide and what a parapet hides a fifth of a cell, which cells of half a metre do not tell; those
/// of a quarter do.
#[test]
fn hidden_cells_are_the_hidden_ones_in_a_town_with_parapets_and_trees() {
    let scene = simulated("ortho_half", &[STILL[0], STILL[1], QUICK]);
    for (view, bound) in [(1, 0.95), (2, 0.91)] {
        let (precision, recall) = hidden(&scene, view, 2000.0);
        assert!(precision >= bound && recall >= bound, "{view}: precision {precision:.4}, recall {recall:.4}");
    }
    let finer = [("gsd_m = 0.5", "gsd_m = 0.25"), ("320.0", "120.0"), ("seed = 1", "seed = 2")];
    let scene = simulated("ortho_quarter", &[&finer[..], &STILL, &[QUICK]].concat());
    for view in [2, 3] {
        let (precision, recall) = hidden(&scene, view, 2000.0);
        assert!(precision >= 0.95 && recall >= 0.95, "finer, {view}: precision {precision:.4}, recall {recall:.4}");
    }
}

/// View 1 looks straight down, view 2 from the north under 18°.
#[test]
fn what_is_seen_looks_as_from_above() {
    let folder = tempfile::tempdir().unwrap();
    let looks = "looks = [{ incidence_deg = 0.5, azimuth_deg = 280.0 }, { incidence_deg = 18.0, azimuth_deg = 350.0 }]";
    let changes =
        [("320.0", "200.0"), ("views = 3", "views = 2"), ("looks = []", looks), ("details = true", "details = false")];
    let scene = simulated("ortho_above", &[&changes[..], &STILL].concat());
    let (above, seen_above) = ortho(&folder, &scene, "1");
    let (aside, state) = ortho(&folder, &scene, "2");
    let (precision, recall) = hidden(&scene, 2, 5000.0);
    assert!(precision >= 0.97 && recall >= 0.97, "precision {precision:.4}, recall {recall:.4}");

    // The sensor's own account of its noise: photons and read noise.
    let report: Value = serde_json::from_slice(&std::fs::read(scene.join("scene.json")).unwrap()).unwrap();
    let sensor = |key: &str| report["views"][0]["sensor"][key].as_f64().unwrap();
    assert_eq!(sensor("gamma"), 1.0);
    let sigma = |dn: f64| {
        let electrons = ((dn - sensor("offset")) / sensor("gain") * sensor("electrons_at_white")).max(0.0);
        (electrons + sensor("read_noise_electrons").powi(2)).sqrt() * sensor("gain") / sensor("electrons_at_white")
    };
    let both = (0..state.data().len()).filter(|&i| state.data()[i] == 0.0 && seen_above.data()[i] == 0.0);
    let mut differences: Vec<f64> = both
        .map(|i| {
            let (a, b) = (f64::from(above.data()[i]), f64::from(aside.data()[i]));
            (a - b).abs() / (std::f64::consts::SQRT_2 * sigma(b))
        })
        .collect();
    differences.sort_by(f64::total_cmp);
    assert!(differences.len() > 140_000);
    // Of two pictures that differ by noise alone, the median difference is 0.67 σ.
    let median = differences[differences.len() / 2];
    assert!(median < 0.75, "the median difference is {median:.3} of the noise of both");
    let within = differences.partition_point(|&d| d < 3.0) as f64 / differences.len() as f64;
    assert!(within > 0.95, "{within:.4} of the cells are within three times the noise");
}

#[test]
fn a_mosaic_fills_what_one_view_hides() {
    let folder = tempfile::tempdir().unwrap();
    let out = folder.path().join("ortho.tif");
    let mut command = skysweep();
    command.arg("ortho").args(["view_1.tif", "view_2.tif", "view_3.tif"].map(sample)).arg("--dsm");
    command.arg(sample("truth/dsm.tif")).arg("-o").arg(&out).args(["--gsd", "1", "--json", "--progress", "none"]);
    let output = command.assert().code(0).get_output().stdout.clone();
    let report: Value = serde_json::from_slice(&output).unwrap();
    assert_eq!(report["images"].as_array().map(Vec::len), Some(3));
    let (state, view) =
        (band(&folder.path().join("ortho_mask.tif"), 1), band(&folder.path().join("ortho_mask.tif"), 2));
    assert_eq!((state.width(), state.height()), (320, 320));
    let share = |wanted: f32| state.data().iter().filter(|s| **s == wanted).count() as f64 / 102_400.0;
    assert!(share(0.0) > 0.97 && share(1.0) < 0.03, "{} seen, {} hidden", share(0.0), share(1.0));
    // The steepest view gives most, and the others what it does not see.
    let used = |number: f32| view.data().iter().filter(|v| **v == number).count();
    assert!(used(2.0) > 50_000 && used(1.0) + used(3.0) > 300, "{} {} {}", used(1.0), used(2.0), used(3.0));
}

/// Feathering changes a mosaic beside its seams only, and the median differs from the steepest view
/// by noise.
#[test]
fn mosaics_are_feathered_or_medians_on_request() {
    let folder = tempfile::tempdir().unwrap();
    let mosaic = |rule: &str| {
        let out = folder.path().join(format!("{rule}.tif"));
        let mut command = skysweep();
        command.arg("ortho").args(["view_1.tif", "view_2.tif", "view_3.tif"].map(sample)).arg("--dsm");
        command.arg(sample("truth/dsm.tif")).arg("-o").arg(&out).args(["--gsd", "1", "--mosaic", rule, "-q"]);
        command.assert().code(0);
        (band(&out, 1), band(&folder.path().join(format!("{rule}_mask.tif")), 2))
    };
    let ((best, views), (feather, _), (median, _)) = (mosaic("best"), mosaic("feather"), mosaic("median"));
    // Two box filters of 17 cells reach 16 cells to each side.
    let near_seam = |x: usize, y: usize| {
        let (columns, rows) = (x.saturating_sub(16)..(x + 17).min(320), y.saturating_sub(16)..(y + 17).min(320));
        rows.into_iter().any(|r| columns.clone().any(|c| views[(c, r)] != views[(x, y)] && views[(c, r)] > 0.0))
    };
    let (mut changed, mut far) = (0, 0);
    for (x, y) in (0..320).flat_map(|y| (0..320).map(move |x| (x, y))).filter(|at| best[*at].is_finite()) {
        let is_near = near_seam(x, y);
        far += usize::from(!is_near);
        changed += usize::from(feather[(x, y)] != best[(x, y)]);
        assert!(is_near || feather[(x, y)] == best[(x, y)], "a cell far from seams changed: {x} {y}");
    }
    assert!(changed > 1000 && far > 1000, "{changed} cells changed, {far} lie far from seams");
    let mut differences: Vec<f32> =
        best.data().iter().zip(median.data()).map(|(a, b)| (a - b).abs()).filter(|d| d.is_finite()).collect();
    differences.sort_unstable_by(f32::total_cmp);
    let middle = differences[differences.len() / 2];
    assert!(middle > 0.0 && middle < 30.0, "the median difference is {middle}");
    for rule in ["best", "feather", "median"] {
        assert!(folder.path().join(format!("{rule}_report.html")).is_file());
    }
}

#[test]
fn what_makes_no_ortho_is_refused() {
    let folder = tempfile::tempdir().unwrap();
    let out = folder.path().join("ortho.tif");
    let (dsm, view) = (sample("truth/dsm.tif"), sample("view_1.tif"));
    let refused = |image: &Path, dsm: &Path, options: &[&str], words: &str| {
        let mut command = skysweep();
        command.arg("ortho").arg(image).arg("--dsm").arg(dsm).arg("-o").arg(&out).args(options);
        command.assert().code(2).stderr(predicate::str::contains(words.to_owned()));
        assert_eq!(std::fs::read_dir(folder.path()).unwrap().count(), 0, "nothing is written");
    };
    refused(&view, &dsm, &["--gsd", "0"], "--gsd");
    refused(&view, &dsm, &["--tolerance=-1"], "--tolerance");
    refused(&dsm, &dsm, &[], "RPC");
    refused(&view, &view, &[], "geotransform");
    refused(Path::new("none.tif"), &dsm, &[], "none.tif");
}

/// Bounds in other coordinates than the surface model's show nothing, which is an error and no
/// file.
#[test]
fn an_area_beside_the_surface_is_refused() {
    let folder = tempfile::tempdir().unwrap();
    let out = folder.path().join("ortho.tif");
    let mut command = skysweep();
    command.arg("ortho").arg(sample("view_1.tif")).arg("--dsm").arg(sample("truth/dsm.tif")).arg("-o").arg(&out);
    command.args(["--bounds", "100", "100", "200", "200", "--progress", "none", "-q"]);
    command.assert().code(2).stderr(predicate::str::contains("no image shows the area"));
    assert_eq!(std::fs::read_dir(folder.path()).unwrap().count(), 0);
}

/// Three bands of a colour image are red, green and blue in the ortho too.
#[test]
fn colours_keep_their_names() {
    use formats::raster::{Band, BandData, LumaRule, write_image_with_rpc};
    let folder = tempfile::tempdir().unwrap();
    let grey = formats::raster::ImageSource::open(sample("view_1.tif")).unwrap();
    let samples = grey.read_samples(1, grey.window()).unwrap().map(|v| *v as u16);
    let rpc = formats::rpc::read_for_image(&sample("view_1.tif")).unwrap().rpc;
    let bands = ["red", "green", "blue"].map(|description| Band { description, data: BandData::U16(&samples) });
    let (image, out) = (folder.path().join("colour.tif"), folder.path().join("ortho.tif"));
    write_image_with_rpc(&image, &bands, &rpc, Some(0.0), false).unwrap();
    let mut command = skysweep();
    command.arg("ortho").arg(&image).arg("--dsm").arg(sample("truth/dsm.tif")).arg("-o").arg(&out);
    command.args(["--gsd", "2", "--progress", "none", "-q"]).assert().code(0);
    let written = formats::raster::ImageSource::open(&out).unwrap();
    assert_eq!((written.info().luma.clone(), written.info().bands), (LumaRule::Rgb([1, 2, 3]), 4));
    let [red, alpha] = [1, 4].map(|number| written.read_samples(number, written.window()).unwrap());
    let right = |(red, alpha): (&f32, &f32)| {
        let has_colour = red.is_finite() && *red > 0.0;
        *alpha == if has_colour { 65_535.0 } else { 0.0 }
    };
    assert!(red.data().iter().zip(alpha.data()).all(right), "the alpha band marks what has a colour");
    let shown = alpha.data().iter().filter(|a| **a > 0.0).count();
    assert!(shown > 20_000 && shown < alpha.data().len(), "{shown} cells are shown");
    // The bytes of a TIFF whose photometric interpretation is RGB (tag 262, value 2).
    let bytes = std::fs::read(&out).unwrap();
    assert!(bytes.windows(10).any(|entry| entry == [6, 1, 3, 0, 1, 0, 0, 0, 2, 0]), "no RGB in the TIFF");
}

/// The surface is made from panchromatic images, and the colours come from the multispectral image
/// of the same pass, which the run did not use.
#[test]
fn a_multispectral_image_follows_the_panchromatic_one_of_its_pass() {
    use camera::ImagePoint;
    use formats::raster::{Band, BandData, ImageSource, write_image_with_rpc};
    let folder = tempfile::tempdir().unwrap();
    let (run, coarse) = (folder.path().join("run"), folder.path().join("multispectral.tif"));
    let mut command = skysweep();
    command.arg("dsm").args([1, 2, 3].map(|i| sample(&format!("view_{i}.tif")))).arg("-o").arg(&run);
    command.args(["--preset", "fast", "--gsd", "1", "--progress", "none", "-q"]).assert().code(0);
    // A quarter of the resolution, from another corner, with the pointing error of its pass.
    let pan = ImageSource::open(sample("view_1.tif")).unwrap();
    let window = raster::Window { x: 8, y: 16, width: 720, height: 720 };
    let mut samples = pan.read_samples(1, window).unwrap();
    (0..2).for_each(|_| samples = raster::reduce(&samples));
    let rpc = formats::rpc::read_for_image(&sample("view_1.tif")).unwrap().rpc;
    let rpc = rpc.cropped(ImagePoint::new(8.0, 16.0)).rescaled(0.25);
    let samples = samples.map(|v| v.round() as u16);
    let bands = ["blue", "green", "red", "nir"].map(|description| Band { description, data: BandData::U16(&samples) });
    write_image_with_rpc(&coarse, &bands, &rpc, Some(0.0), false).unwrap();
    let ortho = |image: &Path, name: &str, corrections: &[&str]| {
        let out = folder.path().join(name);
        let mut command = skysweep();
        command.arg("ortho").arg(image).arg("--dsm").arg(&run).arg("-o").arg(&out).args(["--gsd", "2"]);
        command.args(corrections).args(["--progress", "none", "--json"]);
        let text = String::from_utf8(command.assert().code(0).get_output().stdout.clone()).unwrap();
        (band(&out, 1), serde_json::from_str::<Value>(&text).unwrap())
    };
    let (fine, _) = ortho(&sample("view_1.tif"), "fine.tif", &[]);
    let (followed, report) = ortho(&coarse, "followed.tif", &[]);
    assert_eq!(report["images"][0]["corrected"], true, "{report}");
    let (alone, _) = ortho(&coarse, "alone.tif", &["--corrections", "none"]);
    let difference = |other: &Grid<f32>| {
        let both = fine.data().iter().zip(other.data()).filter(|(a, b)| **a > 0.0 && **b > 0.0);
        let squares: Vec<f32> = both.map(|(a, b)| (a - b).powi(2)).collect();
        assert!(squares.len() > 10_000, "{}", squares.len());
        (squares.iter().sum::<f32>() / squares.len() as f32).sqrt()
    };
    let (with, without) = (difference(&followed), difference(&alone));
    assert!(with < 0.9 * without, "{with} {without}");
}
