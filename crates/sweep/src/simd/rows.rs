//! Rows of pixels with the path costs that lead to them: where they lie, and what pixels have to do with those before them.
//!
//! Between the path costs of two pixels lie [`GUARD`] entries that are [`FAR`], so that those of pixels that search nearly the
//! same heights are read in place.

use multiversion::multiversion;

use crate::ranges::climb_of;

/// The cost of heights that a pixel does not search. Others reach it only where the worst cost and the penalty of a jump do
/// together, and are cut.
pub(super) const FAR: u8 = u8::MAX;
/// Most hypotheses that are worked on together, a vector register of bytes; most pixels need half of it.
pub(crate) const LANES: usize = 32;
/// Entries between the path costs of two pixels: a neighbour that searches this many heights less one beyond them finds its
/// own in place.
pub(super) const GUARD: usize = 8;
/// Pixels whose links are worked out together.
pub(super) const RUN: usize = 64;
/// How far from 0 a pixel's hypotheses may begin: two pixels' differ by what 32 bits hold.
pub(crate) const FARTHEST: u32 = 1 << 29;
/// Registers whose lanes are moved this far have none of them left.
pub(super) const REACH: i32 = LANES as i32 + 1;

/// The pixels of a row, from left to right.
#[derive(Clone, Copy)]
pub(crate) struct Pixels<'a> {
    /// First hypothesis of each.
    pub(crate) low: &'a [i32],
    /// Where a steep surface is expected at each ([`crate::ranges::Ranges::steep`]).
    pub(crate) steep: &'a [i32],
    /// Where the costs of each begin, and those of the next row.
    pub(crate) offsets: &'a [u32],
    /// Strength of the edge at each.
    pub(crate) edges: &'a [u8],
}

/// Path costs of one row along the three directions from the row before, in the order in which they are computed. What is said
/// of each pixel is in the order of the image, with one entry more at either end, at which nothing has a cost, and room for
/// whole [`RUN`]s.
#[derive(Default)]
pub(crate) struct Row {
    /// One direction after the other, as many entries each.
    pub(super) paths: Vec<u8>,
    pub(super) width: usize,
    /// All hypotheses, and the most of a pixel.
    pub(super) count: usize,
    pub(super) most: usize,
    /// Each pixel's first hypothesis, and the one behind its last.
    pub(super) low: Vec<i32>,
    pub(super) high: Vec<i32>,
    /// Where a steep surface is expected at it.
    pub(super) steep: Vec<i32>,
    /// Where its path costs are.
    pub(super) place: Vec<i32>,
    /// The penalty of a jump at it; between two pixels it is the lower one of theirs.
    pub(super) jump: Vec<u8>,
    /// The least path costs: of the path along the row, and of the three from the row before.
    pub(super) least: Vec<[u8; 4]>,
}

impl Row {
    /// Makes room for the pixels, `backward` for the last one first; `jump` is the penalty of a jump by the edge.
    ///
    /// # Panics
    /// Slices of different lengths, a pixel without hypotheses or with those of absurd heights, or more of them than a row can have.
    #[inline(always)]
    pub(crate) fn place(&mut self, pixels: Pixels<'_>, backward: bool, jump: impl Fn(u8) -> u8) {
        let Pixels { low, steep, offsets, edges } = pixels;
        let width = low.len();
        assert!(width > 0 && offsets.len() == width + 1 && edges.len() == width && steep.len() == width);
        self.resize(width);
        self.low[1..=width].copy_from_slice(low);
        self.steep[1..=width].copy_from_slice(steep);
        self.jump[1..=width].iter_mut().zip(edges).for_each(|(to, edge)| *to = jump(*edge));
        let (first, end) = (offsets[0], offsets[width]);
        let (from, to) = (&offsets[..width], &offsets[1..]);
        let high = self.high[1..=width].iter_mut().zip(low);
        let (mut fewest, mut most, mut farthest) = (i32::MAX, 0, 0);
        for ((high, low), (from, to)) in high.zip(from.iter().zip(to)) {
            let count = to.wrapping_sub(*from) as i32;
            (fewest, most, farthest) = (count.min(fewest), count.max(most), low.unsigned_abs().max(farthest));
            *high = low.wrapping_add(count);
        }
        assert!(fewest > 0, "a pixel of {fewest} hypotheses");
        assert!(farthest <= FARTHEST, "hypotheses that begin at {farthest}");
        (self.count, self.most) = (end.wrapping_sub(first) as usize, most as usize);
        // A register that overhangs and two more; guards reach as far.
        let len = self.count + GUARD * (width + 1) + 2 * LANES;
        assert!(len < i32::MAX as usize / 4, "{len} entries");
        let guard = GUARD as i32;
        for ((place, pixel), (from, to)) in self.place[1..=width].iter_mut().zip(0..).zip(from.iter().zip(to)) {
            *place = if backward {
                end.wrapping_sub(*to) as i32 + guard * (width as i32 - pixel)
            } else {
                from.wrapping_sub(first) as i32 + guard * (pixel + 1)
            };
        }
        for of_each in [&mut self.low, &mut self.high, &mut self.steep, &mut self.place] {
            (of_each[0], of_each[width + 1]) = (of_each[1], of_each[width]);
        }
        (self.jump[0], self.jump[width + 1]) = (0, 0);
        (self.least[0], self.least[width + 1]) = ([0; 4], [0; 4]);
        if self.apart() < len {
            self.paths.resize(3 * len, FAR);
        }
        let apart = self.apart();
        (0..3).for_each(|d| self.paths[d * apart..][..GUARD].fill(FAR));
    }

    fn resize(&mut self, width: usize) {
        let entries = width.next_multiple_of(RUN) + 2;
        for of_each in [&mut self.low, &mut self.high, &mut self.steep, &mut self.place] {
            of_each.resize(entries, 0);
        }
        self.jump.resize(entries, 0);
        self.least.resize(entries, [0; 4]);
        self.width = width;
    }

    /// What the pixel of an entry searches.
    #[inline(always)]
    pub(super) fn range(&self, entry: usize) -> Range {
        Range { low: self.low[entry], high: self.high[entry] }
    }

    /// From the path costs of one direction to those of the next.
    pub(super) fn apart(&self) -> usize {
        self.paths.len() / 3
    }
}

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

/// A pixel's first hypothesis, and the one behind its last.
#[derive(Debug, Clone, Copy, Default)]
pub(super) struct Range {
    pub(super) low: i32,
    pub(super) high: i32,
}

impl Range {
    #[inline(always)]
    pub(super) fn count(self) -> usize {
        self.high.wrapping_sub(self.low) as usize
    }

    #[inline(always)]
    pub(super) fn climbed(self, by: i32) -> Self {
        Self { low: self.low.wrapping_add(by), high: self.high.wrapping_add(by) }
    }

    /// By how many heights a pixel searches beyond another's.
    #[inline(always)]
    pub(super) fn beyond(self, other: Self) -> i32 {
        other.low.wrapping_sub(self.low).max(self.high.wrapping_sub(other.high))
    }
}
