//! Costs of height planes, and their way to the pixels.
//!
//! Costs are computed plane by plane, but stored pixel by pixel: planes are kept until some are
//! there, and are then transposed.

use multiversion::multiversion;
use raster::Window;

use super::census::CHUNK;
use super::part::MARGIN;
use super::transpose::{COLUMNS, ROWS, transpose};
use crate::ranges::Ranges;
use crate::simd::prefetch::prefetch;

/// Planes that are computed before their costs go to the pixels. Most parts of a tile need no more,
/// and so many fit into the second-level cache.
pub(super) const PLANES_AT_ONCE: usize = 64;
/// Groups of [`ROWS`] costs of a pixel. The last one holds none: a copy that begins behind the
/// first plane reads beyond the others.
const DEPTH: usize = PLANES_AT_ONCE / ROWS + 1;
/// Length of a cache line, bytes.
const CACHE_LINE: usize = 64;

/// Costs of a block: those of pixel `(x, y)` of `window` begin at `offsets[y · width + x]`.
pub(crate) struct BlockCosts<'a> {
    /// The block in image coordinates.
    pub(crate) window: Window,
    /// Index of each pixel's first cost; one entry more than there are pixels.
    pub(crate) offsets: &'a [u32],
    /// The costs, followed by [`crate::aggregation::LANES`] entries that belong to no pixel.
    pub(crate) costs: &'a mut [u8],
}

/// Costs of up to [`PLANES_AT_ONCE`] planes of a part of a tile with its margin.
#[derive(Default)]
pub(super) struct Planes {
    /// Costs, plane after plane.
    costs: Vec<u8>,
    /// Columns of a plane, margin included.
    width: usize,
    /// Costs of one row of pixels, pixel after pixel.
    columns: Vec<[u8; ROWS]>,
    /// Number of bytes from one plane to the next. It exceeds a plane, so that planes do not share
    /// cache sets.
    stride: usize,
}

impl Planes {
    /// Makes room for planes of `area` costs in rows of `width`. Their contents are undefined.
    pub(super) fn fit(&mut self, width: usize, area: usize) {
        self.width = width;
        self.stride = area.next_multiple_of(CHUNK) + CACHE_LINE;
        // The buffers never shrink: filling them again for the next larger part would take longer
        // than the planes themselves.
        self.costs.resize((PLANES_AT_ONCE * self.stride).max(self.costs.len()), 0);
        self.columns.resize((width.next_multiple_of(COLUMNS) * DEPTH).max(self.columns.len()), [0; ROWS]);
    }

    /// Returns the `i`th plane, in whole chunks.
    pub(super) fn plane_mut(&mut self, i: usize) -> &mut [u8] {
        &mut self.costs[i * self.stride..][..self.stride - CACHE_LINE]
    }
}

/// A run of planes at hand.
#[derive(Clone, Copy)]
pub(super) struct PlaneRun {
    /// Hypothesis of the first plane.
    pub(super) first: i32,
    /// Number of planes.
    pub(super) count: usize,
    /// Whether the pixels of the part have no hypotheses outside the run.
    pub(super) is_all: bool,
}

/// Copies the costs of a run of planes to those pixels of a part that have these hypotheses.
///
/// If the pixels have no other hypotheses, whole registers are copied: what spills over into the
/// next pixel is overwritten when its turn comes, and what spills behind the row is restored.
#[multiversion(targets("x86_64+avx2"))]
pub(super) fn scatter(ranges: &Ranges, part: Window, run: PlaneRun, planes: &mut Planes, block: &mut BlockCosts<'_>) {
    let PlaneRun { first, count, is_all } = run;
    let (bx, by) = ((part.x - block.window.x) as usize, (part.y - block.window.y) as usize);
    for y in 0..part.height {
        let at = (y + MARGIN) * planes.width + MARGIN;
        let offsets = &block.offsets[(by + y) * block.window.width + bx..][..part.width + 1];
        // Without prefetching the copies below would wait for the memory.
        let targets = &block.costs[offsets[0] as usize..offsets[part.width] as usize];
        targets.iter().step_by(CACHE_LINE).for_each(|target| prefetch(target));
        let columns = &mut planes.columns[..part.width.next_multiple_of(COLUMNS) * DEPTH];
        transpose(&planes.costs[at..], planes.stride, count, DEPTH, columns);
        let low = &ranges.low.row(part.y as usize + y)[part.x as usize..][..part.width];
        let asked = &ranges.count.row(part.y as usize + y)[part.x as usize..][..part.width];
        let pixels = low.iter().zip(asked).zip(offsets).zip(columns.as_chunks::<DEPTH>().0);
        if is_all {
            let behind = offsets[part.width] as usize;
            let kept: Option<[u8; ROWS]> = block.costs[behind..].first_chunk().copied();
            for (((low, asked), offset), column) in pixels {
                let from = &column.as_flattened()[(low - first) as usize..];
                copy_over(from, usize::from(*asked), &mut block.costs[*offset as usize..]);
            }
            if let (Some(kept), Some(out)) = (kept, block.costs[behind..].first_chunk_mut()) {
                *out = kept;
            }
        } else {
            for (((low, asked), offset), column) in pixels {
                let from = first.max(*low);
                let to = (low + i32::from(*asked)).min(first + count as i32);
                if from < to {
                    let out = &mut block.costs[*offset as usize + (from - low) as usize..];
                    let (from, to) = ((from - first) as usize, (to - first) as usize);
                    out[..to - from].copy_from_slice(&column.as_flattened()[from..to]);
                }
            }
        }
    }
}

/// Copies `count` bytes, rounded up to whole registers.
#[inline(always)]
fn copy_over(from: &[u8], count: usize, to: &mut [u8]) {
    let (from, to) = (from.as_chunks::<ROWS>().0, to.as_chunks_mut::<ROWS>().0);
    from.iter().zip(to).take(count.div_ceil(ROWS)).for_each(|(from, to)| *to = *from);
}
