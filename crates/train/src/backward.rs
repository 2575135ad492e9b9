//! The backward pass of a tile: from back to front, the gradient of each entry.
//!
//! All images are sums Σ wᵢ fᵢ, so that a pixel's gradient reaches the splats through
//! f = g · (colour, normal, 1, m, m²). With the rest R = Σⱼ₍ₖ₎ wⱼ fⱼ behind a splat,
//! ∂L/∂αᵢ = Tᵢ fᵢ − R / (1 − αᵢ). The transmittance is taken back by division, which keeps its
//! relative error small.

use crate::footprint::{BLOCKS, Brush, Footprint, GREATEST_ALPHA};
use crate::forward::{AHEAD, TileTask};
use crate::screen::{ScreenGradient, ScreenSplat};
use crate::simd::{Block, InstructionSet, LANES, Lanes};

/// Gradients by the sums of a block, and what the pass keeps for each pixel.
#[derive(Debug, Clone, Copy)]
#[repr(C)]
pub(crate) struct BlockGradients {
    /// Transmittance behind the entries that are still to come.
    pub(crate) transmittance: Block,
    /// Number of the last entry that was drawn; −1 for none.
    pub(crate) last: Block,
    /// Σ wⱼ fⱼ of the entries behind.
    pub(crate) rest: Block,
    pub(crate) colour: [Block; 3],
    pub(crate) normal: [Block; 3],
    /// By Σ wᵢ, Σ wᵢ mᵢ and Σ wᵢ mᵢ².
    pub(crate) moments: [Block; 3],
}

/// Gradients by the sums of a tile.
pub(crate) type TileGradients = [BlockGradients; BLOCKS];

impl BlockGradients {
    /// Pixels that take no gradient, as nothing is drawn there.
    pub(crate) const NONE: Self = Self {
        transmittance: Block::ZERO,
        last: Block([-1.0; LANES]),
        rest: Block::ZERO,
        colour: [Block::ZERO; 3],
        normal: [Block::ZERO; 3],
        moments: [Block::ZERO; 3],
    };
}

/// Computes the gradient of every entry that was drawn. Those of others are left as they are.
#[inline(always)]
pub(crate) fn spread<I: InstructionSet, const PERSPECTIVE: bool>(
    isa: I,
    task: &TileTask<'_>,
    masks: &[u16],
    pixels: &mut TileGradients,
    out: &mut [ScreenGradient],
) {
    let mut sums = [Block::ZERO; 16];
    for (number, ((&entry, &mask), out)) in task.entries.iter().zip(masks).zip(out).enumerate().rev() {
        if let Some(soon) = number.checked_sub(AHEAD) {
            isa.prefetch(&task.splats[task.entries[soon] as usize]);
        }
        if mask == 0 {
            continue;
        }
        let splat = &task.splats[entry as usize];
        let brush = Brush::new(isa, splat, task.origin, task.reference_depth);
        for part in 0..I::PARTS {
            let mut total = [isa.splat(0.0); 16];
            let mut left = u32::from(mask);
            while left != 0 {
                let block = left.trailing_zeros() as usize % BLOCKS;
                left &= left - 1;
                spread_block::<I, PERSPECTIVE>(isa, &brush, splat, number, block, part, pixels, &mut total);
            }
            for (sum, lanes) in sums.iter_mut().zip(total) {
                lanes.store(sum, part);
            }
        }
        *out = isa.totals(&sums);
    }
}

