//! The DSM job on real satellite images, against references: `cargo bench --bench real_scenes [-- NAME…]`.
//!
//! Reads `../shared/data/stereo` (skips with a line where it is absent), runs the release binary with default options
//! as a user would, and writes `benches/results/real_scenes.{json,md}`: accuracy by `skysweep eval`, processor seconds
//! (user) of the whole command, wall seconds, and peak memory. Medians of `RUNS` runs.

#![allow(clippy::print_stdout, reason = "a bench tells its results")]

mod pyramid;
mod run;
mod scenes;
mod table;

use std::path::{Path, PathBuf};

/// Runs per scene: the machine is noisy, the median of three is not.
const RUNS: usize = 3;

fn main() -> anyhow::Result<()> {
    let root = Path::new(env!("CARGO_MANIFEST_DIR"));
    let data = root.join("../shared/data/stereo");
    if !data.is_dir() {
        println!("real_scenes: skipped, no data at {}", data.display());
        return Ok(());
    }
    let wanted: Vec<String> = std::env::args().skip(1).filter(|a| !a.starts_with('-')).collect();
    let mut rows = Vec::new();
    for scene in scenes::all(&data) {
        if !wanted.is_empty() && !wanted.iter().any(|w| scene.name.contains(w.as_str())) {
            continue;
        }
        let row = measure(&scene)?;
        println!("{}", table::line(&row));
        rows.push(row);
    }
    if wanted.is_empty() {
        table::write(&root.join("benches/results"), &rows)?;
    }
    Ok(())
}

fn measure(scene: &scenes::Scene) -> anyhow::Result<table::Row> {
    let folder = tempfile::tempdir()?;
    let out: PathBuf = folder.path().join("out");
    let mut runs = Vec::with_capacity(RUNS);
    for _ in 0..RUNS {
        runs.push(run::dsm(scene, &out)?);
    }
    let dsm = out.join("dsm/dsm.tif");
    let results = match &scene.truth {
        scenes::Truth::Raster { path, test_vertical } => run::evaluate(&dsm, path, *test_vertical)?,
        scenes::Truth::Pyramid { peer } => {
            let mut both = pyramid::measure(&dsm)?;
            both.extend(pyramid::measure(peer)?.into_iter().map(|(name, value)| (format!("s2p_{name}"), value)));
            both
        }
    };
    Ok(table::Row::new(scene, &runs, results))
}
