//! Speed against error of every preset on every scene: `cargo bench --bench scenes [-- NAME… --runs
//! N --out DIR]`.
//!
//! Simulated scenes are made first (`skysweep simulate`). Real scenes are read from
//! `../shared/data/stereo`, and scenes of another simulator from `../shared/data/sim`, or from the
//! folder that `SKYSWEEP_DATA` names. The release binary runs
//! with default options except for the preset; scenes with a measured truth also run without filled
//! voids and with all voids filled, so that other programs' surfaces are compared like with like.
//! All scenes and presets run once, then all run again, so that a machine that slows down slows
//! them all. `skysweep eval` measures the accuracy. Medians go to `benches/results/scenes.json`,
//! tables to `scenes.md`, plots to `scenes.svg`. When names choose only some scenes, nothing is
//! written without `--out`. Results of other programs come from `benches/results/peers.json` and
//! `cars.json`. `make readme` then brings the numbers into the README and the guide.

#![allow(clippy::print_stdout, reason = "a bench tells its results")]

#[path = "../common/machine.rs"]
mod machine;
mod matrix;
mod peers;
#[path = "../common/places.rs"]
mod places;
mod plot;
mod pyramid;
mod quality;
mod run;
mod scenes;
mod table;

use std::path::{Path, PathBuf};
use std::time::Instant;

use anyhow::Context;

/// Runs per scene and preset. Single times vary with the load of the machine; the median of three
/// hardly does.
const RUNS: usize = 3;

fn main() -> anyhow::Result<()> {
    let start = Instant::now();
    let root = Path::new(env!("CARGO_MANIFEST_DIR"));
    let Arguments { wanted, runs, out } = arguments()?;
    let folder = tempfile::tempdir()?;
    let (data, sim) = (places::shared_data().join("stereo"), places::shared_data().join("sim"));
    let mut all = scenes::simulated();
    for scene in scenes::independent(&sim) {
        if scene.folder.is_dir() {
            all.push(scene);
        } else {
            println!("skipped: scene {}: {} is absent", scene.name, scene.folder.display());
        }
    }
    if data.is_dir() {
        all.extend(scenes::real(&data));
    } else {
        println!("skipped: real scenes: {} is absent", data.display());
    }
    all.retain(|scene| wanted.is_empty() || wanted.iter().any(|w| scene.name.contains(w.as_str())));
    for scene in &mut all {
        scene.make(folder.path())?;
    }
    let mut rows = matrix::measure(&all, folder.path(), runs)?;
    let s2p_cpu_s = peers::s2p_cpu_s(root)?;
    rows.iter_mut().for_each(|row| row.s2p_cpu_s = s2p_cpu_s.get(row.scene).copied());
    let results = table::Results::new(rows, peers::all(root, &data)?, runs, start.elapsed());
    println!("{}", results.markdown());
    match out.or_else(|| wanted.is_empty().then(|| root.join("benches/results"))) {
        Some(folder) => results.write(&folder),
        None => Ok(()),
    }
}

/// The options of the command line.
struct Arguments {
    /// Parts of scene names. Scenes that contain none are left out; an empty list keeps all scenes.
    wanted: Vec<String>,
    runs: usize,
    out: Option<PathBuf>,
}

fn arguments() -> anyhow::Result<Arguments> {
    let mut found = Arguments { wanted: Vec::new(), runs: RUNS, out: None };
    let mut arguments = std::env::args().skip(1);
    while let Some(argument) = arguments.next() {
        match argument.as_str() {
            "--runs" => found.runs = arguments.next().context("--runs needs a number")?.parse::<usize>()?.max(1),
            "--out" => found.out = Some(arguments.next().context("--out needs a folder")?.into()),
            // Cargo passes this option to every bench.
            "--bench" => {}
            name => found.wanted.push(name.to_owned()),
        }
    }
    Ok(found)
}
