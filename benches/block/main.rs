//! Cost, memory and accuracy of a block of many images: `cargo bench --bench block [-- --side
//! METRES --memory MB --folder DIR --out DIR]`.
//!
//! Sixty images in four strips on three dates show 4 × 4 km of a town at 1 m. Each strip is seen
//! five times on each date. Every RPC is off by a shift and by a drift along the lines, and other
//! dates show other fine texture. The release binary runs as a user would run it. Besides the whole
//! block, a part of it is computed from all images and from four images at a time, the best of
//! which is the measure of completeness. Results go to `benches/results/block.md` for the whole
//! side, and elsewhere only with `--out`.

#![allow(clippy::print_stdout, reason = "a bench tells its results")]

#[path = "../common/control.rs"]
mod control;
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
use control::Control;
use geodesy::MapPoint;
use numeric::SplitMix64;
use serde_json::Value;
use timed::Timed;
use town::{Frame, Look};

const GSD_M: f64 = 1.0;
/// Side of the block where none is given, metres.
const SIDE_M: usize = 4096;
/// Strips side by side.
const STRIPS: usize = 4;
/// Ground that two neighbouring strips share, pixels.
const SHARED_PX: usize = 200;
/// Dates, each with the share of its own fine texture.
const DATES: usize = 3;
const PASSING: f64 = 0.12;
/// Slants of the five images of a pass, from the forward to the backward look.
const SLANTS: [[f64; 2]; 5] = [[0.10, 0.27], [0.12, 0.13], [0.06, -0.01], [0.10, -0.14], [0.03, -0.28]];
/// Further slants of the passes, across the track.
const ACROSS: [f64; DATES] = [0.0, -0.18, -0.05];
/// Largest shift and drift of the RPCs, pixels.
const SHIFT_PX: f64 = 4.0;
const DRIFT_PX: f64 = 1.5;
/// Table of the control points.
const CONTROL: &str = "control.csv";
/// Cells beside the border of a chunk.
const BESIDE: usize = 16;
/// The part that is also computed from four images: its corner and its side, metres from the upper
/// left of the block.
const PART_M: (f64, f64) = (600.0, 512.0);

fn main() -> anyhow::Result<()> {
    let arguments = arguments()?;
    let temporary = tempfile::tempdir()?;
    let folder = arguments.folder.as_deref().unwrap_or(temporary.path());
    std::fs::create_dir_all(folder)?;
    let images = images(folder, arguments.side)?;
    println!("{} images in {}", images.len(), folder.display());
    let whole = whole(folder, &images, &arguments)?;
    println!("{whole}");
    let strip = strip(folder, &arguments)?;
    println!("{strip}");
    let part = part(folder, &images, &arguments)?;
    println!("{part}");
    if let Some(out) = &arguments.out {
        std::fs::write(out.join("block.md"), format!("{whole}\n{strip}\n{part}"))?;
    }
    Ok(())
}

struct Arguments {
    /// Side of the block, metres.
    side: usize,
    memory_mb: u64,
    folder: Option<PathBuf>,
    out: Option<PathBuf>,
}

fn arguments() -> anyhow::Result<Arguments> {
    let mut found = Arguments { side: SIDE_M, memory_mb: 2000, folder: None, out: None };
    let mut rest = std::env::args().skip(1).filter(|a| a != "--bench");
    while let Some(argument) = rest.next() {
        let value = rest.next().with_context(|| format!("{argument} needs a value"))?;
        match argument.as_str() {
            "--side" => found.side = value.parse()?,
            "--memory" => found.memory_mb = value.parse()?,
            "--folder" => found.folder = Some(value.into()),
            "--out" => found.out = Some(value.into()),
            other => anyhow::bail!("{other} is no option of this bench"),
        }
    }
    if found.side == SIDE_M {
        found.out.get_or_insert_with(|| Path::new(env!("CARGO_MANIFEST_DIR")).join("benches/results"));
    }
    Ok(found)
}

