//! The forward pass of a tile: from front to back, C = Σ wᵢ cᵢ with wᵢ = αᵢ Πⱼ₍ᵢ₎ (1 − αⱼ).

use crate::arrange::TILE;
use crate::footprint::{BLOCKS, Brush, GREATEST_ALPHA, LEAST_TRANSMITTANCE, blocks_within, pixel_of};
use crate::screen::ScreenSplat;
use crate::simd::{Block, InstructionSet, LANES, Lanes};

/// Entries that are asked for before they are drawn.
pub(crate) const AHEAD: usize = 6;

/// The sums of the pixels of a block. They lie together, because rows of a power of two apart would
/// share the lines of the cache.
#[derive(Debug, Clone, Copy)]
#[repr(C)]
pub(crate) struct BlockSums {
    /// Π (1 − αᵢ).
    pub(crate) transmittance: Block,
    /// Σ wᵢ cᵢ.
    pub(crate) colour: [Block; 3],
    /// Σ wᵢ nᵢ.
    pub(crate) normal: [Block; 3],
    /// Σ wᵢ mᵢ with the depth m, and Σ wᵢ sᵢ² and Σ wᵢ sᵢ with that whose spread is asked for.
    /// Depths are measured from the tile's reference depth. Where they are s themselves, the third
    /// sum is not used.
    pub(crate) moments: [Block; 3],
}

/// The sums of a tile's pixels.
pub(crate) type TileSums = [BlockSums; BLOCKS];

impl BlockSums {
    /// Nothing is drawn yet.
    pub(crate) const EMPTY: Self = Self {
        transmittance: Block([1.0; LANES]),
        colour: [Block::ZERO; 3],
        normal: [Block::ZERO; 3],
        moments: [Block::ZERO; 3],
    };
}

/// A tile and its entries.
pub(crate) struct TileTask<'a> {
    pub(crate) splats: &'a [ScreenSplat],
    pub(crate) entries: &'a [u32],
    /// Column and row of the first pixel.
    pub(crate) origin: [usize; 2],
    /// Columns and rows of the image.
    pub(crate) size: [usize; 2],
    pub(crate) reference_depth: f32,
}

impl TileTask<'_> {
    /// Returns the columns and rows of the tile that lie in the image.
    pub(crate) fn size_in_image(&self) -> [usize; 2] {
        [0, 1].map(|i| (self.size[i] - self.origin[i]).min(TILE))
    }

    /// Empties the sums. Pixels outside of the image take nothing.
    fn clear(&self, sums: &mut TileSums) {
        *sums = [BlockSums::EMPTY; BLOCKS];
        let size = self.size_in_image();
        if size == [TILE; 2] {
            return;
        }
        for (block, sums) in sums.iter_mut().enumerate() {
            for (lane, transmittance) in sums.transmittance.0.iter_mut().enumerate() {
                let pixel = pixel_of(block, lane);
                if pixel[0] >= size[0] || pixel[1] >= size[1] {
                    *transmittance = 0.0;
                }
            }
        }
    }
}

/// What the forward pass of a tile writes.
pub(crate) struct DrawnTile<'a> {
    pub(crate) sums: &'a mut TileSums,
    /// Blocks in which each entry was drawn.
    pub(crate) masks: &'a mut [u16],
    /// Takes the pixels of each of these blocks, one bit each.
    pub(crate) pixels: &'a mut Vec<u16>,
    /// Number of blocks in `pixels`; what is behind them is of no meaning.
    pub(crate) count: &'a mut usize,
}

/// Draws the splats of a tile; `INVERSE` where the spread of inverse depths is asked for. Returns
/// the number of pairs of a splat and a pixel.
#[inline(always)]
pub(crate) fn draw<I: InstructionSet, const PERSPECTIVE: bool, const INVERSE: bool>(
    isa: I,
    task: &TileTask<'_>,
    out: &mut DrawnTile<'_>,
) -> u64 {
    task.clear(out.sums);
    let first = *out.count;
    let mut count = first;
    let mut open = (1u32 << BLOCKS) - 1;
    for (number, (&entry, mask)) in task.entries.iter().zip(&mut *out.masks).enumerate() {
        if let Some(&soon) = task.entries.get(number + AHEAD) {
            isa.prefetch(&task.splats[soon as usize]);
        }
        let splat = &task.splats[entry as usize];
        let mut left = blocks_within(splat, task.origin) & open;
        if left == 0 {
            *mask = 0;
            continue;
        }
        let brush = Brush::new(isa, splat, task.origin, task.reference_depth);
        let mut met = 0u32;
        if out.pixels.len() < count + BLOCKS {
            out.pixels.resize(2 * (count + BLOCKS), 0);
        }
        while left != 0 {
            let block = left.trailing_zeros() as usize % BLOCKS;
            left &= left - 1;
            let sums = &mut out.sums[block];
            let (drawn, alive) = draw_block::<I, PERSPECTIVE, INVERSE>(isa, &brush, splat, block, sums);
            // A branch would be guessed wrong and known late.
            let is_drawn = drawn != 0;
            out.pixels[count] = drawn;
            count += usize::from(is_drawn);
            met |= u32::from(is_drawn) << block;
            open &= !(u32::from(!alive) << block);
        }
        *mask = met as u16;
        if open == 0 {
            break;
        }
    }
    *out.count = count;
    out.pixels[first..count].iter().map(|pixels| u64::from(pixels.count_ones())).sum()
}

