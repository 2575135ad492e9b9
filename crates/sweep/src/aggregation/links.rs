//! Where the pixels of a run find the path costs of the pixels before them, and by which kernel
//! they are extended.

use multiversion::multiversion;

use super::layout::{GUARD, LANES, PathRow, RUN};
use crate::ranges::climb_of;
use crate::simd::bytes::SHIFT_MAX;

/// Links of a run of pixels to those before them: one along the row, and three in the row before.
///
/// Where a steep surface climbs between two pixels, the heights of the pixel before count as higher
/// by the climb, here and in everything below.
pub(super) struct Links {
    /// Kernel of each pixel: [`HALF`], [`ONE`], [`TWO`], [`MORE`] or [`OTHER`].
    pub(super) class: [u32; RUN],
    /// Number of hypotheses.
    pub(super) count: [u32; RUN],
    /// Index of the pixel's first cost among those of the row, from left to right.
    pub(super) costs: [u32; RUN],
    /// Number of hypotheses of all pixels before it in the order of computation.
    pub(super) preceding: [u32; RUN],
    /// Index of its path costs within a direction.
    pub(super) to: [u32; RUN],
    /// Climbs to the pixel, hypotheses: along the row, then from the three pixels of the row
    /// before.
    pub(super) climbs: [[i32; RUN]; 4],
    /// Index, within a direction of the row before, of the path cost one height below the pixel's
    /// first one, for each of the three pixels there.
    pub(super) from: [[u32; RUN]; 3],
    /// How many heights the pixel begins above the one before it along the row, cut at
    /// ±[`SHIFT_MAX`].
    pub(super) rise: [i32; RUN],
    /// Penalties of a jump: along the row, then from the three pixels of the row before.
    pub(super) jumps: [[u8; RUN]; 4],
}

/// Class of pixels that fit half a vector, as the one before them along the row does. For the
/// classes `HALF` to `MORE` the ranges of the three pixels in the row before reach as far as the
/// pixel's own, except for less than [`GUARD`] heights at either end.
pub(super) const HALF: u32 = 0;
/// Class of pixels that fit a vector, as the one before them along the row does.
pub(super) const ONE: u32 = 1;
/// Class of pixels that fit two vectors and begin at the height of the one before them along the
/// row, which has more than one vector and no more than two.
pub(super) const TWO: u32 = 2;
/// Class of pixels that begin at the height of the one before them along the row, which has more
/// than two vectors and at least as many as they have.
pub(super) const MORE: u32 = 3;
/// Class of all other pixels: path costs are copied aside where they cannot be read in place.
pub(super) const OTHER: u32 = 4;

impl Links {
    /// Returns links to be filled.
    pub(super) fn new() -> Self {
        let none = [0; RUN];
        let (climbs, from, jumps) = ([[0; RUN]; 4], [none; 3], [[0; RUN]; 4]);
        Self { class: none, count: none, costs: none, preceding: none, to: none, climbs, from, rise: [0; RUN], jumps }
    }

    /// Fills in the links of the run of pixels from `start` on.
    pub(super) fn prepare(&mut self, above: &PathRow, here: &PathRow, start: usize, backward: bool) {
        link(self, above, here, start, backward);
    }
}

#[multiversion(targets("x86_64+avx2"))]
fn link(links: &mut Links, above: &PathRow, here: &PathRow, start: usize, backward: bool) {
    let (low, high, own_start) = (run(&here.low, start + 1), run(&here.high, start + 1), run(&here.start, start + 1));
    // Entries of the pixels before: along the row, then in the row before. The backward pass
    // mirrors them.
    let others = if backward { [2, 2, 1, 0] } else { [0, 0, 1, 2] }.map(|d| start + d);
    let (q_low, q_high) = (run(&here.low, others[0]), run(&here.high, others[0]));
    let steep = run(&here.steep, start + 1);
    for (d, (climbs, other)) in links.climbs.iter_mut().zip(others).enumerate() {
        let other = run(if d == 0 { &here.steep } else { &above.steep }, other);
        climbs.iter_mut().zip(steep.iter().zip(other)).for_each(|(climb, (to, from))| *climb = climb_of(*from, *to));
    }
    let mut excess = [i32::MIN; RUN];
    for ((from, other), climbs) in links.from.iter_mut().zip(&others[1..]).zip(&links.climbs[1..]) {
        let (q_low, q_high, q_start) = (run(&above.low, *other), run(&above.high, *other), run(&above.start, *other));
        for i in 0..RUN {
            let (q_low, q_high) = (q_low[i].wrapping_add(climbs[i]), q_high[i].wrapping_add(climbs[i]));
            let lower = q_low.wrapping_sub(low[i]);
            excess[i] = excess[i].max(lower).max(high[i].wrapping_sub(q_high));
            from[i] = q_start[i].wrapping_sub(lower).wrapping_sub(1) as u32;
        }
    }
    let (lanes, guard) = (LANES as i32, GUARD as i32);
    let guards_per_pixel = if backward { -guard } else { guard };
    let mut guards = guard * if backward { here.width as i32 - start as i32 } else { start as i32 + 1 };
    for i in 0..RUN {
        let (count, q_count) = (high[i].wrapping_sub(low[i]), q_high[i].wrapping_sub(q_low[i]));
        let rise = low[i].wrapping_sub(q_low[i].wrapping_add(links.climbs[0][i]));
        let vectors = |count: i32| (count + lanes - 1) / lanes;
        let few = if count.max(q_count) > lanes / 2 { ONE } else { HALF };
        let two = if count > lanes && count.max(q_count) <= 2 * lanes { TWO } else { OTHER };
        let more = if q_count > 2 * lanes && vectors(count) <= vectors(q_count) { MORE } else { two };
        let many = if rise == 0 && q_count > lanes { more } else { OTHER };
        let class = if count.max(q_count) <= lanes { few } else { many };
        links.class[i] = if excess[i] >= guard { OTHER } else { class };
        links.rise[i] = rise.clamp(-SHIFT_MAX, SHIFT_MAX);
        links.count[i] = count as u32;
        let preceding = own_start[i].wrapping_sub(guards);
        guards += guards_per_pixel;
        links.preceding[i] = preceding as u32;
        let following = (here.count as i32).wrapping_sub(preceding).wrapping_sub(count);
        links.costs[i] = if backward { following } else { preceding } as u32;
        links.to[i] = own_start[i] as u32;
    }
    let own = run(&here.jump, start + 1);
    for (d, (jumps, other)) in links.jumps.iter_mut().zip(others).enumerate() {
        let other = run(if d == 0 { &here.jump } else { &above.jump }, other);
        jumps.iter_mut().zip(own.iter().zip(other)).for_each(|(jump, (a, b))| *jump = *a.min(b));
    }
}

/// Returns the entries of a run.
#[inline(always)]
fn run<T>(entries: &[T], from: usize) -> &[T] {
    &entries[from..][..RUN]
}