/// Writes the images, one strip after the other, then one date after the other.
fn images(folder: &Path, side: usize) -> anyhow::Result<Vec<PathBuf>> {
    let side_px = (side as f64 / GSD_M) as usize;
    let mut random = SplitMix64::new(18);
    let mut control = Control::new([side as f64; 2]);
    let mut out = Vec::new();
    for (date, across) in ACROSS.iter().enumerate() {
        for (number, slant) in SLANTS.iter().enumerate() {
            let view = (date * SLANTS.len() + number) as u64;
            let slant = [slant[0] + across, slant[1]];
            let look = Look { slant, gsd_m: GSD_M, passing: (PASSING, 100 + date as u64), noise: view };
            let tile = mosaic::tile(folder, &format!("tile_{view}.tif"), &look, [side_px; 2])?;
            for strip in 0..STRIPS {
                let step = side_px / STRIPS;
                let first = [(strip * step).saturating_sub(SHARED_PX / 2), 0];
                let last = ((strip + 1) * step + SHARED_PX / 2).min(side_px);
                let mut within = |most: f64| [0; 2].map(|_| random.uniform_in(-most, most));
                let frame = Frame {
                    first,
                    size: [last - first[0], side_px],
                    shift_px: within(SHIFT_PX),
                    drift_px: within(DRIFT_PX),
                };
                let path = mosaic::image(folder, &format!("date{date}_strip{strip}_{number}"), &tile, &look, &frame)?;
                control.add(&path, &look, &frame);
                out.push(path);
            }
        }
    }
    control.write(&folder.join(CONTROL))?;
    out.sort();
    Ok(out)
}

/// Errors of a surface model, and those of its cells beside the borders of chunks.
struct Errors {
    all: Vec<f64>,
    beside: Vec<f64>,
}

impl Errors {
    fn of(run: &Path, side: usize, report: &Value) -> anyhow::Result<Self> {
        let dsm = run.join("dsm/dsm.tif");
        let info = formats::raster::ImageSource::open(&dsm)?.info().clone();
        let chunk = report["chunks"]["side"].as_u64().map_or(usize::MAX, |side| side as usize);
        // A side is cut into equal parts that are no longer than a chunk.
        let borders = |length: usize| -> Vec<usize> {
            let parts = length.div_ceil(chunk);
            (1..parts).map(|i| length * i / parts).collect()
        };
        let (columns, rows) = (borders(info.width), borders(info.height));
        let near = |at: usize, borders: &[usize]| borders.iter().any(|b| at.abs_diff(*b) <= BESIDE);
        let mut found = Self { all: Vec::new(), beside: Vec::new() };
        town_errors::each(&dsm, [side as f64; 2], 2, |(column, row), error| {
            found.all.push(error);
            if near(column, &columns) || near(row, &rows) {
                found.beside.push(error);
            }
        })?;
        ensure!(!found.all.is_empty(), "the surface model lies outside the block");
        Ok(found)
    }
}

/// Returns the mean absolute error of the cells with a height, metres, the share of cells with one,
/// and the share that is right to a metre, percent.
fn summary(errors: &[f64]) -> (f64, f64, f64) {
    let known: Vec<f64> = errors.iter().copied().filter(|e| e.is_finite()).map(f64::abs).collect();
    let share = |n: usize| 100.0 * n as f64 / errors.len() as f64;
    let right = known.iter().filter(|e| **e < 1.0).count();
    (known.iter().sum::<f64>() / known.len() as f64, share(known.len()), share(right))
}

/// Runs the command with the control points.
fn run(
    folder: &Path,
    name: &str,
    images: &[PathBuf],
    arguments: &Arguments,
    options: &[&str],
) -> anyhow::Result<Timed> {
    let (gsd, control) = (GSD_M.to_string(), folder.join(CONTROL));
    let mut all = vec!["--gsd", &gsd, "--control", control.to_str().context("the folder's name is not UTF-8")?];
    all.extend(options);
    timed::dsm(images, &folder.join(name), arguments.memory_mb, &all)
}

/// Computes the images of one strip as a scene of its own, with the same memory.
fn strip(folder: &Path, arguments: &Arguments) -> anyhow::Result<String> {
    let name = |date: usize, number: usize| folder.join(format!("date{date}_strip1_{number}.vrt"));
    let images: Vec<PathBuf> = (0..DATES).flat_map(|d| (0..SLANTS.len()).map(move |n| name(d, n))).collect();
    let Timed { report, user_s, system_s, .. } = run(folder, "strip", &images, arguments, &[])?;
    let cost = (user_s + system_s) / megapixels(&report);
    Ok(format!("One strip of {} images as a scene of its own: {cost:.2} CPU s per megapixel.\n", images.len()))
}

