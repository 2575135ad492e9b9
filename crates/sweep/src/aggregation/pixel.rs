//! Four paths extended to the hypotheses of one pixel.
//!
//! A path cost is the pixel's cost plus an increment of at most the penalty of a jump. The sum of
//! two increments therefore fits a byte, and so does half the sum of four.

#![allow(unsafe_code)]

use super::layout::{FAR, GUARD, LANES};
use super::store::Store;
use crate::simd::Bytes;

/// Inputs and outputs of one pixel. Everything is read and written as whole vectors.
///
/// The pointers are valid for the row and the row before as [`super::layout::PathRow`] draws them.
/// The `unsafe` methods below rely on that.
pub(super) struct Pixel<'a, S> {
    /// Number of hypotheses.
    pub(super) count: usize,
    /// Penalty of a step.
    pub(super) step: u8,
    /// Costs of the hypotheses.
    pub(super) costs: *const u8,
    /// Path costs of the three pixels before it in the row before, from one height below its first
    /// hypothesis on: readable for its vectors and two bytes more.
    pub(super) upper: [*const u8; 3],
    /// Least path cost of each of these three.
    pub(super) least: [&'a u8; 3],
    /// Penalties of a jump: along the row, then from the row before.
    pub(super) jumps: [&'a u8; 4],
    /// Destination of the path costs from the row before: three directions, `direction_stride`
    /// apart, each with room for a guard behind.
    pub(super) paths: *mut u8,
    /// Number of bytes from one direction to the next.
    pub(super) direction_stride: usize,
    /// Destination of the results.
    pub(super) results: S,
    /// Destination of the least path costs of the four directions.
    pub(super) leasts: *mut [u8; 4],
}

/// Part of a pixel's hypotheses: `left` of them from hypothesis `at` on.
#[derive(Clone, Copy)]
pub(super) struct Span {
    /// First hypothesis.
    pub(super) at: usize,
    /// Number of hypotheses from `at` to the pixel's last one, at most two vectors.
    pub(super) left: usize,
}

/// Mask that sets lanes to 255: none in the first two vectors' length, all in the next two.
static OUTSIDE: [u8; 4 * LANES] = {
    let mut out = [0; 4 * LANES];
    let mut i = 2 * LANES;
    while i < 4 * LANES {
        out[i] = u8::MAX;
        i += 1;
    }
    out
};

impl<S: Store> Pixel<'_, S> {
    /// Extends four paths to the hypotheses of a span that fits `N` vectors.
    ///
    /// `around` are the path costs along the row one height below, at the same height and one
    /// above; `least` is the least of them, in all lanes. Returns the pixel's own path costs along
    /// the row, and the lane-wise minima of all four directions.
    ///
    /// # Safety
    /// The pointers are as [`Pixel`] states. The span lies within the pixel's hypotheses, and
    /// `N` vectors from `span.at` on lie within its vectors.
    #[inline(always)]
    pub(super) unsafe fn extend<V: Bytes, const N: usize>(
        &self,
        token: V::Token,
        span: Span,
        around: [[V; 3]; N],
        least: V,
    ) -> ([V; N], [V; 4]) {
        let Span { at, left } = span;
        let step = V::splat(token, self.step);
        // SAFETY: costs, path costs and results can be read and written in whole vectors from `at`
        // on, as the caller vouches. `left` is at most `2 * LANES`, so the mask begins inside the
        // table, and `N` vectors, at most `2 * LANES` bytes, end inside it.
        unsafe {
            // Lanes behind the last hypothesis get a cost of 255, and with it a path cost of 255.
            let outside = OUTSIDE.as_ptr().add(2 * LANES - left);
            let cost: [V; N] = registers(|i| {
                V::load(token, self.costs.add(at + i * V::LANES)).or(V::load(token, outside.add(i * V::LANES)))
            });
            let jump = V::splat(token, *self.jumps[0]);
            let added: [V; N] = registers(|i| increment(around[i], step, least, jump));
            let along: [V; N] = registers(|i| cost[i].saturating_add(added[i]));
            let mut leasts = [lane_minima(along); 4];
            let mut sums = [added; 2];
            for d in 0..3 {
                let (least, jump) = (V::splat(token, *self.least[d]), V::splat(token, *self.jumps[d + 1]));
                let added: [V; N] = registers(|i| {
                    let from = self.upper[d].add(at + i * V::LANES);
                    let around = [V::load(token, from), V::load(token, from.add(1)), V::load(token, from.add(2))];
                    increment(around, step, least, jump)
                });
                let own: [V; N] = registers(|i| cost[i].saturating_add(added[i]));
                let to = self.paths.add(d * self.direction_stride + at);
                for (i, own) in own.iter().enumerate() {
                    own.store(to.add(i * V::LANES));
                }
                leasts[d + 1] = lane_minima(own);
                match d {
                    0 => sums[0] = registers(|i| sums[0][i].saturating_add(added[i])),
                    1 => sums[1] = added,
                    _ => sums[1] = registers(|i| sums[1][i].saturating_add(added[i])),
                }
            }
            for i in 0..N {
                self.results.store(token, at + i * V::LANES, [sums[0][i], sums[1][i]], cost[i]);
            }
            (along, leasts)
        }
    }

    /// Writes the guards behind the path costs. They are also the guards before the next pixel.
    ///
    /// # Safety
    /// The pointers are as [`Pixel`] states.
    #[inline(always)]
    pub(super) unsafe fn close(&self) {
        for d in 0..3 {
            // SAFETY: each direction has room for a guard behind the pixel's `count` path costs.
            unsafe { self.paths.add(d * self.direction_stride + self.count).cast::<[u8; GUARD]>().write([FAR; GUARD]) }
        }
    }
}

/// Makes `N` registers one after the other. (`std::array::from_fn` leaves function calls behind.)
#[inline(always)]
pub(super) fn registers<V: Copy, const N: usize>(mut register: impl FnMut(usize) -> V) -> [V; N] {
    let mut out = [register(0); N];
    for (i, out) in out.iter_mut().enumerate().skip(1) {
        *out = register(i);
    }
    out
}

/// Returns the minima of all registers, lane by lane.
#[inline(always)]
fn lane_minima<V: Bytes, const N: usize>(registers: [V; N]) -> V {
    let mut least = registers[0];
    for other in &registers[1..] {
        least = least.min(*other);
    }
    least
}

/// Returns what the way from the pixel before adds: `min(L, L(± 1) + P1, min L + P2) − min L`, with
/// L its path costs one height below, at the same height and one above.
#[inline(always)]
fn increment<V: Bytes>([below, same, above]: [V; 3], step: V, least: V, jump: V) -> V {
    same.min(below.min(above).saturating_add(step)).saturating_sub(least).min(jump)
}
