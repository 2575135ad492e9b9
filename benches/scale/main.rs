//! Cost and memory of large scenes: `cargo bench --bench scale [-- SIDE… --memory MB --preset NAME
//! --folder DIR --out DIR]`.
//!
//! Pairs of SIDE × SIDE pixels (4096, 8192, 12288 and 20000 when none is named) show a town that
//! repeats itself every 2048 pixels (see `town`), as a GDAL mosaic (VRT) of one rendered tile per
//! view: pixels are decoded window by window as from any file, and a pair of 800 megapixels takes
//! 30 MB of disk. The release binary runs as a user would run it with `--memory`. Processor
//! seconds, wall seconds and the largest resident memory of the command go to
//! `benches/results/scale.md`, with the error against the heights of the town, without alignment. A
//! side that is named several times runs as often, and its means are reported: `4096 20000 4096`
//! separates a machine that slows down from a cost that grows. Results of runs with named sides are
//! written only with `--out`.

#![allow(clippy::print_stdout, reason = "a bench tells its results")]

#[path = "../common/machine.rs"]
mod machine;
#[path = "../common/mosaic.rs"]
mod mosaic;
#[path = "../common/places.rs"]
mod places;
#[path = "../common/timed.rs"]
mod timed;
#[path = "../common/town.rs"]
mod town;
#[path = "../common/town_errors.rs"]
mod town_errors;

use std::fmt::Write as _;
use std::path::{Path, PathBuf};

use anyhow::{Context, ensure};
use timed::Timed;
use town::{Frame, Look};

/// Pixel and cell, metres.
const GSD_M: f64 = 0.5;
/// Slants of the two views. Their directions differ by 27°, as in a forward and a backward view of
/// one pass.
const SLANTS: [[f64; 2]; 2] = [[0.12, 0.22], [0.05, -0.26]];
/// The error is measured at every n-th cell of every n-th row.
const EVERY: usize = 3;

fn main() -> anyhow::Result<()> {
    let arguments = arguments()?;
    let temporary = tempfile::tempdir()?;
    let folder = arguments.folder.as_deref().unwrap_or(temporary.path());
    std::fs::create_dir_all(folder)?;
    let mut rows = Vec::new();
    for &side in &arguments.sides {
        let images = images(folder, side)?;
        let row = measure(folder, &images, side, &arguments)?;
        println!("{}", line(&row));
        rows.push(row);
    }
    let text = markdown(&means(rows)?, &arguments);
    println!("{text}");
    if let Some(out) = &arguments.out {
        std::fs::write(out.join("scale.md"), text)?;
    }
    Ok(())
}

struct Arguments {
    sides: Vec<usize>,
    memory_mb: u64,
    preset: String,
    folder: Option<PathBuf>,
    out: Option<PathBuf>,
    asked: String,
}

fn arguments() -> anyhow::Result<Arguments> {
    let given: Vec<String> = std::env::args().skip(1).filter(|a| a != "--bench").collect();
    let mut found = Arguments {
        sides: Vec::new(),
        memory_mb: 2000,
        preset: "balanced".to_owned(),
        folder: None,
        out: None,
        asked: given.join(" "),
    };
    let mut rest = given.iter();
    while let Some(argument) = rest.next() {
        let mut value = || rest.next().with_context(|| format!("{argument} needs a value"));
        match argument.as_str() {
            "--memory" => found.memory_mb = value()?.parse()?,
            "--preset" => found.preset.clone_from(value()?),
            "--folder" => found.folder = Some(value()?.into()),
            "--out" => found.out = Some(value()?.into()),
            side => found.sides.push(side.parse().with_context(|| format!("{side} is no side in pixels"))?),
        }
    }
    if found.sides.is_empty() {
        found.sides = vec![4096, 8192, 12_288, 20_000];
        found.out.get_or_insert_with(|| Path::new(env!("CARGO_MANIFEST_DIR")).join("benches/results"));
    }
    Ok(found)
}

/// Writes the two images of a side.
fn images(folder: &Path, side: usize) -> anyhow::Result<Vec<PathBuf>> {
    let image = |(view, slant): (u64, [f64; 2])| {
        let look = Look { slant, gsd_m: GSD_M, passing: (0.0, 0), noise: view };
        let tile = mosaic::tile(folder, &format!("tile_{view}.tif"), &look, [side; 2])?;
        mosaic::image(folder, &format!("view_{view}_{side}"), &tile, &look, &Frame::square(side))
    };
    (0..).zip(SLANTS).map(image).collect()
}

/// Cost and accuracy of one run.
struct Row {
    side: usize,
    chunks: String,
    user_s: f64,
    system_s: f64,
    wall_s: f64,
    peak_mb: f64,
    mae_m: f64,
    /// Share of the cells that are right to a metre, voids counted as wrong, percent.
    right: f64,
}

impl Row {
    /// Megapixels of both images together.
    fn megapixels(&self) -> f64 {
        SLANTS.len() as f64 * (self.side * self.side) as f64 / 1e6
    }

    /// User and system seconds per megapixel.
    fn cost(&self) -> f64 {
        (self.user_s + self.system_s) / self.megapixels()
    }
}

