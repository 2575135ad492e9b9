//! Costs of height planes, and their way to the pixels: planes are computed one after the other, and a pixel's costs lie one
//! after the other.

use multiversion::multiversion;
use raster::Window;

use super::census::CHUNK;
use super::part::CENSUS_REACH;
use super::transpose::{COLUMNS, ROWS, transpose};
use crate::ranges::Ranges;
use crate::simd::prefetch::fetch;

/// Planes that are computed before their costs go to the pixels: most parts of a tile need no more, and they fit into the
/// second cache.
pub(super) const PLANES_AT_ONCE: usize = 64;
/// Registers of a pixel's costs: one more is read from than holds any.
const DEPTH: usize = PLANES_AT_ONCE / ROWS + 1;
/// Bytes.
const CACHE_LINE: usize = 64;

/// Where a block's costs go: pixel `(x, y)` of `window` has its hypotheses at `offsets[y · width + x]`.
pub(crate) struct BlockCosts<'a> {
    pub(crate) window: Window,
    pub(crate) offsets: &'a [u32],
    /// With as many entries behind them that belong to no pixel as a register holds.
    pub(crate) costs: &'a mut [u8],
}

/// Costs of a few planes of a part of a tile with its margin.
#[derive(Default)]
pub(super) struct Planes {
    costs: Vec<u8>,
    width: usize,
    /// Those of a row of pixels, one pixel's after the other.
    columns: Vec<[u8; ROWS]>,
    /// From one plane to the next: more than a plane holds, so that planes do not share cache sets.
    stride: usize,
}

impl Planes {
    /// Makes room for planes of `area` costs in rows of `width`.
    pub(super) fn fit(&mut self, width: usize, area: usize) {
        self.width = width;
        self.stride = area.next_multiple_of(CHUNK) + CACHE_LINE;
        // What a smaller part does not need is kept for the next larger one: filling it anew takes longer than the planes.
        self.costs.resize((PLANES_AT_ONCE * self.stride).max(self.costs.len()), 0);
        self.columns.resize((width.next_multiple_of(COLUMNS) * DEPTH).max(self.columns.len()), [0; ROWS]);
    }

    /// The `i`th plane: whole chunks.
    pub(super) fn plane_mut(&mut self, i: usize) -> &mut [u8] {
        &mut self.costs[i * self.stride..][..self.stride - CACHE_LINE]
    }
}

/// Writes the costs of the `count` planes from `first` on to the pixels that ask for them. Where these ask for no others
/// (`is_all`), the costs of a pixel may spill over into those of the next one, which come after them.
#[multiversion(targets("x86_64+avx2"))]
pub(super) fn scatter(
    ranges: &Ranges,
    part: Window,
    (first, count): (i32, usize),
    is_all: bool,
    planes: &mut Planes,
    block: &mut BlockCosts<'_>,
) {
    let (bx, by) = ((part.x - block.window.x) as usize, (part.y - block.window.y) as usize);
    for y in 0..part.height {
        let at = (y + CENSUS_REACH) * planes.width + CENSUS_REACH;
        let offsets = &block.offsets[(by + y) * block.window.width + bx..][..part.width + 1];
        // The way to the pixels waits for their memory otherwise.
        let targets = &block.costs[offsets[0] as usize..offsets[part.width] as usize];
        targets.iter().step_by(CACHE_LINE).for_each(|target| fetch(target));
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

/// Copies whole registers, the last of which holds the last of `count` bytes.
#[inline(always)]
fn copy_over(from: &[u8], count: usize, to: &mut [u8]) {
    let (from, to) = (from.as_chunks::<ROWS>().0, to.as_chunks_mut::<ROWS>().0);
    from.iter().zip(to).take(count.div_ceil(ROWS)).for_each(|(from, to)| *to = *from);
}
