//! Four paths extended to the hypotheses of one pixel, and what becomes of their costs.
//!
//! A path cost is the pixel's cost and what the way there adds, which is no more than the penalty of a jump: two of them fit a
//! byte, and so does half of four.

#![allow(unsafe_code)]

use super::layout::{FAR, GUARD, LANES};
use super::store::Store;
use crate::simd::Bytes;

/// A pixel: what its path costs come from, and where they go. All that is read or written are whole registers.
pub(super) struct Pixel<'a, S> {
    pub(super) count: usize,
    pub(super) step: u8,
    pub(super) costs: *const u8,
    /// The path costs of the three pixels before it in the row before, from the height below its first one on, and two more than
    /// its registers hold.
    pub(super) upper: [*const u8; 3],
    /// The least of them.
    pub(super) least: [&'a u8; 3],
    /// The penalties of a jump, along the row first.
    pub(super) jumps: [&'a u8; 4],
    /// For the path costs from the row before, each direction `apart` from the one before; there is room for a guard behind.
    pub(super) paths: *mut u8,
    pub(super) apart: usize,
    pub(super) results: S,
    /// For the least path costs.
    pub(super) leasts: *mut [u8; 4],
}

/// No bits of twice [`LANES`], and all of as many.
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
    /// Extends four paths to the hypotheses from `at` on, as many as `N` registers hold; `left` of them are the pixel's, or all.
    /// `around` are the path costs along the row, and `least` the least of them. Returns its own path costs along the row, and all
    /// four's least.
    ///
    /// # Safety
    /// What [`Pixel`] says.
    #[inline(always)]
    pub(super) unsafe fn extend<V: Bytes, const N: usize>(
        &self,
        (at, left): (usize, usize),
        around: [[V; 3]; N],
        least: V,
    ) -> ([V; N], [V; 4]) {
        let step = V::splat(self.step);
        // SAFETY: the caller's; the table is twice as long as the registers.
        unsafe {
            // Where the cost has all bits, so has the path cost.
            let outside = OUTSIDE.as_ptr().add(2 * LANES - left);
            let cost: [V; N] =
                lanes(|i| V::load(self.costs.add(at + i * V::LANES)).or(V::load(outside.add(i * V::LANES))));
            let jump = V::splat(*self.jumps[0]);
            let added: [V; N] = lanes(|i| turn(around[i], step, least, jump));
            let along: [V; N] = lanes(|i| cost[i].plus(added[i]));
            let mut leasts = [lesser(along); 4];
            let mut sums = [added; 2];
            for d in 0..3 {
                let (least, jump) = (V::splat(*self.least[d]), V::splat(*self.jumps[d + 1]));
                let added: [V; N] = lanes(|i| {
                    let from = self.upper[d].add(at + i * V::LANES);
                    turn([V::load(from), V::load(from.add(1)), V::load(from.add(2))], step, least, jump)
                });
                let own: [V; N] = lanes(|i| cost[i].plus(added[i]));
                let to = self.paths.add(d * self.apart + at);
                for (i, own) in own.iter().enumerate() {
                    own.store(to.add(i * V::LANES));
                }
                leasts[d + 1] = lesser(own);
                match d {
                    0 => sums[0] = lanes(|i| sums[0][i].plus(added[i])),
                    1 => sums[1] = added,
                    _ => sums[1] = lanes(|i| sums[1][i].plus(added[i])),
                }
            }
            for i in 0..N {
                self.results.store(at + i * V::LANES, [sums[0][i], sums[1][i]], cost[i]);
            }
            (along, leasts)
        }
    }

    /// Writes the guards behind the path costs, which are those before the next pixel's.
    ///
    /// # Safety
    /// What [`Pixel`] says.
    #[inline(always)]
    pub(super) unsafe fn close(&self) {
        for d in 0..3 {
            // SAFETY: the caller's.
            unsafe { self.paths.add(d * self.apart + self.count).cast::<[u8; GUARD]>().write([FAR; GUARD]) }
        }
    }
}

/// A register after the other. (The library's way leaves calls behind.)
#[inline(always)]
pub(super) fn lanes<V: Copy, const N: usize>(mut register: impl FnMut(usize) -> V) -> [V; N] {
    let mut out = [register(0); N];
    for (i, out) in out.iter_mut().enumerate().skip(1) {
        *out = register(i);
    }
    out
}

/// The lesser ones of each lane.
#[inline(always)]
fn lesser<V: Bytes, const N: usize>(registers: [V; N]) -> V {
    let mut least = registers[0];
    for other in &registers[1..] {
        least = least.min(*other);
    }
    least
}

/// What the way from a pixel adds: `min(L, L(± 1) + P1, min L + P2) − min L`, with its path costs L from below, at the same
/// height and above.
#[inline(always)]
fn turn<V: Bytes>([below, same, above]: [V; 3], step: V, least: V, jump: V) -> V {
    same.min(below.min(above).plus(step)).minus(least).min(jump)
}
