//! What a run needs of memory, and what it took.

use raster::Window;

use crate::config::DsmConfig;
use crate::error::PipelineError;
use crate::scene::Opened;

/// Bytes per pixel of one view that stay through the run: image and pyramid (4 + 4/3), the heights of two levels with
/// deviation, confidence and support (16 + 4), the ranges (6), placed vertices (20).
const BYTES_PER_PIXEL: u64 = 48;
/// Bytes of one block in work: 1120² pixels of about 24 hypotheses, each a cost and a sum, plus layout.
const BYTES_PER_BLOCK: u64 = 1120 * 1120 * (24 * 3 + 9);
/// What the libraries take before anything is done.
const BASE: u64 = 60_000_000;

/// Refuses a run that does not fit the limit.
pub(crate) fn check(config: &DsmConfig, images: &[Opened], windows: &[Option<Window>]) -> Result<(), PipelineError> {
    let Some(limit_mb) = config.memory_mb else { return Ok(()) };
    let pixels: Vec<u64> =
        images.iter().zip(windows).map(|(o, w)| w.map_or(o.size.0 * o.size.1, |w| w.width * w.height) as u64).collect();
    let largest = pixels.iter().copied().max().unwrap_or(0);
    let blocks = rayon::current_num_threads().min(images.len()) as u64;
    let block = BYTES_PER_BLOCK.min(largest * (BYTES_PER_BLOCK / (1120 * 1120)));
    let needed_mb = (BASE + pixels.iter().sum::<u64>() * BYTES_PER_PIXEL + blocks * block) / 1_000_000;
    if needed_mb > limit_mb {
        return Err(PipelineError::Memory { needed_mb, limit_mb });
    }
    Ok(())
}

/// The largest resident size of the process so far, megabytes, where the system tells (Linux).
pub(crate) fn peak_mb() -> Option<f64> {
    let status = std::fs::read_to_string("/proc/self/status").ok()?;
    let line = status.lines().find(|l| l.starts_with("VmHWM:"))?;
    let kilobytes: f64 = line.split_whitespace().nth(1)?.parse().ok()?;
    Some(kilobytes / 1000.0)
}
