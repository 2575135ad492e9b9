//! The memory that a run needs, and the memory that it took.
//!
//! The estimate is the largest need of three stages. While the views are swept, all images and
//! heights are in memory. While they are placed on the grid, all their vertices are too. At the end
//! only the vertices and the grid are left. `benches/results/scale.md` compares the estimate with
//! measured peaks.

use raster::Window;

use crate::config::DsmConfig;
use crate::error::DsmError;

/// Memory limit where none is given, megabytes: what any machine of today has.
const DEFAULT_MB: u64 = 4000;
/// Memory of libraries and buffers before anything is done, among it the block cache of GDAL,
/// bytes.
const BASE: u64 = 200_000_000;
/// Bytes per pixel of all views while they are swept: the image with its pyramid (16/3), the
/// heights of all levels with deviation, confidence and support (64/3).
const SWEPT_BYTES_PER_PIXEL: u64 = 27;
/// The same for each further lattice of pixels: its image (4) and heights (16).
const SWEPT_BYTES_PER_LATTICE: u64 = 20;
/// Bytes per pixel of a view in work: the ranges of hypotheses and steep surfaces (10) with their
/// inputs (4).
const RANGES_BYTES_PER_PIXEL: u64 = 14;
/// Views that a thread has in work: while it waits for blocks of one that others compute, it begins
/// another.
const VIEWS_PER_THREAD: usize = 2;
/// Bytes per pixel of a view that is placed on the grid, while others are not yet: the vertices
/// (20), the heights (4), and where the image shows something (2). One that is not yet has its
/// image and heights (20).
const PLACED_BYTES_PER_PIXEL: u64 = 26;
/// The same for each further lattice of pixels: vertices (20) and heights (4).
const PLACED_BYTES_PER_LATTICE: u64 = 24;
/// Bytes per pixel of the view that is being placed, besides: its vertices as tiles (20), the
/// weights of borders (8), and the masks of pixels that count (5), without what the others free.
const PLACING_BYTES_PER_PIXEL: u64 = 33;
/// Bytes per pixel when only the vertices are left, and where the images show something.
const VERTEX_BYTES_PER_PIXEL: u64 = 22;
/// The same for each further lattice of pixels.
const VERTEX_BYTES_PER_LATTICE: u64 = 20;
/// Bytes per cell while the views are placed: the mask of cells that no view can see.
const PLACED_BYTES_PER_CELL: u64 = 2;
/// Bytes per cell at the end: four results twice, before and after the clean-up (26), with the
/// surroundings of voids in up to half of the cells (48).
const FUSED_BYTES_PER_CELL: u64 = 74;
/// Bytes per pixel of one block in work: about 24 hypotheses, half as many again where a scene is
/// rich in heights, with one byte of cost each and one for the first four directions; first
/// heights, steep surfaces and offsets (12); edges and the best costs (2).
const BYTES_PER_BLOCK_PIXEL: u64 = 36 * 2 + 14;
/// Pixels of a whole block with its margins.
const BLOCK_PIXELS: u64 = 1120 * 1120;

/// Returns the memory limit of a run, megabytes.
pub(crate) fn limit_mb(config: &DsmConfig) -> u64 {
    config.memory_mb.unwrap_or(DEFAULT_MB)
}

/// Returns the number of pixels or cells of a window.
pub(crate) fn area(w: &Window) -> u64 {
    (w.width as u64).saturating_mul(w.height as u64)
}

/// Returns the memory needed to sweep views of `pixels` pixels each on `lattices` lattices onto
/// `cells` cells at once, megabytes.
pub(crate) fn needed_mb(pixels: &[u64], cells: u64, lattices: usize) -> u64 {
    let largest = pixels.iter().copied().max().unwrap_or(0);
    let threads = rayon::current_num_threads();
    let blocks = BYTES_PER_BLOCK_PIXEL * BLOCK_PIXELS.min(largest) * threads as u64;
    let views = pixels.len().min(VIEWS_PER_THREAD * threads) as u64;
    with_work(pixels, cells, lattices, blocks.saturating_add(largest.saturating_mul(RANGES_BYTES_PER_PIXEL * views)))
}

/// Returns the part of [`needed_mb`] that does not depend on the number of threads, megabytes.
pub(crate) fn least_mb(pixels: &[u64], cells: u64, lattices: usize) -> u64 {
    with_work(pixels, cells, lattices, 0)
}

/// Returns the memory needed when the sweep's views and blocks in work take `in_work` bytes,
/// megabytes.
fn with_work(pixels: &[u64], cells: u64, lattices: usize, in_work: u64) -> u64 {
    let more = lattices.saturating_sub(1) as u64;
    let all = pixels.iter().fold(0, |sum: u64, p| sum.saturating_add(*p));
    let placing = pixels.iter().copied().max().unwrap_or(0).saturating_mul(PLACING_BYTES_PER_PIXEL);
    let stage = |per_pixel: u64, per_lattice: u64, per_cell: u64| {
        let per_pixel = per_pixel.saturating_add(more.saturating_mul(per_lattice));
        all.saturating_mul(per_pixel).saturating_add(cells.saturating_mul(per_cell))
    };
    let stages = [
        stage(SWEPT_BYTES_PER_PIXEL, SWEPT_BYTES_PER_LATTICE, 0).saturating_add(in_work),
        stage(PLACED_BYTES_PER_PIXEL, PLACED_BYTES_PER_LATTICE, PLACED_BYTES_PER_CELL).saturating_add(placing),
        stage(VERTEX_BYTES_PER_PIXEL, VERTEX_BYTES_PER_LATTICE, FUSED_BYTES_PER_CELL),
    ];
    BASE.saturating_add(stages.into_iter().fold(0, u64::max)) / 1_000_000
}

/// Refuses work that does not fit the limit.
///
/// # Errors
/// [`DsmError::Memory`].
pub(crate) fn check(config: &DsmConfig, needed_mb: u64) -> Result<(), DsmError> {
    let limit_mb = limit_mb(config);
    if needed_mb > limit_mb { Err(DsmError::Memory { needed_mb, limit_mb }) } else { Ok(()) }
}

/// Returns the largest resident size of the process so far, megabytes; `None` where the system does
/// not report it (Linux does).
pub(crate) fn peak_mb() -> Option<f64> {
    let status = std::fs::read_to_string("/proc/self/status").ok()?;
    let line = status.lines().find(|l| l.starts_with("VmHWM:"))?;
    let kilobytes: f64 = line.split_whitespace().nth(1)?.parse().ok()?;
    Some(kilobytes / 1000.0)
}
