//! What a run needs of memory, and what it took.
//!
//! The estimate is the greatest of the stages' needs: while a view is swept all images and heights are there, while the
//! views are placed on the grid all their vertices too, and at the end only vertices and the grid. `benches/results/scale.md`
//! holds it against measured peaks.

use crate::config::DsmConfig;
use crate::error::PipelineError;

/// Memory to stay under where none is given, megabytes: what any machine of today has.
const DEFAULT_MB: u64 = 4000;
/// What the libraries take before anything is done, GDAL's blocks and the program's buffers among it, bytes.
const BASE: u64 = 200_000_000;
/// Bytes per pixel of a view from its reading to its placement: the image with its pyramid (16/3), the heights of two
/// levels with deviation, confidence and support (16 + 4), the hypotheses' ranges (6) with what they are found from (4),
/// and the placed vertices, which come when the ranges have gone (20 − 10).
const BYTES_PER_PIXEL: u64 = 46;
/// Bytes per cell of the grid: four results twice, before and after the clean-up (26), with a void's surroundings in up to
/// half of the cells (48).
const BYTES_PER_CELL: u64 = 74;
/// Bytes per pixel of one block in work: about 24 hypotheses, each a cost and a sum, plus layout.
const BYTES_PER_BLOCK_PIXEL: u64 = 24 * 3 + 9;
/// Pixels of a whole block with its margins.
const BLOCK_PIXELS: u64 = 1120 * 1120;

/// The limit of a run, megabytes.
pub(crate) fn limit_mb(config: &DsmConfig) -> u64 {
    config.memory_mb.unwrap_or(DEFAULT_MB)
}

/// What it takes to sweep views of so many pixels onto so many cells at once, megabytes.
pub(crate) fn needed_mb(pixels: &[u64], cells: u64) -> u64 {
    let all = pixels.iter().fold(0, |sum: u64, p| sum.saturating_add(*p));
    let largest = pixels.iter().copied().max().unwrap_or(0);
    let blocks = BYTES_PER_BLOCK_PIXEL * BLOCK_PIXELS.min(largest) * rayon::current_num_threads() as u64;
    let bytes = all.saturating_mul(BYTES_PER_PIXEL).saturating_add(cells.saturating_mul(BYTES_PER_CELL));
    BASE.saturating_add(blocks).saturating_add(bytes) / 1_000_000
}

/// Refuses what does not fit the limit.
///
/// # Errors
/// [`PipelineError::Memory`].
pub(crate) fn check(config: &DsmConfig, needed_mb: u64) -> Result<(), PipelineError> {
    let limit_mb = limit_mb(config);
    if needed_mb > limit_mb { Err(PipelineError::Memory { needed_mb, limit_mb }) } else { Ok(()) }
}

/// The largest resident size of the process so far, megabytes, where the system tells (Linux).
pub(crate) fn peak_mb() -> Option<f64> {
    let status = std::fs::read_to_string("/proc/self/status").ok()?;
    let line = status.lines().find(|l| l.starts_with("VmHWM:"))?;
    let kilobytes: f64 = line.split_whitespace().nth(1)?.parse().ok()?;
    Some(kilobytes / 1000.0)
}
