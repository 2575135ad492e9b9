//! Where and how strongly a splat covers the pixels of a block, as both passes compute it.

use crate::arrange::TILE;
use crate::screen::ScreenSplat;
use crate::simd::{Block, InstructionSet, LANES, Lanes, exp2};

/// Columns and rows of a block.
pub(crate) const BLOCK_SIDE: usize = 4;
/// Blocks of a tile.
pub(crate) const BLOCKS: usize = TILE * TILE / LANES;
/// Greatest opacity of a splat at a pixel, as in all viewers of splats.
pub(crate) const GREATEST_ALPHA: f32 = 0.99;
/// Transmittance below which a pixel takes no more splats.
pub(crate) const LEAST_TRANSMITTANCE: f32 = 1e-4;
/// Least ratio of the centre's depth to that of an intersection. Beyond it, the plane runs towards
/// the horizon, and nothing is drawn.
const LEAST_DEPTH_RATIO: f32 = 0.05;

/// Columns and rows of the pixels of a block. A tile has as many blocks as a block has pixels, so
/// that these are also the columns and rows of blocks.
static COLUMNS: Block = Block([0., 1., 2., 3., 0., 1., 2., 3., 0., 1., 2., 3., 0., 1., 2., 3.]);
static ROWS: Block = Block([0., 0., 0., 0., 1., 1., 1., 1., 2., 2., 2., 2., 3., 3., 3., 3.]);

/// Returns the place of a block and a lane in a tile: column, row.
#[inline(always)]
pub(crate) fn pixel_of(block: usize, lane: usize) -> [usize; 2] {
    let side = TILE / BLOCK_SIDE;
    [block % side * BLOCK_SIDE + lane % BLOCK_SIDE, block / side * BLOCK_SIDE + lane / BLOCK_SIDE]
}

/// Returns the blocks of a tile that the bounds of a splat meet, one bit each.
#[inline(always)]
pub(crate) fn blocks_within(splat: &ScreenSplat, tile_origin: [usize; 2]) -> u32 {
    let range = |i: usize| {
        let [first, last] = [splat.bounds[2 * i], splat.bounds[2 * i + 1]].map(usize::from);
        let from = first.saturating_sub(tile_origin[i]) / BLOCK_SIDE;
        let to = (last.saturating_sub(tile_origin[i]) / BLOCK_SIDE).min(TILE / BLOCK_SIDE - 1);
        (from, to)
    };
    let ((left, right), (top, bottom)) = (range(0), range(1));
    let columns = (0xf >> (3 - (right - left))) << left;
    let rows = (0x1111 >> (4 * (3 - (bottom - top)))) << (4 * top);
    columns * rows
}

/// A splat in the registers, for the blocks of a tile.
pub(crate) struct Brush<L> {
    /// L⁻¹ · the offset of the first pixel of each block from the centre.
    origins: [Block; 2],
    /// L⁻¹ · the place of a pixel within its block, for each part.
    within: [[L; 2]; 2],
    pub(crate) slopes: [L; 2],
    pub(crate) depth: L,
    /// Depth from which depths are measured, negative.
    minus_reference: L,
    /// That depth relative to the depth of the centre.
    reference_ratio: L,
    /// Depth of the centre, measured from the reference depth.
    relative_depth: L,
    log2_opacity: L,
    cutoff: L,
}

/// A splat at the pixels of a part of a block.
pub(crate) struct Footprint<L: Lanes> {
    /// Depth of the intersection relative to that of the centre; 1 for affine cameras.
    pub(crate) r: L,
    /// 1 / r.
    ratio: L,
    /// Position in the plane, standard deviations.
    pub(crate) uv: [L; 2],
    /// u² + v²: the squared distance from the centre.
    pub(crate) rho: L,
}

impl<L: Lanes> Brush<L> {
    #[inline(always)]
    pub(crate) fn new<I: InstructionSet<Lanes = L>>(
        isa: I,
        splat: &ScreenSplat,
        tile_origin: [usize; 2],
        reference_depth: f32,
    ) -> Self {
        let [a0, b0, a1, b1] = splat.inverse;
        // Lanes are not made in closures, which would not be compiled for the instruction set.
        let (a0, b0, a1, b1) = (isa.splat(a0), isa.splat(b0), isa.splat(a1), isa.splat(b1));
        let mut origins = [Block::ZERO; 2];
        let mut within = [[isa.splat(0.0); 2]; 2];
        // Whole pixels are subtracted first: no digit of the fraction is lost near the centre.
        let centre = [0, 1].map(|i| splat.pixel[i] - tile_origin[i] as f64);
        let whole = centre.map(f64::floor);
        let [blocks_x, blocks_y] = whole.map(|c| (-c / BLOCK_SIDE as f64) as f32);
        let (blocks_x, blocks_y) = (isa.splat(blocks_x), isa.splat(blocks_y));
        let fraction_x = isa.splat((whole[0] - centre[0]) as f32);
        let fraction_y = isa.splat((whole[1] - centre[1]) as f32);
        let side = isa.splat(BLOCK_SIDE as f32);
        for (part, within) in within.iter_mut().enumerate().take(I::PARTS) {
            let (column, row) = (isa.load(&COLUMNS, part), isa.load(&ROWS, part));
            let dx = column.add(blocks_x).mul_add(side, fraction_x);
            let dy = row.add(blocks_y).mul_add(side, fraction_y);
            a0.mul_add(dx, b0.mul(dy)).store(&mut origins[0], part);
            a1.mul_add(dx, b1.mul(dy)).store(&mut origins[1], part);
            *within = [a0.mul_add(column, b0.mul(row)), a1.mul_add(column, b1.mul(row))];
        }
        Self {
            origins,
            within,
            slopes: [isa.splat(splat.slopes[0]), isa.splat(splat.slopes[1])],
            depth: isa.splat(splat.depth),
            minus_reference: isa.splat(-reference_depth),
            reference_ratio: isa.splat(reference_depth / splat.depth),
            relative_depth: isa.splat(splat.depth - reference_depth),
            log2_opacity: isa.splat(splat.log2_opacity),
            cutoff: isa.splat(splat.cutoff),
        }
    }