fn whole(folder: &Path, images: &[PathBuf], arguments: &Arguments) -> anyhow::Result<String> {
    let Timed { report, user_s, system_s, wall_s } = run(folder, "out", images, arguments, &[])?;
    let errors = Errors::of(&folder.join("out"), arguments.side, &report)?;
    let pixels = megapixels(&report);
    let pointing = &report["pointing"];
    let mut text = format!(
        "# A block of {} images\n\nWritten by `cargo bench --bench block` on {}: {} m at {GSD_M} m, {STRIPS} strips, \
         {DATES} dates, `--memory {}`. CPU is user and system time of the command, megapixels are those of all images. \
         Five \
         control points place the block; nothing is aligned afterwards.\n\n",
        images.len(),
        machine::machine(),
        arguments.side,
        arguments.memory_mb
    );
    writeln!(text, "| | |\n|:--|--:|")?;
    writeln!(text, "| megapixels | {pixels:.0} |")?;
    writeln!(text, "| chunks | {} of ≤ {}² |", report["chunks"]["done"], report["chunks"]["side"])?;
    writeln!(text, "| CPU s per megapixel | {:.2} |", (user_s + system_s) / pixels)?;
    writeln!(text, "| wall s | {wall_s:.0} |")?;
    writeln!(text, "| peak MB | {:.0} |", report["peak_memory_mb"].as_f64().unwrap_or(f64::NAN))?;
    for (name, key) in [("before", "residual_before_px"), ("after", "residual_after_px")] {
        writeln!(text, "| residual {name}, px RMS | {:.2} |", pointing[key].as_f64().unwrap_or(f64::NAN))?;
    }
    for (name, errors) in [("all cells", &errors.all), ("cells beside chunk borders", &errors.beside)] {
        let (mae, known, right) = summary(errors);
        writeln!(text, "| {name}: MAE m, with a height %, within 1 m % | {mae:.3}, {known:.2}, {right:.2} |")?;
    }
    Ok(text)
}

fn megapixels(report: &Value) -> f64 {
    let of = |image: &Value| Some(image["size"][0].as_f64()? * image["size"][1].as_f64()? / 1e6);
    report["images"].as_array().into_iter().flatten().filter_map(of).sum()
}

/// Computes a part from all images, and from four images of each date and of all dates.
fn part(folder: &Path, images: &[PathBuf], arguments: &Arguments) -> anyhow::Result<String> {
    let mut text =
        String::from("| images over the part | MAE m | with a height % | within 1 m % |\n|:--|--:|--:|--:|\n");
    let of = |date: usize, number: usize| -> Vec<PathBuf> {
        let name = |strip: usize| folder.join(format!("date{date}_strip{strip}_{number}.vrt"));
        (0..STRIPS).map(name).collect()
    };
    let mut choices = vec![("all".to_owned(), images.to_vec())];
    for date in 0..DATES {
        let four = [0, 1, 3, 4].iter().flat_map(|number| of(date, *number)).collect();
        choices.push((format!("four of date {date}"), four));
    }
    let mixed = [(0, 0), (0, 3), (1, 1), (2, 4)].iter().flat_map(|(date, number)| of(*date, *number)).collect();
    choices.push(("four of three dates".to_owned(), mixed));
    let bounds = bounds()?;
    for (name, images) in choices {
        let mut options = vec!["--bounds"];
        options.extend(bounds.iter().map(String::as_str));
        let Timed { report, .. } = run(folder, "part", &images, arguments, &options)?;
        let (mae, known, right) = summary(&Errors::of(&folder.join("part"), arguments.side, &report)?.all);
        writeln!(text, "| {name} | {mae:.3} | {known:.2} | {right:.2} |")?;
    }
    Ok(text)
}

/// Returns the bounds of the part in UTM, metres.
fn bounds() -> anyhow::Result<Vec<String>> {
    let projection = crs::MapProjection::from_epsg(32_631)?;
    let corner = |x: f64, y: f64| {
        let (lon, lat) =
            (town::ORIGIN.0 + x / town::METRES_PER_DEGREE[0], town::ORIGIN.1 + y / town::METRES_PER_DEGREE[1]);
        projection.map_from_lonlat(lon, lat)
    };
    let (first, side) = PART_M;
    let MapPoint { x: west, y: south } = corner(first, -first - side)?;
    let round = |v: f64| format!("{:.0}", v.round());
    Ok([west, south, west + side, south + side].map(round).to_vec())
}
