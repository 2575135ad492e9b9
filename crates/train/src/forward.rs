//! The forward pass of a tile: from front to back, C = Σ wᵢ cᵢ with wᵢ = αᵢ Πⱼ₍ᵢ₎ (1 − αⱼ).

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
    /// Number of the last entry that was drawn; −1 for none.
    pub(crate) last: Block,
    /// Σ wᵢ cᵢ.
    pub(crate) colour: [Block; 3],
    /// Σ wᵢ nᵢ.
    pub(crate) normal: [Block; 3],
    /// Σ wᵢ mᵢ and Σ wᵢ mᵢ², m measured from the tile's reference depth.
    pub(crate) moments: [Block; 2],
}

/// The sums of a tile's pixels.
pub(crate) type TileSums = [BlockSums; BLOCKS];

impl BlockSums {
    /// Nothing is drawn yet.
    pub(crate) const EMPTY: Self = Self {
        transmittance: Block([1.0; LANES]),
        last: Block([-1.0; LANES]),
        colour: [Block::ZERO; 3],
        normal: [Block::ZERO; 3],
        moments: [Block::ZERO; 2],
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
    /// Returns the blocks that lie in the image, at least in part.
    fn blocks_in_image(&self) -> u32 {
        let inside = |block: &usize| {
            let pixel = pixel_of(*block, 0);
            (0..2).all(|i| self.origin[i] + pixel[i] < self.size[i])
        };
        (0..BLOCKS).filter(inside).fold(0, |mask, block| mask | 1 << block)
    }
}

/// Draws the splats of a tile. `masks` takes the blocks in which each entry was drawn. Returns the
/// number of pairs of a splat and a pixel.
#[inline(always)]
pub(crate) fn draw<I: InstructionSet, const PERSPECTIVE: bool>(
    isa: I,
    task: &TileTask<'_>,
    masks: &mut [u16],
    sums: &mut TileSums,
) -> u64 {
    let mut pairs = 0;
    *sums = [BlockSums::EMPTY; BLOCKS];
    let mut open = task.blocks_in_image();
    for (number, (&entry, mask)) in task.entries.iter().zip(masks).enumerate() {
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
        while left != 0 {
            let block = left.trailing_zeros() as usize % BLOCKS;
            left &= left - 1;
            let (mut drawn, mut alive) = (0, false);
            for part in 0..I::PARTS {
                let (count, is_alive) = draw_block::<I, PERSPECTIVE>(isa, &brush, splat, number, block, part, sums);
                drawn += count;
                alive |= is_alive;
            }
            pairs += u64::from(drawn);
            met |= u32::from(drawn > 0) << block;
            open &= !(u32::from(!alive) << block);
        }
        *mask = met as u16;
        if open == 0 {
            break;
        }
    }
    pairs
}

/// Draws a splat on a part of a block. Returns at how many pixels, and whether any pixel takes more
/// splats.
#[inline(always)]
fn draw_block<I: InstructionSet, const PERSPECTIVE: bool>(
    isa: I,
    brush: &Brush<I::Lanes>,
    splat: &ScreenSplat,
    number: usize,
    block: usize,
    part: usize,
    sums: &mut TileSums,
) -> (u32, bool) {
    let sums = &mut sums[block];
    let before = isa.load(&sums.transmittance, part);
    let takes = isa.splat(LEAST_TRANSMITTANCE).at_most(before);
    let at = brush.at::<I, PERSPECTIVE>(isa, block, part);
    let drawn = I::Lanes::both(at.drawn, takes);
    // A register that holds the whole block is rarely in vain, and a branch would be guessed wrong.
    if I::PARTS > 1 && !I::Lanes::any(drawn) {
        return (0, I::Lanes::any(takes));
    }
    let alpha = brush.opacity.mul(at.gaussian(isa)).min(isa.splat(GREATEST_ALPHA)).only(drawn);
    let weight = before.mul(alpha);
    let after = before.sub(weight);
    after.store(&mut sums.transmittance, part);
    let last = isa.splat(number as f32).or_else(drawn, isa.load(&sums.last, part));
    last.store(&mut sums.last, part);
    for i in 0..3 {
        let sum = &mut sums.colour[i];
        weight.mul_add(isa.splat(splat.colour[i]), isa.load(sum, part)).store(sum, part);
        let sum = &mut sums.normal[i];
        weight.mul_add(isa.splat(splat.normal[i]), isa.load(sum, part)).store(sum, part);
    }
    let depth = brush.depth::<I, PERSPECTIVE>(isa, &at);
    let moment = weight.mul(depth);
    let [first, second] = &mut sums.moments;
    isa.load(first, part).add(moment).store(first, part);
    moment.mul_add(depth, isa.load(second, part)).store(second, part);
    (I::Lanes::count(drawn), I::Lanes::any(isa.splat(LEAST_TRANSMITTANCE).at_most(after)))
}