fn measure(folder: &Path, images: &[PathBuf], side: usize, arguments: &Arguments) -> anyhow::Result<Row> {
    let out = folder.join("out");
    let options = ["--gsd", &GSD_M.to_string(), "--preset", &arguments.preset];
    let Timed { report, user_s, system_s, wall_s } = timed::dsm(images, &out, arguments.memory_mb, &options)?;
    let (mae_m, right) = errors_of(&out.join("dsm/dsm.tif"), side)?;
    let chunk = |name: &str| report["chunks"][name].as_u64();
    let chunks = match (chunk("done"), chunk("side")) {
        (Some(done), Some(side)) => format!("{done} of ≤ {side}²"),
        _ => "1 (at once)".to_owned(),
    };
    let peak_mb = report["peak_memory_mb"].as_f64().unwrap_or(f64::NAN);
    Ok(Row { side, chunks, user_s, system_s, wall_s, peak_mb, mae_m, right })
}

/// Returns the mean absolute error of the cells with a height, metres, and the share of all cells
/// that are right to a metre, percent.
fn errors_of(dsm: &Path, side: usize) -> anyhow::Result<(f64, f64)> {
    let (mut sum, mut known, mut right, mut all) = (0.0, 0u64, 0u64, 0u64);
    town_errors::each(dsm, [side as f64 * GSD_M; 2], EVERY, |_, error| {
        all += 1;
        if error.is_finite() {
            (sum, known) = (sum + error.abs(), known + 1);
            right += u64::from(error.abs() < 1.0);
        }
    })?;
    ensure!(known > 0, "the DSM has no height");
    Ok((sum / known as f64, 100.0 * right as f64 / all as f64))
}

/// Returns one row for each side, the smallest first, with mean times and the greatest peak.
/// Everything else must be the same in all runs.
fn means(mut rows: Vec<Row>) -> anyhow::Result<Vec<Row>> {
    rows.sort_by_key(|r| r.side);
    let mut out: Vec<Row> = Vec::new();
    for runs in rows.chunk_by(|a, b| a.side == b.side) {
        let results = |r: &Row| (r.chunks.clone(), r.mae_m.to_bits(), r.right.to_bits());
        ensure!(runs.iter().all(|r| results(r) == results(&runs[0])), "runs of {} pixels differ", runs[0].side);
        let mean = |of: fn(&Row) -> f64| runs.iter().map(of).sum::<f64>() / runs.len() as f64;
        out.push(Row {
            chunks: runs[0].chunks.clone(),
            user_s: mean(|r| r.user_s),
            system_s: mean(|r| r.system_s),
            wall_s: mean(|r| r.wall_s),
            peak_mb: runs.iter().map(|r| r.peak_mb).fold(0.0, f64::max),
            ..runs[0]
        });
    }
    Ok(out)
}

fn line(r: &Row) -> String {
    format!(
        "| {} | {:.0} | {} | {:.0} | {:.0} | {:.3} | {:.0} | {:.0} | {:.3} | {:.2} |",
        r.side,
        r.megapixels(),
        r.chunks,
        r.user_s,
        r.system_s,
        r.cost(),
        r.wall_s,
        r.peak_mb,
        r.mae_m,
        r.right
    )
}

fn markdown(rows: &[Row], arguments: &Arguments) -> String {
    let mut out = format!(
        "# Large scenes\n\n\
         Written by `cargo bench --bench scale -- {}` on {}. A pair of SIDE × SIDE pixels at {} m, preset \
         {}, `--memory {}`; the images are mosaics of one rendered tile per view (a town that repeats itself every \
         2048 pixels; see `benches/common/town.rs`), the truth is the town's own height function, nothing is aligned. \
         CPU is user and system time of the command, megapixels are those of both images, peak is the largest \
         resident memory; sides that were run several times have the means of their times.\n\n\
         | side px | Mpx | chunks | user s | system s | CPU s/Mpx | wall s | peak MB | MAE m | < 1 m % \
         |\n|--:|--:|:--|--:|--:|--:|--:|--:|--:|--:|\n",
        arguments.asked,
        machine::machine(),
        GSD_M,
        arguments.preset,
        arguments.memory_mb
    );
    rows.iter().for_each(|r| out += &(line(r) + "\n"));
    let costs: Vec<f64> = rows.iter().filter(|r| !r.chunks.contains("at once")).map(Row::cost).collect();
    let peaks: Vec<f64> = rows.iter().filter(|r| !r.chunks.contains("at once")).map(|r| r.peak_mb).collect();
    let spread = |v: &[f64]| {
        let (lo, hi) = v.iter().fold((f64::INFINITY, 0.0f64), |a, x| (a.0.min(*x), a.1.max(*x)));
        100.0 * (hi / lo - 1.0)
    };
    if costs.len() > 1 {
        let _ = writeln!(
            out,
            "\nOver the runs by chunks the greatest cost per megapixel is {:.0} % above the least, the greatest peak \
             {:.0} %.",
            spread(&costs),
            spread(&peaks)
        );
    }
    out
}
