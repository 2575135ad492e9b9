//! Where the error comes from: `cargo bench --bench budget [-- SCENE…]` writes
//! `benches/results/budget.md`.
//!
//! Simulated scenes go through the stages of `skysweep dsm`. Step by step, the result of a stage is
//! replaced by the truth: the true pointing, the true heights as the range of the search, and the
//! true heights as input of the fusion; one step leaves out the regularisation. The heights of the
//! views are compared pixel by pixel with the truth, those of the surface cell by cell, without
//! alignment. Speckle removal and filling come after the stages that are measured here.

#![allow(clippy::print_stdout, reason = "a bench tells its results")]

mod kinds;
mod stages;

use std::fmt::Write as _;
use std::path::Path;

use anyhow::Context;
use simulate::{Simulation, SimulationConfig};

use kinds::{KINDS, Kinds, Tally};
use stages::{Known, Scene};

/// Scenes that run when none is named: preset and number of dates.
const SCENES: [(&str, usize); 5] = [("town", 1), ("town", 3), ("high-rise", 1), ("hills", 1), ("dense-city", 1)];
/// Side of the scenes, metres. It gives some hundred thousand pixels per view.
const SIZE_M: f64 = 240.0;
const VIEWS: usize = 3;
/// Planted pointing errors, pixels.
const POINTING_PX: [f64; 2] = [2.0, 2.0];

fn main() -> anyhow::Result<()> {
    let named: Vec<String> = std::env::args().skip(1).filter(|a| !a.starts_with("--")).collect();
    let mut text = introduction();
    for (preset, dates) in SCENES.iter().filter(|(preset, _)| named.is_empty() || named.iter().any(|n| n == preset)) {
        let table = budget(preset, *dates).with_context(|| format!("scene {preset}"))?;
        print!("{table}");
        text += &table;
    }
    let results = Path::new(env!("CARGO_MANIFEST_DIR")).join("benches/results");
    if named.is_empty() {
        std::fs::write(results.join("budget.md"), text)?;
    }
    Ok(())
}

fn introduction() -> String {
    format!(
        "Made by `cargo bench --bench budget`: {VIEWS} views of {SIZE_M} m with pointing errors of {} px, default \
         preset. Shares \
         of pixels or cells, in percent, that are off by more than a metre or have no height; in brackets the mean \
         absolute \
         error of those that have one, metres. Each pixel counts once, in the first class of the row that holds: \
         occluded (no \
         other view sees it; for cells, fewer than two views do), edge (within a metre of a jump of two), \
         vegetation, shadow, \
         roof, ground. Water does not count. What a line loses to the one below is what perfecting its stage could \
         gain.\n\n",
        POINTING_PX[0]
    )
}

/// Measures a scene and returns its table.
fn budget(preset: &str, dates: usize) -> anyhow::Result<String> {
    let mut config = SimulationConfig::preset(preset)?;
    (config.size_m, config.views) = (SIZE_M, VIEWS);
    config.acquisition.dates = dates;
    config.acquisition.pointing_error_px = POINTING_PX;
    let simulation = Simulation::new(config)?;
    let kinds = Kinds::new(&simulation);
    let given = Scene::new(&simulation, false)?;
    let scene = Scene::new(&simulation, true)?;
    let of_pixels = |known: Known, scene: &Scene<'_>| -> anyhow::Result<Tally> {
        Ok(kinds.of_pixels(&simulation, &scene.heights(known)?))
    };
    let of_cells = |heights: &[sweep::HeightMap], checked: bool| -> anyhow::Result<Tally> {
        Ok(kinds.of_cells(&simulation, &scene.fused(heights, checked)?))
    };
    let found = scene.heights(Known::Pointing)?;
    let rows = [
        ("pixels: RPCs as they are given", of_pixels(Known::Pointing, &given)?),
        ("pixels: true pointing", kinds.of_pixels(&simulation, &found)),
        ("pixels: true heights ± 4 steps as range", of_pixels(Known::Range, &scene)?),
        ("pixels: that, without regularisation", of_pixels(Known::RangeAlone, &scene)?),
        ("cells: all heights found with true pointing", of_cells(&found, false)?),
        ("cells: those that another view confirms", of_cells(&found, true)?),
        ("cells: true heights of all pixels", of_cells(&scene.true_heights(), false)?),
    ];
    let dates = if dates > 1 { format!(", {dates} dates") } else { String::new() };
    let mut out = format!("## {preset}{dates}\n\n| stage |");
    KINDS.iter().for_each(|kind| _ = write!(out, " {kind} |"));
    out += " all |\n|---|";
    out += &"---|".repeat(KINDS.len() + 1);
    for (name, tally) in &rows {
        _ = write!(out, "\n| {name} | {} |", tally.cells().join(" | "));
    }
    Ok(out + "\n\n")
}
