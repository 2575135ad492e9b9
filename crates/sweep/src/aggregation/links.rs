//! What pixels of a row have to do with those before them.

use multiversion::multiversion;

use super::layout::{GUARD, LANES, RUN, Row};
use crate::ranges::climb_of;
use crate::simd::bytes::REACH;

/// What the pixels of a run have to do with those before them, whose heights count as higher by the climb of a steep surface between
/// the two: all that is said of neighbours' heights here is meant so.
pub(super) struct Links {
    /// How each is worked on.
    pub(super) class: [u32; RUN],
    pub(super) count: [u32; RUN],
    /// Its costs among those of the row from left to right, and in the order of the sweep.
    pub(super) costs: [u32; RUN],
    pub(super) before: [u32; RUN],
    pub(super) to: [u32; RUN],
    /// The climbs to it, hypotheses: along the row and from the three pixels of the row before.
    pub(super) climbs: [[i32; RUN]; 4],
    /// The path costs of the three in the row before at the height below its first one, in each direction's.
    pub(super) from: [[u32; RUN]; 3],
    /// By how many heights it begins higher than the pixel before it along the row, up to [`REACH`].
    pub(super) by: [i32; RUN],
    /// The penalties of a jump, along the row and from the three pixels of the row before.
    pub(super) jumps: [[u8; RUN]; 4],
}

/// The hypotheses of a pixel, and of the one before it along the row, are up to half of [`LANES`]; its neighbours' in the row before
/// reach as far as its own, but for less than [`GUARD`] heights.
pub(super) const HALF: u32 = 0;
/// Up to [`LANES`].
pub(super) const ONE: u32 = 1;
/// More than that, up to twice as many, from the same height on as those of the pixel before it along the row.
pub(super) const TWO: u32 = 2;
/// More, from the same height on, and no more registers than that one's.
pub(super) const MORE: u32 = 3;
/// Any others.
pub(super) const OTHER: u32 = 4;

impl Links {
    pub(super) fn new() -> Self {
        let none = [0; RUN];
        let (climbs, from, jumps) = ([[0; RUN]; 4], [none; 3], [[0; RUN]; 4]);
        Self { class: none, count: none, costs: none, before: none, to: none, climbs, from, by: [0; RUN], jumps }
    }

    /// Those of the run from the pixel `start` on.
    pub(super) fn prepare(&mut self, above: &Row, here: &Row, start: usize, backward: bool) {
        link(self, above, here, start, backward);
    }
}

#[multiversion(targets("x86_64+avx2"))]
fn link(links: &mut Links, above: &Row, here: &Row, start: usize, backward: bool) {
    let (low, high, place) = (run(&here.low, start + 1), run(&here.high, start + 1), run(&here.place, start + 1));
    // Those before it are those behind it in the order of the image.
    let others = if backward { [2, 2, 1, 0] } else { [0, 0, 1, 2] }.map(|d| start + d);
    let (q_low, q_high) = (run(&here.low, others[0]), run(&here.high, others[0]));
    let steep = run(&here.steep, start + 1);
    for (d, (climbs, other)) in links.climbs.iter_mut().zip(others).enumerate() {
        let other = run(if d == 0 { &here.steep } else { &above.steep }, other);
        climbs.iter_mut().zip(steep.iter().zip(other)).for_each(|(climb, (to, from))| *climb = climb_of(*from, *to));
    }
    let mut beyond = [i32::MIN; RUN];
    for ((from, other), climbs) in links.from.iter_mut().zip(&others[1..]).zip(&links.climbs[1..]) {
        let (q_low, q_high, q_place) = (run(&above.low, *other), run(&above.high, *other), run(&above.place, *other));
        for i in 0..RUN {
            let (q_low, q_high) = (q_low[i].wrapping_add(climbs[i]), q_high[i].wrapping_add(climbs[i]));
            let lower = q_low.wrapping_sub(low[i]);
            beyond[i] = beyond[i].max(lower).max(high[i].wrapping_sub(q_high));
            from[i] = q_place[i].wrapping_sub(lower).wrapping_sub(1) as u32;
        }
    }
    let (lanes, guard) = (LANES as i32, GUARD as i32);
    let apart = if backward { -guard } else { guard };
    let mut guards = guard * if backward { here.width as i32 - start as i32 } else { start as i32 + 1 };
    for i in 0..RUN {
        let (count, q_count) = (high[i].wrapping_sub(low[i]), q_high[i].wrapping_sub(q_low[i]));
        let by = low[i].wrapping_sub(q_low[i].wrapping_add(links.climbs[0][i]));
        let registers = |count: i32| (count + lanes - 1) / lanes;
        let few = if count.max(q_count) > lanes / 2 { ONE } else { HALF };
        let two = if count > lanes && count.max(q_count) <= 2 * lanes { TWO } else { OTHER };
        let more = if q_count > 2 * lanes && registers(count) <= registers(q_count) { MORE } else { two };
        let many = if by == 0 && q_count > lanes { more } else { OTHER };
        let class = if count.max(q_count) <= lanes { few } else { many };
        links.class[i] = if beyond[i] >= guard { OTHER } else { class };
        links.by[i] = by.clamp(-REACH, REACH);
        links.count[i] = count as u32;
        let before = place[i].wrapping_sub(guards);
        guards += apart;
        links.before[i] = before as u32;
        let behind = (here.count as i32).wrapping_sub(before).wrapping_sub(count);
        links.costs[i] = if backward { behind } else { before } as u32;
        links.to[i] = place[i] as u32;
    }
    let own = run(&here.jump, start + 1);
    for (d, (jumps, other)) in links.jumps.iter_mut().zip(others).enumerate() {
        let other = run(if d == 0 { &here.jump } else { &above.jump }, other);
        jumps.iter_mut().zip(own.iter().zip(other)).for_each(|(jump, (a, b))| *jump = *a.min(b));
    }
}

/// What is said of the pixels of a run.
#[inline(always)]
fn run<T>(entries: &[T], from: usize) -> &[T] {
    &entries[from..][..RUN]
}
