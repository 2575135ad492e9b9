//! The backward pass of a tile: from back to front, the gradient of each entry.
//!
//! All images are sums Σ wᵢ fᵢ, so that a pixel's gradient reaches the splats through
//! f = g · (colour, normal, 1, m, s², s). With the rest R = Σⱼ₍ₖ₎ wⱼ fⱼ behind a splat,
//! ∂L/∂αᵢ = Tᵢ fᵢ − R / (1 − αᵢ). The transmittance is taken back by division, which keeps its
//! relative error small.

use crate::footprint::{BLOCKS, Brush, Footprint, GREATEST_ALPHA};
use crate::forward::{AHEAD, TileTask};
use crate::screen::{ScreenGradient, ScreenSplat};
use crate::simd::{Block, InstructionSet, Lanes};

/// Gradients by the sums of a block, and what the pass keeps for each pixel.
#[derive(Debug, Clone, Copy)]
#[repr(C)]
pub(crate) struct BlockGradients {
    /// Transmittance behind the entries that are still to come.
    pub(crate) transmittance: Block,
    /// Σ wⱼ fⱼ of the entries behind.
    pub(crate) rest: Block,
    pub(crate) colour: [Block; 3],
    pub(crate) normal: [Block; 3],
    /// By Σ wᵢ, Σ wᵢ mᵢ, Σ wᵢ sᵢ² and Σ wᵢ sᵢ; s is m itself, or the inverse depth.
    pub(crate) moments: [Block; 4],
}

/// Gradients by the sums of a tile.
pub(crate) type TileGradients = [BlockGradients; BLOCKS];

impl BlockGradients {
    pub(crate) const ZERO: Self = Self {
        transmittance: Block::ZERO,
        rest: Block::ZERO,
        colour: [Block::ZERO; 3],
        normal: [Block::ZERO; 3],
        moments: [Block::ZERO; 4],
    };
}

/// Sums over the pixels of an entry, lane by lane. With u and v the position in the plane, s the
/// gradient α ∂L/∂α, t that by 1 / r (perspective) or by the depth (affine):
/// Σ s u², Σ s u v, Σ s v², Σ t u, Σ t v, Σ r s u, Σ r s v, Σ r t, then the slots of a
/// [`ScreenGradient`] from the depth on.
type EntrySums<L> = [L; 16];

/// Computes the gradient of every entry that was drawn. Those of others are left as they are.
/// `masks` and `drawn` are what the forward pass wrote.
#[inline(always)]
pub(crate) fn spread<I: InstructionSet, const PERSPECTIVE: bool, const INVERSE: bool>(
    isa: I,
    task: &TileTask<'_>,
    masks: &[u16],
    mut drawn: &[u16],
    pixels: &mut TileGradients,
    out: &mut [ScreenGradient],
) {
    let mut kept = [Block::ZERO; 16];
    for (number, ((&entry, &mask), out)) in task.entries.iter().zip(masks).zip(out).enumerate().rev() {
        if let Some(soon) = number.checked_sub(AHEAD) {
            isa.prefetch(&task.splats[task.entries[soon] as usize]);
        }
        if mask == 0 {
            continue;
        }
        let (before, own) = drawn.split_at(drawn.len() - mask.count_ones() as usize);
        drawn = before;
        let splat = &task.splats[entry as usize];
        let brush = Brush::new(isa, splat, task.origin, task.reference_depth);
        let mut sums = [0.0; 16];
        for part in 0..I::PARTS {
            let mut total = [isa.splat(0.0); 16];
            let mut left = u32::from(mask);
            for &bits in own {
                let block = left.trailing_zeros() as usize % BLOCKS;
                left &= left - 1;
                let drawn = isa.mask(bits, part);
                if I::PARTS > 1 && !I::Lanes::any(drawn) {
                    continue;
                }
                let (pixels, total) = (&mut pixels[block], &mut total);
                // Where the splat is drawn, it lies before the horizon.
                let at = brush.at::<I, PERSPECTIVE, false>(isa, block, part);
                spread_block::<I, PERSPECTIVE, INVERSE>(isa, &brush, splat, &at, drawn, part, pixels, total);
            }
            sums = isa.totals(total, part, &mut kept);
        }
        *out = gathered(splat, sums);
    }
}

/// Returns the gradient of an entry from its sums.
#[inline(always)]
fn gathered(splat: &ScreenSplat, mut sums: [f32; 16]) -> ScreenGradient {
    let [a0, b0, a1, b1] = splat.inverse;
    // ∂L/∂p; the offset from the centre falls as the centre moves.
    let by_p = [0, 1].map(|k| splat.slopes[k].mul_add(sums[7], -sums[5 + k]));
    sums[5] = a1.mul_add(-by_p[1], a0 * -by_p[0]);
    sums[6] = b1.mul_add(-by_p[1], b0 * -by_p[0]);
    sums
}