/// Draws the splats of a tile without their depths, and calls `take` with the place of each entry
/// among them, the block, and its transmittances before and after. The weight of the entry in a
/// pixel is what it takes of its transmittance.
#[inline(always)]
pub(crate) fn weigh<I: InstructionSet, const PERSPECTIVE: bool>(
    isa: I,
    task: &TileTask<'_>,
    sums: &mut TileSums,
    mut take: impl FnMut(usize, usize, &Block, &Block),
) {
    task.clear(sums);
    let mut open = (1u32 << BLOCKS) - 1;
    for (number, &entry) in task.entries.iter().enumerate() {
        let splat = &task.splats[entry as usize];
        let mut left = blocks_within(splat, task.origin) & open;
        if left == 0 {
            continue;
        }
        let brush = Brush::new(isa, splat, task.origin, task.reference_depth);
        while left != 0 {
            let block = left.trailing_zeros() as usize % BLOCKS;
            left &= left - 1;
            let sums = &mut sums[block];
            let before = sums.transmittance;
            let (drawn, alive) = draw_block::<I, PERSPECTIVE, false>(isa, &brush, splat, block, sums);
            if drawn != 0 {
                take(number, block, &before, &sums.transmittance);
            }
            open &= !(u32::from(!alive) << block);
        }
        if open == 0 {
            break;
        }
    }
}

/// Draws a splat on a block. Returns at which pixels, and whether any pixel takes more splats.
#[inline(always)]
fn draw_block<I: InstructionSet, const PERSPECTIVE: bool, const INVERSE: bool>(
    isa: I,
    brush: &Brush<I::Lanes>,
    splat: &ScreenSplat,
    block: usize,
    sums: &mut BlockSums,
) -> (u16, bool) {
    let (mut drawn, mut alive) = (0, false);
    for part in 0..I::PARTS {
        let (pixels, is_alive) = if splat.is_wide {
            draw_part::<I, PERSPECTIVE, INVERSE, true>(isa, brush, splat, block, part, sums)
        } else {
            draw_part::<I, PERSPECTIVE, INVERSE, false>(isa, brush, splat, block, part, sums)
        };
        drawn |= pixels;
        alive |= is_alive;
    }
    (drawn, alive)
}

/// Draws a splat on a part of a block. Returns at which pixels, and whether any pixel takes more
/// splats.
#[inline(always)]
fn draw_part<I: InstructionSet, const PERSPECTIVE: bool, const INVERSE: bool, const WIDE: bool>(
    isa: I,
    brush: &Brush<I::Lanes>,
    splat: &ScreenSplat,
    block: usize,
    part: usize,
    sums: &mut BlockSums,
) -> (u16, bool) {
    let before = isa.load(&sums.transmittance, part);
    let takes = isa.splat(LEAST_TRANSMITTANCE).at_most(before);
    let at = brush.at::<I, PERSPECTIVE, WIDE>(isa, block, part);
    let drawn = I::Lanes::both(brush.reaches(&at), takes);
    // A register is rarely in vain, and a branch would be guessed wrong.
    let alpha = brush.alpha(isa, &at).min(isa.splat(GREATEST_ALPHA)).only(drawn);
    let weight = before.mul(alpha);
    let after = before.sub(weight);
    after.store(&mut sums.transmittance, part);
    for i in 0..3 {
        let sum = &mut sums.colour[i];
        weight.mul_add(isa.splat(splat.colour[i]), isa.load(sum, part)).store(sum, part);
        let sum = &mut sums.normal[i];
        weight.mul_add(isa.splat(splat.normal[i]), isa.load(sum, part)).store(sum, part);
    }
    let depth = brush.depth::<PERSPECTIVE>(&at);
    let moment = weight.mul(depth);
    let [first, second, other] = &mut sums.moments;
    isa.load(first, part).add(moment).store(first, part);
    if INVERSE {
        let inverse = brush.inverse_depth(isa, &at);
        let moment = weight.mul(inverse);
        isa.load(other, part).add(moment).store(other, part);
        moment.mul_add(inverse, isa.load(second, part)).store(second, part);
    } else {
        moment.mul_add(depth, isa.load(second, part)).store(second, part);
    }
    (I::Lanes::bits(drawn, part), I::Lanes::any(isa.splat(LEAST_TRANSMITTANCE).at_most(after)))
}
