//! What a run needs of memory, and what it took.
//!
//! The estimate is the greatest of the stages' needs: while a view is swept all images and heights are there, while the
//! views are placed on the grid all their vertices too, and at the end only vertices and the grid. `benches/results/scale.md`
//! holds it against measured peaks.

use crate::dsm::config::DsmConfig;
use crate::error::PipelineError;

/// Memory to stay under where none is given, megabytes: what any machine of today has.
const DEFAULT_MB: u64 = 4000;
/// What the libraries take before anything is done, GDAL's blocks and the program's buffers among it, bytes.
const BASE: u64 = 200_000_000;
/// Bytes per pixel of all views while one is swept: the image with its pyramid (16/3), the heights of two levels with
/// deviation, confidence and support (16 + 4), the hypotheses' ranges and steep surfaces (10) with what they are found from (4).
const SWEPT_BYTES_PER_PIXEL: u64 = 40;
/// … while they are placed on the grid: the image, the heights (16), the vertices (20), and what says which pixels count (5).
const PLACED_BYTES_PER_PIXEL: u64 = 47;
/// … and when only the vertices are left.
const VERTEX_BYTES_PER_PIXEL: u64 = 20;
/// Bytes per cell while views are placed: what no view can see.
const PLACED_BYTES_PER_CELL: u64 = 2;
/// Bytes per cell at the end: four results twice, before and after the clean-up (26), with a void's surroundings in up to
/// half of the cells (48).
const FUSED_BYTES_PER_CELL: u64 = 74;
/// Bytes per pixel of one block in work: about 24 hypotheses, half as many again where a scene is rich in heights, with a byte of
/// cost each and one of what the first four directions add; and first heights, steep surfaces and offsets (12), edges and the
/// best costs (2).
const BYTES_PER_BLOCK_PIXEL: u64 = 36 * 2 + 14;
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
    let stage =
        |per_pixel: u64, per_cell: u64| all.saturating_mul(per_pixel).saturating_add(cells.saturating_mul(per_cell));
    let stages = [
        stage(SWEPT_BYTES_PER_PIXEL, 0).saturating_add(blocks),
        stage(PLACED_BYTES_PER_PIXEL, PLACED_BYTES_PER_CELL),
        stage(VERTEX_BYTES_PER_PIXEL, FUSED_BYTES_PER_CELL),
    ];
    BASE.saturating_add(stages.into_iter().fold(0, u64::max)) / 1_000_000
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
