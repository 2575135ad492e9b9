//! `skysweep dsm` by chunks: a town in one piece and in four has the same accuracy, no seam
//! shows, overlapping bounds agree, and threads change nothing. `cargo bench --bench scale`
//! measures time and memory of large scenes.

use std::path::Path;
use std::sync::LazyLock;

use raster::Grid;
use serde_json::Value;

use crate::common::{skysweep, small_town};

/// Runs `skysweep dsm` on the small town with further options; returns its report.
fn run(out: &Path, options: &[&str]) -> Value {
    let views = ["view_1.tif", "view_2.tif", "view_3.tif"].map(small_town);
    let mut command = skysweep();
    command.arg("dsm").args(views).arg("-o").arg(out).args(["-q", "--json"]).args(options);
    let output = command.assert().code(0).get_output().stdout.clone();
    serde_json::from_slice(&output).unwrap()
}

/// The town in one piece and in four.
struct Both {
    folder: tempfile::TempDir,
    reports: [Value; 2],
}

static BOTH: LazyLock<Both> = LazyLock::new(|| {
    let folder = tempfile::tempdir().unwrap();
    let once = run(&folder.path().join("once"), &[]);
    let side = once["surface"]["cells"].as_u64().unwrap().isqrt() / 2 + 30;
    let four = run(&folder.path().join("four"), &["--chunk", &side.to_string()]);
    Both { folder, reports: [once, four] }
});

impl Both {
    fn dsm(&self, name: &str) -> Grid<f32> {
        formats::raster::read_dem(self.folder.path().join(name).join("dsm/dsm.tif")).unwrap().heights
    }

    fn completeness(&self, name: &str) -> f64 {
        let output = skysweep()
            .arg("eval")
            .arg(self.folder.path().join(name).join("dsm/dsm.tif"))
            .arg(small_town("truth/dsm.tif"))
            .args(["--align", "xyz", "--json", "--no-report"])
            .output()
            .unwrap();
        let report: Value = serde_json::from_slice(&output.stdout).unwrap();
        report["metrics"]["completeness_1"].as_f64().unwrap()
    }
}

#[test]
fn four_chunks_are_as_right_as_one() {
    let [once, four] = &BOTH.reports;
    assert!(once["chunks"].is_null());
    assert_eq!((four["chunks"]["done"].as_u64(), &four["chunks"]["failed"]), (Some(4), &Value::Array(Vec::new())));
    let (a, b) = (BOTH.completeness("once"), BOTH.completeness("four"));
    assert!((a - b).abs() < 0.002, "{a} in one piece, {b} in four");
    let count = |r: &Value, name: &str| r["surface"][name].as_f64().unwrap();
    assert_eq!(count(once, "cells"), count(four, "cells"));
    let sum: f64 = ["observed", "filled", "void"].iter().map(|n| count(four, n)).sum();
    assert_eq!(sum, count(four, "cells"));
    assert!((count(once, "observed") / count(four, "observed") - 1.0).abs() < 0.002);
    for file in ["dsm/sigma.tif", "dsm/views.tif", "dsm/filled.tif", "dsm/confidence.tif", "dsm/relief.png"] {
        assert!(BOTH.folder.path().join("four").join(file).is_file(), "{file} is missing");
    }
    assert!(!BOTH.folder.path().join("four/.skysweep-partial").exists());
}

/// Steps between neighbouring cells across the seams are the same as without seams.
#[test]
fn no_seam_shows() {
    let (once, four) = (BOTH.dsm("once"), BOTH.dsm("four"));
    let (w, h) = (four.width(), four.height());
    assert_eq!((once.width(), once.height()), (w, h));
    let vertical = (0..h).map(|y| ((w / 2 - 1, y), (w / 2, y)));
    let horizontal = (0..w).map(|x| ((x, h / 2 - 1), (x, h / 2)));
    let pairs: Vec<_> = vertical.chain(horizontal).collect();
    // Known pairs, their median step, and the share of them that are jumps.
    let steps = |g: &Grid<f32>| {
        let mut all: Vec<f32> = pairs.iter().map(|(a, b)| (g[*a] - g[*b]).abs()).filter(|d| d.is_finite()).collect();
        all.sort_by(f32::total_cmp);
        let jumps = all.len() - all.partition_point(|d| *d <= 0.5);
        (all.len(), all[all.len() / 2], jumps as f32 / all.len() as f32)
    };
    let (a, b) = (steps(&once), steps(&four));
    assert!(2 * a.0 > pairs.len() && a.0.abs_diff(b.0) * 50 < a.0, "{a:?} in one piece, {b:?} across seams");
    assert!((a.1 - b.1).abs() < 0.01 && (a.2 - b.2).abs() < 0.01, "{a:?} in one piece, {b:?} across seams");
    // Height by height: blocks lie elsewhere, and paths of the aggregation end at the rim.
    let near = |d: f32| d.is_finite() && d.abs() <= 0.3;
    let known = once.data().iter().zip(four.data()).filter(|(a, b)| !(a.is_nan() && b.is_nan()));
    let (same, all) = known.fold((0, 0), |(s, n), (a, b)| (s + usize::from(near(a - b)), n + 1));
    assert!(same * 100 >= 99 * all, "{same} of {all} cells are the same");
    let apart = share_apart(&once, &four);
    assert!(apart < 0.005, "{:.2} % of the cells are more than a metre apart", 100.0 * apart);
}