/// Adds the gradient of a splat at a part of a block.
#[inline(always)]
#[expect(clippy::too_many_arguments, reason = "registers are passed one by one")]
fn spread_block<I: InstructionSet, const PERSPECTIVE: bool>(
    isa: I,
    brush: &Brush<I::Lanes>,
    splat: &ScreenSplat,
    number: usize,
    block: usize,
    part: usize,
    pixels: &mut TileGradients,
    total: &mut [I::Lanes; 16],
) {
    let pixels = &mut pixels[block];
    let at = brush.at::<I, PERSPECTIVE>(isa, block, part);
    let before_end = isa.splat(number as f32).at_most(isa.load(&pixels.last, part));
    let drawn = I::Lanes::both(at.drawn, before_end);
    if !I::Lanes::any(drawn) {
        return;
    }
    let gaussian = at.gaussian(isa);
    let unbounded = brush.opacity.mul(gaussian);
    let alpha = unbounded.min(isa.splat(GREATEST_ALPHA)).only(drawn);
    let one = isa.splat(1.0);
    let inverse = one.div(one.sub(alpha));
    let before = isa.load(&pixels.transmittance, part).mul(inverse);
    let weight = before.mul(alpha);
    before.store(&mut pixels.transmittance, part);

    let depth = brush.depth::<I, PERSPECTIVE>(isa, &at);
    let [by_sum, by_first, by_second] = [0, 1, 2].map(|i| isa.load(&pixels.moments[i], part));
    let mut value = depth.mul_add(depth.mul_add(by_second, by_first), by_sum);
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
    let changes = I::Lanes::both(drawn, unbounded.at_most(isa.splat(GREATEST_ALPHA)));
    let by_alpha = rest.neg_mul_add(inverse, before.mul(value)).only(changes);
    let by_depth = weight.mul(depth.add(depth).mul_add(by_second, by_first));
    total[9] = gaussian.mul_add(by_alpha, total[9]);
    add_plane::<I, PERSPECTIVE>(isa, brush, &at, alpha.mul(by_alpha), by_depth, total);
}

/// Adds the gradient by position and shape. `strength` is α ∂L/∂α, so that ∂L/∂ρ is −½ of it.
#[inline(always)]
fn add_plane<I: InstructionSet, const PERSPECTIVE: bool>(
    isa: I,
    brush: &Brush<I::Lanes>,
    at: &Footprint<I::Lanes>,
    strength: I::Lanes,
    by_depth: I::Lanes,
    total: &mut [I::Lanes; 16],
) {
    let zero = isa.splat(0.0);
    let Footprint { dx, dy, p, r, uv, .. } = *at;
    let on_plane = |lanes: I::Lanes| zero.or_else(at.low_pass, lanes);
    // ∂L/∂u = −strength · u.
    let (pull, by_depth_on_plane) = (on_plane(strength), on_plane(by_depth));
    let by_p = if PERSPECTIVE {
        let scaled = by_depth_on_plane.mul(r);
        total[8] = total[8].add(by_depth.or_else(at.low_pass, scaled));
        // −∂L/∂(1/r), from the position in the plane and from the depth.
        let by_ratio = r.mul(pull.neg_mul_add(at.in_plane, scaled.mul(brush.depth)));
        total[4] = p[0].mul_add(by_ratio, total[4]);
        total[5] = p[1].mul_add(by_ratio, total[5]);
        let pulled = pull.mul(r);
        [0, 1].map(|k| uv[k].neg_mul_add(pulled, brush.slopes[k].mul(by_ratio)))
    } else {
        total[8] = total[8].add(by_depth);
        total[4] = uv[0].mul_add(by_depth_on_plane, total[4]);
        total[5] = uv[1].mul_add(by_depth_on_plane, total[5]);
        [0, 1].map(|k| uv[k].neg_mul_add(pull, brush.slopes[k].mul(by_depth_on_plane)))
    };
    let [a0, b0, a1, b1] = brush.inverse;
    total[0] = by_p[0].mul_add(dx, total[0]);
    total[1] = by_p[0].mul_add(dy, total[1]);
    total[2] = by_p[1].mul_add(dx, total[2]);
    total[3] = by_p[1].mul_add(dy, total[3]);
    total[6] = by_p[1].neg_mul_add(a1, by_p[0].neg_mul_add(a0, total[6]));
    total[7] = by_p[1].neg_mul_add(b1, by_p[0].neg_mul_add(b0, total[7]));
    if I::Lanes::any(at.low_pass) {
        // ρ = 2 |offset|², and the offset falls as the centre moves.
        let pull = strength.add(strength).only(at.low_pass);
        total[6] = dx.mul_add(pull, total[6]);
        total[7] = dy.mul_add(pull, total[7]);
    }
}