    /// Intersects the rays of pixels with the plane. `WIDE` for splats that reach to the horizon.
    #[inline(always)]
    pub(crate) fn at<I: InstructionSet<Lanes = L>, const PERSPECTIVE: bool, const WIDE: bool>(
        &self,
        isa: I,
        block: usize,
        part: usize,
    ) -> Footprint<L> {
        let [p0, p1] = self.within[part];
        let p = [p0.add(isa.splat(self.origins[0].0[block])), p1.add(isa.splat(self.origins[1].0[block]))];
        let one = isa.splat(1.0);
        let least = isa.splat(LEAST_DEPTH_RATIO);
        let ratio =
            if PERSPECTIVE { p[1].neg_mul_add(self.slopes[1], p[0].neg_mul_add(self.slopes[0], one)) } else { one };
        let bounded = if PERSPECTIVE { ratio.max(least) } else { one };
        let (r, uv) = if PERSPECTIVE {
            let r = one.div(bounded);
            (r, [p[0].mul(r), p[1].mul(r)])
        } else {
            (one, p)
        };
        let in_plane = uv[0].mul_add(uv[0], uv[1].mul(uv[1]));
        let rho = if WIDE { in_plane.or_else(least.at_most(ratio), isa.splat(f32::MAX)) } else { in_plane };
        Footprint { r, ratio: bounded, uv, rho }
    }

    /// Returns where the splat is drawn.
    #[inline(always)]
    pub(crate) fn reaches(&self, at: &Footprint<L>) -> L::Mask {
        at.rho.at_most(self.cutoff)
    }

    /// Returns the opacity o · exp(−ρ/2) where the splat is drawn. Other values are any.
    #[inline(always)]
    pub(crate) fn alpha<I: InstructionSet<Lanes = L>>(&self, isa: I, at: &Footprint<L>) -> L {
        exp2(isa, at.rho.mul_add(isa.splat(-0.5 * std::f32::consts::LOG2_E), self.log2_opacity))
    }

    /// Returns the depth at pixels, measured from the reference depth.
    #[inline(always)]
    pub(crate) fn depth<const PERSPECTIVE: bool>(&self, at: &Footprint<L>) -> L {
        if PERSPECTIVE {
            self.depth.mul_add(at.r, self.minus_reference)
        } else {
            at.uv[1].mul_add(self.slopes[1], at.uv[0].mul_add(self.slopes[0], self.relative_depth))
        }
    }

    /// Returns the inverse depth at pixels of a perspective camera in units of that of the
    /// reference depth, less 1.
    #[inline(always)]
    pub(crate) fn inverse_depth<I: InstructionSet<Lanes = L>>(&self, isa: I, at: &Footprint<L>) -> L {
        at.ratio.mul_add(self.reference_ratio, isa.splat(-1.0))
    }

    /// Returns the derivative of [`Self::inverse_depth`], which is given, by the depth.
    #[inline(always)]
    pub(crate) fn by_depth<I: InstructionSet<Lanes = L>>(&self, isa: I, inverse_depth: L) -> L {
        // The reference depth over the squared depth, as both are measured.
        let whole = inverse_depth.add(isa.splat(1.0));
        whole.mul(whole).div(self.minus_reference)
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn bounds_meet_the_blocks_that_hold_their_pixels() {
        let mut splat = ScreenSplat::HIDDEN;
        for bounds in [[16, 31, 32, 47], [20, 23, 30, 90], [0, 17, 35, 36], [31, 31, 47, 60], [18, 29, 33, 46]] {
            splat.bounds = bounds;
            let mask = blocks_within(&splat, [16, 32]);
            for block in 0..BLOCKS {
                let meets = (0..LANES).any(|lane| {
                    let [column, row] = pixel_of(block, lane).map(|p| p as u16);
                    let (x, y) = (column + 16, row + 32);
                    (bounds[0]..=bounds[1]).contains(&x) && (bounds[2]..=bounds[3]).contains(&y)
                });
                assert_eq!(mask >> block & 1 == 1, meets, "{bounds:?} {block}");
            }
        }
    }
}