/// Returns the share of the cells with two heights that are more than a metre apart.
fn share_apart(a: &Grid<f32>, b: &Grid<f32>) -> f64 {
    let apart: Vec<f32> = a.data().iter().zip(b.data()).map(|(a, b)| (a - b).abs()).filter(|d| d.is_finite()).collect();
    assert!(apart.len() > 1000, "{} cells have two heights", apart.len());
    apart.iter().filter(|d| **d > 1.0).count() as f64 / apart.len() as f64
}

/// Pointing is a property of the images: chunks and presets leave every bit of it.
#[test]
fn pointing_is_the_same_for_every_preset_and_chunk() {
    let folder = tempfile::tempdir().unwrap();
    let pointing = |name: &str, options: &[&str]| {
        let out = folder.path().join(name);
        let mut command = skysweep();
        command.arg("plan").args(["view_1.tif", "view_2.tif", "view_3.tif"].map(small_town)).arg("-o").arg(&out);
        command.args(["-q", "--height-range", "160", "300"]).args(options).assert().code(0);
        let text = std::fs::read(out.join("pointing.json")).unwrap();
        let plan: Value = serde_json::from_slice(&text).unwrap();
        let corrections: Vec<Value> =
            plan["images"].as_array().unwrap().iter().map(|image| image["correction"].clone()).collect();
        assert!(corrections.len() == 3 && corrections.iter().all(|c| !c.is_null()), "{plan}");
        corrections
    };
    let whole = pointing("whole", &[]);
    assert_eq!(whole, pointing("chunks", &["--chunk", "300"]));
    assert_eq!(whole, pointing("fast", &["--preset", "fast"]));
    assert_eq!(whole, pointing("fast_chunks", &["--preset", "fast", "--chunk", "200", "--memory", "1000"]));
}

#[test]
fn fast_chunks_have_the_heights_of_one_piece() {
    let folder = tempfile::tempdir().unwrap();
    let heights = |name: &str, options: &[&str]| {
        let out = folder.path().join(name);
        run(&out, &[&["--preset", "fast"], options].concat());
        formats::raster::read_dem(out.join("dsm/dsm.tif")).unwrap().heights
    };
    let apart = share_apart(&heights("once", &[]), &heights("chunks", &["--chunk", "200"]));
    assert!(apart < 0.005, "{:.2} % of the cells are more than a metre apart", 100.0 * apart);
}

/// Pointing, noise and heights come from the whole scene, whatever the bounds.
#[test]
fn overlapping_bounds_agree_where_they_overlap() {
    let whole = formats::raster::read_dem(BOTH.folder.path().join("once/dsm/dsm.tif")).unwrap();
    let (columns, rows) = (whole.heights.width(), whole.heights.height());
    let folder = tempfile::tempdir().unwrap();
    let part = |name: &str, from: usize, to: usize| {
        let (x_min, y_max) = whole.geotransform.map_from_cell(from as f64 - 0.5, -0.5);
        let (x_max, y_min) = whole.geotransform.map_from_cell(to as f64 - 0.5, rows as f64 - 0.5);
        let bounds = [x_min, y_min, x_max, y_max].map(|v| v.to_string());
        let out = folder.path().join(name);
        let mut options = vec!["--bounds"];
        options.extend(bounds.iter().map(String::as_str));
        assert!(run(&out, &options)["chunks"].is_null());
        formats::raster::read_dem(out.join("dsm/dsm.tif")).unwrap().heights
    };
    let (first, last) = (columns / 3, columns * 2 / 3);
    let (west, east) = (part("west", 0, last), part("east", first, columns));
    assert_eq!((west.width(), east.width(), west.height()), (last, columns - first, rows));
    let cut = |heights: &Grid<f32>, from: usize| {
        let cells = (0..rows).flat_map(|y| &heights.row(y)[from..][..last - first]).copied().collect();
        Grid::from_vec(last - first, rows, cells).unwrap()
    };
    let shared = [cut(&whole.heights, first), cut(&west, first), cut(&east, 0)];
    for (a, b) in [(0, 1), (0, 2), (1, 2)] {
        let apart = share_apart(&shared[a], &shared[b]);
        assert!(apart < 0.005, "runs {a} and {b}: {:.2} % of the cells are more than a metre apart", 100.0 * apart);
    }
}

#[test]
fn threads_do_not_change_a_byte_of_chunks() {
    let folder = tempfile::tempdir().unwrap();
    let bytes = |name: &str, threads: &str| {
        let out = folder.path().join(name);
        run(&out, &["--chunk", "200", "--gsd", "1", "--preset", "fast", "--threads", threads]);
        ["dsm/dsm.tif", "dsm/sigma.tif", "dsm/views.tif", "dsm/filled.tif"].map(|f| std::fs::read(out.join(f)).unwrap())
    };
    assert!(bytes("one", "1") == bytes("two", "2"), "two threads give other bytes than one");
}