/// Adds the gradient of a splat at a part of a block.
#[inline(always)]
#[expect(clippy::too_many_arguments, reason = "registers are passed one by one")]
fn spread_block<I: InstructionSet, const PERSPECTIVE: bool, const INVERSE: bool>(
    isa: I,
    brush: &Brush<I::Lanes>,
    splat: &ScreenSplat,
    at: &Footprint<I::Lanes>,
    drawn: <I::Lanes as Lanes>::Mask,
    part: usize,
    pixels: &mut BlockGradients,
    total: &mut EntrySums<I::Lanes>,
) {
    let unbounded = brush.alpha(isa, at);
    let greatest = isa.splat(GREATEST_ALPHA);
    let alpha = unbounded.min(greatest).only(drawn);
    let one = isa.splat(1.0);
    let inverse = one.div(one.sub(alpha));
    let before = isa.load(&pixels.transmittance, part).mul(inverse);
    let weight = before.mul(alpha);
    before.store(&mut pixels.transmittance, part);

    let depth = brush.depth::<PERSPECTIVE>(at);
    let [by_sum, by_first, by_second, by_other] = &pixels.moments;
    let (by_sum, by_first, by_second) = (isa.load(by_sum, part), isa.load(by_first, part), isa.load(by_second, part));
    // The value of the depth's moments, and the slope by the depth.
    let (mut value, by_depth) = if INVERSE {
        let inverse = brush.inverse_depth(isa, at);
        let slope = inverse.mul_add(by_second, isa.load(by_other, part));
        let value = inverse.mul_add(slope, depth.mul_add(by_first, by_sum));
        (value, inverse.mul_add(by_second, slope).mul_add(brush.by_depth(isa, inverse), by_first))
    } else {
        let slope = depth.mul_add(by_second, by_first);
        (depth.mul_add(slope, by_sum), depth.mul_add(by_second, slope))
    };
    for i in 0..3 {
        let (by_colour, by_normal) = (isa.load(&pixels.colour[i], part), isa.load(&pixels.normal[i], part));
        total[10 + i] = weight.mul_add(by_colour, total[10 + i]);
        total[13 + i] = weight.mul_add(by_normal, total[13 + i]);
        value = by_colour.mul_add(isa.splat(splat.colour[i]), value);
        value = by_normal.mul_add(isa.splat(splat.normal[i]), value);
    }
    let rest = isa.load(&pixels.rest, part);
    weight.mul_add(value, rest).store(&mut pixels.rest, part);

    // The opacity does not change where it is at its bound.
    let by_alpha = rest.neg_mul_add(inverse, before.mul(value));
    let strength = alpha.mul(by_alpha).only(unbounded.at_most(greatest));
    total[9] = total[9].add(strength);
    let by_depth = weight.mul(by_depth);
    add_plane::<I::Lanes, PERSPECTIVE>(brush, at, strength, by_depth, total);
}

/// Adds the gradient by position and shape. `strength` is α ∂L/∂α, so that ∂L/∂ρ is −½ of it.
#[inline(always)]
fn add_plane<L: Lanes, const PERSPECTIVE: bool>(
    brush: &Brush<L>,
    at: &Footprint<L>,
    strength: L,
    by_depth: L,
    total: &mut EntrySums<L>,
) {
    let [u, v] = at.uv;
    // ∂L/∂u = −strength · u.
    let (pull_u, pull_v) = (strength.mul(u), strength.mul(v));
    total[0] = pull_u.mul_add(u, total[0]);
    total[1] = pull_u.mul_add(v, total[1]);
    total[2] = pull_v.mul_add(v, total[2]);
    let turn = if PERSPECTIVE {
        let scaled = by_depth.mul(at.r);
        total[8] = total[8].add(scaled);
        total[5] = pull_u.mul_add(at.r, total[5]);
        total[6] = pull_v.mul_add(at.r, total[6]);
        // −∂L/∂(1/r) / r, from the position in the plane and from the depth.
        let turn = strength.neg_mul_add(at.rho, scaled.mul(brush.depth));
        total[7] = turn.mul_add(at.r, total[7]);
        turn
    } else {
        total[8] = total[8].add(by_depth);
        total[5] = total[5].add(pull_u);
        total[6] = total[6].add(pull_v);
        total[7] = total[7].add(by_depth);
        by_depth
    };
    total[3] = turn.mul_add(u, total[3]);
    total[4] = turn.mul_add(v, total[4]);
}
