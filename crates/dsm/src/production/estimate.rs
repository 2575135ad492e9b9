//! What a plan will take: memory and processor time, by chunk and in all.

use serde::{Deserialize, Serialize};

use crate::{ChunkWork, Plan, Preset};

/// Processor seconds that a megapixel of a view takes per source at full resolution, from
/// `benches/results/scale.md`.
const SECONDS_PER_MPX: f64 = 1.06;
/// Share of that which the finest level takes on each further lattice of pixels: a sixth to a half
/// in whole runs, more where a scene is rich in heights.
const PER_LATTICE: f64 = 0.3;
/// Share of that at half the resolution.
const HALF_RESOLUTION: f64 = 0.25;
/// Memory of the libraries and of GDAL's block cache while chunks are merged, bytes.
const MERGE_BASE: u64 = 200_000_000;
/// Bytes per cell of the largest chunk while chunks are merged: two results, of which one is read
/// while the other is written (15 each), heights above the datum (4), what is written and what is
/// read back of it (8).
const MERGED_BYTES_PER_CELL: u64 = 42;

/// What a plan will take. Times are rough: scenes and processors differ by a factor of two.
#[derive(Debug, Clone, PartialEq, Serialize, Deserialize)]
#[serde(deny_unknown_fields)]
#[non_exhaustive]
pub struct PlanEstimate {
    /// Largest memory of a chunk, megabytes.
    pub peak_mb: u64,
    /// Processor time of all chunks, seconds.
    pub cpu_seconds: f64,
    /// Memory of the merge, megabytes.
    pub merge_mb: u64,
    /// The chunks in the order of the plan.
    pub chunks: Vec<ChunkEstimate>,
}

/// What a chunk will take; zeros for a chunk without work.
#[derive(Debug, Clone, Copy, Default, PartialEq, Serialize, Deserialize)]
#[serde(deny_unknown_fields)]
#[non_exhaustive]
pub struct ChunkEstimate {
    /// Memory, megabytes.
    pub needed_mb: u64,
    /// Processor time, seconds.
    pub cpu_seconds: f64,
}

impl PlanEstimate {
    /// Estimates what a plan will take.
    pub fn of(plan: &Plan) -> Self {
        let lattices = plan.tuning.lattices as f64;
        let share = match plan.config.preset {
            Preset::Fast => HALF_RESOLUTION,
            Preset::Balanced | Preset::Accurate => 1.0 + PER_LATTICE * (lattices - 1.0),
        };
        let one = |work: &ChunkWork| {
            let ChunkWork::Sweep(sweep) = work else { return ChunkEstimate::default() };
            let pixels = |window: &Option<raster::Window>| window.map_or(0.0, |w| w.width as f64 * w.height as f64);
            let swept: f64 = sweep.windows.iter().zip(&sweep.sources).map(|(w, s)| pixels(w) * s.len() as f64).sum();
            ChunkEstimate { needed_mb: sweep.needed_mb, cpu_seconds: swept * 1e-6 * SECONDS_PER_MPX * share }
        };
        let largest = plan
            .chunks
            .iter()
            .map(|chunk| (chunk.core.width as u64).saturating_mul(chunk.core.height as u64))
            .max()
            .unwrap_or(0);
        let chunks: Vec<ChunkEstimate> = plan.chunks.iter().map(|chunk| one(&chunk.work)).collect();
        Self {
            peak_mb: chunks.iter().map(|chunk| chunk.needed_mb).max().unwrap_or(0),
            cpu_seconds: chunks.iter().map(|chunk| chunk.cpu_seconds).sum(),
            merge_mb: largest.saturating_mul(MERGED_BYTES_PER_CELL).saturating_add(MERGE_BASE) / 1_000_000,
            chunks,
        }
    }
}
