//! Where and how strongly a splat covers the pixels of a block, as both passes compute it.

use crate::arrange::TILE;
use crate::screen::{LOW_PASS_PER_PX2, ScreenSplat};
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
/// the horizon, and only the least footprint around the centre is drawn.
const LEAST_DEPTH_RATIO: f32 = 0.05;

/// Columns and rows of the pixels of a block.
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
    /// Position of the centre relative to the first pixel of the tile.
    offset: [f64; 2],
    pub(crate) inverse: [L; 4],
    pub(crate) slopes: [L; 2],
    pub(crate) depth: L,
    pub(crate) opacity: L,
    cutoff: L,
    /// Depth from which depths are measured.
    reference_depth: L,
}

/// A splat at the pixels of a part of a block.
pub(crate) struct Footprint<L: Lanes> {
    /// Offset from the centre, pixels.
    pub(crate) dx: L,
    pub(crate) dy: L,
    /// A · offset.
    pub(crate) p: [L; 2],
    /// Depth of the intersection relative to that of the centre; 1 for affine cameras.
    pub(crate) r: L,
    /// Position in the plane, standard deviations.
    pub(crate) uv: [L; 2],
    /// u² + v².
    pub(crate) in_plane: L,
    /// Where the least footprint is drawn rather than the ellipse.
    pub(crate) low_pass: L::Mask,
    /// Where the splat is drawn.
    pub(crate) drawn: L::Mask,
    /// Squared distance from the centre.
    rho: L,
}

impl<L: Lanes> Brush<L> {
    #[inline(always)]
    pub(crate) fn new<I: InstructionSet<Lanes = L>>(
        isa: I,
        splat: &ScreenSplat,
        tile_origin: [usize; 2],
        reference_depth: f32,
    ) -> Self {
        Self {
            offset: [0, 1].map(|i| splat.pixel[i] - tile_origin[i] as f64),
            inverse: [
                isa.splat(splat.inverse[0]),
                isa.splat(splat.inverse[1]),
                isa.splat(splat.inverse[2]),
                isa.splat(splat.inverse[3]),
            ],
            slopes: [isa.splat(splat.slopes[0]), isa.splat(splat.slopes[1])],
            depth: isa.splat(splat.depth),
            opacity: isa.splat(splat.opacity),
            cutoff: isa.splat(splat.cutoff),
            reference_depth: isa.splat(reference_depth),
        }
    }

    /// Intersects the rays of pixels with the plane.
    #[inline(always)]
    pub(crate) fn at<I: InstructionSet<Lanes = L>, const PERSPECTIVE: bool>(
        &self,
        isa: I,
        block: usize,
        part: usize,
    ) -> Footprint<L> {
        let [column, row] = pixel_of(block, 0);
        let dx = isa.load(&COLUMNS, part).add(isa.splat((column as f64 - self.offset[0]) as f32));
        let dy = isa.load(&ROWS, part).add(isa.splat((row as f64 - self.offset[1]) as f32));
        let [a0, b0, a1, b1] = self.inverse;
        let p = [a0.mul_add(dx, b0.mul(dy)), a1.mul_add(dx, b1.mul(dy))];
        let one = isa.splat(1.0);
        let least = isa.splat(LEAST_DEPTH_RATIO);
        let ratio =
            if PERSPECTIVE { p[1].neg_mul_add(self.slopes[1], p[0].neg_mul_add(self.slopes[0], one)) } else { one };
        let (r, uv) = if PERSPECTIVE {
            let r = one.div(ratio.max(least));
            (r, [p[0].mul(r), p[1].mul(r)])
        } else {
            (one, p)
        };
        let in_plane = uv[0].mul_add(uv[0], uv[1].mul(uv[1]));
        let in_image = dx.mul_add(dx, dy.mul(dy)).mul(isa.splat(LOW_PASS_PER_PX2 as f32));
        let mut on_plane = in_plane.at_most(in_image);
        if PERSPECTIVE {
            on_plane = L::both(on_plane, least.at_most(ratio));
        }
        let rho = in_plane.or_else(on_plane, in_image);
        let drawn = rho.at_most(self.cutoff);
        Footprint { dx, dy, p, r, uv, in_plane, low_pass: L::only_first(drawn, on_plane), drawn, rho }
    }

    /// Returns the depth at pixels, measured from the reference depth.
    #[inline(always)]
    pub(crate) fn depth<I: InstructionSet<Lanes = L>, const PERSPECTIVE: bool>(&self, _: I, at: &Footprint<L>) -> L {
        let on_plane = if PERSPECTIVE {
            self.depth.mul(at.r)
        } else {
            at.uv[1].mul_add(self.slopes[1], at.uv[0].mul_add(self.slopes[0], self.depth))
        };
        self.depth.or_else(at.low_pass, on_plane).sub(self.reference_depth)
    }
}

impl<L: Lanes> Footprint<L> {
    /// Returns the Gaussian exp(−ρ/2).
    #[inline(always)]
    pub(crate) fn gaussian<I: InstructionSet<Lanes = L>>(&self, isa: I) -> L {
        // Beyond the cutoff the value is not used, but has to stay a number.
        exp2(isa, self.rho.min(isa.splat(100.0)).mul(isa.splat(-0.5 * std::f32::consts::LOG2_E)))
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
