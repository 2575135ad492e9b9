//! `--threads`: how many workers share what can be done side by side.

use anyhow::{Context, ensure};

/// Starts as many workers as were asked for; without a number there are as many as cores. Once per process.
pub(crate) fn start(threads: Option<usize>) -> anyhow::Result<()> {
    let Some(threads) = threads else { return Ok(()) };
    ensure!(threads > 0, "--threads is 0, expected 1 or more");
    rayon::ThreadPoolBuilder::new().num_threads(threads).build_global().context("cannot start the threads")
}
