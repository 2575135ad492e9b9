//! Blocks of images in several strips and dates: `skysweep dsm` ties all images to one another by a
//! few pairs, chooses the sources of each chunk, and leaves no seam. `cargo bench --bench block`
//! measures a block of sixty images.

#[path = "../../benches/common/control.rs"]
mod control;
#[path = "../../benches/common/mosaic.rs"]
mod mosaic;
#[path = "../../benches/common/town.rs"]
mod town;
#[path = "../../benches/common/town_errors.rs"]
mod town_errors;

use std::path::{Path, PathBuf};
use std::sync::LazyLock;

use assert_cmd::Command;
use control::Control;
use numeric::SplitMix64;
use serde_json::Value;
use town::{Frame, Look};

/// Columns and lines of the block, pixels of a metre.
const SIZE: [usize; 2] = [640, 288];
/// First columns and widths of the two strips.
const STRIPS: [(usize, usize); 2] = [(0, 400), (240, 400)];
/// Slants of the three images of each pass.
const SLANTS: [[f64; 2]; 3] = [[0.10, 0.22], [0.05, 0.01], [0.04, -0.20]];
/// Further slants of the two passes, across the track.
const ACROSS: [f64; 2] = [0.0, -0.15];
/// Cells beside the border of a chunk.
const BESIDE: usize = 8;

/// The run of a block of twelve images by chunks.
struct Block {
    report: Value,
    plan: Value,
    /// Cells and errors, metres; NaN for a void.
    errors: Vec<((usize, usize), f64)>,
    _folder: tempfile::TempDir,
}

static BLOCK: LazyLock<Block> = LazyLock::new(|| {
    let folder = tempfile::tempdir().unwrap();
    let out = folder.path().join("run");
    let step = |name: &str| {
        let mut command = Command::cargo_bin("skysweep").unwrap();
        command.args([name, "-q"]);
        command
    };
    let mut plan = step("plan");
    plan.args(images(folder.path())).arg("-o").arg(&out).args(["--gsd", "1", "--chunk", "220"]);
    plan.arg("--control").arg(folder.path().join("control.csv")).assert().code(0);
    step("run").arg(&out).assert().code(0);
    step("merge").arg(&out).assert().code(0);
    let mut errors = Vec::new();
    let area_m = SIZE.map(|side| side as f64);
    town_errors::each(&out.join("dsm/dsm.tif"), area_m, 1, |cell, error| errors.push((cell, error))).unwrap();
    Block {
        report: json(&out.join("report/report.json")),
        plan: json(&out.join("plan.json"))["plan"].take(),
        errors,
        _folder: folder,
    }
});

fn json(path: &Path) -> Value {
    serde_json::from_slice(&std::fs::read(path).unwrap()).unwrap()
}

/// Writes the images, each with a shift and a drift of its own in the RPC.
fn images(folder: &Path) -> Vec<PathBuf> {
    let mut random = SplitMix64::new(5);
    let mut control = Control::new(SIZE.map(|side| side as f64));
    let mut out = Vec::new();
    for (date, across) in (0..).zip(ACROSS) {
        for (number, slant) in (0..).zip(SLANTS) {
            let view = 10 * date + number;
            let slant = [slant[0] + across, slant[1]];
            let look = Look { slant, gsd_m: 1.0, passing: (0.1, 100 + date), noise: view };
            let tile = mosaic::tile(folder, &format!("tile_{view}.tif"), &look, SIZE).unwrap();
            for (first, width) in STRIPS {
                let mut within = |most: f64| [0; 2].map(|_| random.uniform_in(-most, most));
                let (shift_px, drift_px) = (within(4.0), within(1.5));
                let frame = Frame { first: [first, 0], size: [width, SIZE[1]], shift_px, drift_px };
                let path = mosaic::image(folder, &format!("view_{view}_{first}"), &tile, &look, &frame).unwrap();
                control.add(&path, &look, &frame);
                out.push(path);
            }
        }
    }
    control.write(&folder.join("control.csv")).unwrap();
    out
}

/// Returns the share of cells that are right to a metre, percent.
fn right(errors: impl Iterator<Item = f64>) -> f64 {
    let is_right: Vec<bool> = errors.map(|error| error.abs() < 1.0).collect();
    assert!(is_right.len() > 1000, "{} cells are too few", is_right.len());
    100.0 * is_right.iter().filter(|r| **r).count() as f64 / is_right.len() as f64
}

#[test]
fn few_pairs_tie_all_images_to_one_another() {
    let pointing = &BLOCK.report["pointing"];
    let residual = pointing["residual_after_px"].as_f64().unwrap();
    assert!(residual < 0.3, "{pointing}");
    assert!(pointing["residual_before_px"].as_f64().unwrap() > 2.0, "{pointing}");
    let pairs = BLOCK.report["pairs"].as_array().unwrap();
    assert!(pairs.len() < 66, "all pairs are matched");
    let ties: Vec<u64> = pairs.iter().map(|pair| pair["ties"].as_u64().unwrap()).collect();
    assert!(ties.iter().filter(|n| **n >= 12).count() >= 20, "{ties:?}");
    assert!(BLOCK.report["warnings"].as_array().unwrap().is_empty(), "{}", BLOCK.report["warnings"]);
}

#[test]
fn a_chunk_uses_the_images_that_show_it() {
    let chunks = BLOCK.plan["chunks"].as_array().unwrap();
    let windows = |chunk: &Value| chunk["work"]["sweep"]["windows"].as_array().unwrap().clone();
    let sources = |chunk: &Value| chunk["work"]["sweep"]["sources"].as_array().unwrap().clone();
    for chunk in chunks {
        let (windows, sources) = (windows(chunk), sources(chunk));
        for (window, sources) in windows.iter().zip(&sources) {
            let sources = sources.as_array().unwrap();
            assert!(window.is_null() || !sources.is_empty(), "an image is read and has no source");
            assert!(sources.iter().all(|s| !windows[s.as_u64().unwrap() as usize].is_null()), "a source is not read");
        }
    }
    let used = |chunk: &Value| windows(chunk).iter().filter(|w| !w.is_null()).count();
    assert!(chunks.iter().any(|c| used(c) == 6) && chunks.iter().any(|c| used(c) == 12), "some chunks show one strip");
}

#[test]
fn the_surface_is_right_and_has_no_seams() {
    let borders = |corner: &str| -> Vec<usize> {
        let chunks = BLOCK.plan["chunks"].as_array().unwrap().iter();
        chunks.map(|c| c["core"][corner].as_u64().unwrap() as usize).filter(|at| *at > 0).collect()
    };
    let (columns, rows) = (borders("x"), borders("y"));
    let near = |at: usize, borders: &[usize]| borders.iter().any(|b| at.abs_diff(*b) <= BESIDE);
    let is_beside = |(column, row): (usize, usize)| near(column, &columns) || near(row, &rows);
    let all = right(BLOCK.errors.iter().map(|(_, error)| *error));
    let beside = right(BLOCK.errors.iter().filter(|(cell, _)| is_beside(*cell)).map(|(_, error)| *error));
    assert!(all > 90.0, "{all:.1} % are right to a metre");
    assert!(beside > all - 1.5, "{beside:.1} % beside the borders of chunks, {all:.1} % everywhere");
}
