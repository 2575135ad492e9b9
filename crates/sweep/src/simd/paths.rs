//! Path costs of one pixel along four directions, from those of the pixels before it.
//!
//! A pixel of up to sixteen hypotheses is one register of half the lanes, and its path costs along the row stay there: what
//! has just been written cannot be read one lane off without waiting for the memory.

use super::bytes::{Bytes, Half, Instructions};

/// The cost of heights that a pixel does not search. Others reach it only where the worst cost and the penalty of a jump do
/// together, and are cut.
pub(crate) const FAR: u8 = u8::MAX;
/// Most hypotheses that are worked on together, a vector register of bytes; most pixels need half of it.
pub(crate) const LANES: usize = 32;
/// [`FAR`] entries before and behind a pixel's path costs: a neighbour that searches this many heights less one beyond them
/// finds its own in place.
pub(crate) const GUARD: usize = 8;

/// Entries that are read or written for `count` hypotheses: whole registers.
#[inline(always)]
pub(crate) fn padded(count: usize) -> usize {
    count.next_multiple_of(if count > LANES / 2 { LANES } else { LANES / 2 })
}

/// A pixel of a row, and where its path costs are.
#[derive(Debug, Clone, Copy, Default)]
pub(crate) struct Slot {
    /// Its first hypothesis.
    pub(crate) low: i32,
    /// How many hypotheses it has.
    pub(crate) count: usize,
    /// Where its path costs are among those of its row.
    pub(crate) place: usize,
    /// The least path costs: of the path along the row, and of the three from the row before.
    pub(crate) least: [u8; 4],
    /// The penalty of a jump at this pixel; between two it is the lower one of theirs.
    pub(crate) jump: u8,
}

/// A pixel before the one at hand, as that one sees it.
#[derive(Clone, Copy)]
pub(crate) struct Previous<'a> {
    /// Its path costs from the height below the next pixel's first one on; [`FAR`] for heights that it did not search. As many
    /// as the next one takes, and two.
    paths: &'a [u8],
    least: &'a u8,
    jump: &'a u8,
}

impl<'a> Previous<'a> {
    /// The pixel of slot `q` as that of slot `p` sees it; `paths` are those of the row along direction `d`. They are moved to
    /// `aside` where they do not lie ready.
    #[inline(always)]
    pub(crate) fn new(p: &Slot, q: &'a Slot, d: usize, paths: &'a [u8], aside: &'a mut [u8]) -> Self {
        // The hypothesis that is one below the pixel's first.
        let (len, first) = (padded(p.count) + 2, p.low - q.low - 1);
        let begin = GUARD as i32 + first;
        let paths = if begin >= 0 && begin as usize + p.count + 2 <= q.count + 2 * GUARD {
            &paths[q.place - GUARD + begin as usize..][..len]
        } else {
            moved(&paths[q.place..][..q.count], first, &mut aside[..len])
        };
        Self { paths, least: &q.least[d + 1], jump: &q.jump }
    }

    /// The path costs of a pixel that follows.
    ///
    /// # Safety
    /// The pixel has hypotheses from `at` on.
    #[inline(always)]
    unsafe fn extended<V: Bytes>(&self, at: usize, cost: V, step: V, jump: V) -> V {
        // SAFETY: there are two more than whole registers.
        let around = unsafe { around(self.paths.as_ptr(), at) };
        path(cost, around, step, V::splat(*self.least), jump.min(V::splat(*self.jump)))
    }
}

/// What is to be known of a pixel, and where its results go.
pub(crate) struct Pixel<'a> {
    /// Its costs, and those of others behind them: [`padded`] in all.
    pub(crate) costs: &'a [u8],
    /// The three pixels before it in the row before.
    pub(crate) upper: [Previous<'a>; 3],
    /// What to add to its sums.
    pub(crate) before: Option<&'a [u16]>,
    /// For the path costs from the row before, those of every direction `apart` from those of the one before: [`padded`] entries
    /// and [`GUARD`] are overwritten.
    pub(crate) paths: &'a mut [u8],
    pub(crate) apart: usize,
    /// For the sums of all four paths; [`padded`] entries are overwritten.
    pub(crate) sums: &'a mut [u16],
}

/// The path costs of the last pixel along the row.
pub(crate) struct Last<'a, I: Instructions> {
    low: i32,
    count: usize,
    jump: u8,
    /// Of up to sixteen hypotheses.
    narrow: I::Narrow,
    /// The least, in all lanes.
    least: I::Narrow,
    /// Those of more hypotheses, between [`LANES`] entries that are [`FAR`]; the second is for the next pixel.
    wide: [&'a mut [u8]; 2],
    /// For those that do not lie ready.
    aside: &'a mut [u8],
}

/// All bits of no lane, and from [`LANES`] on of all of them.
static OUTSIDE: [u8; 2 * LANES] = {
    let mut out = [0; 2 * LANES];
    let mut i = LANES;
    while i < 2 * LANES {
        out[i] = u8::MAX;
        i += 1;
    }
    out
};

/// All bits in the lanes behind the first `count`.
///
/// # Safety
/// `V` has at most [`LANES`] lanes.
#[inline(always)]
unsafe fn outside<V: Bytes>(count: usize) -> V {
    // SAFETY: the table is twice as long as a register.
    unsafe { V::load(OUTSIDE.as_ptr().add(LANES - count.min(V::LANES))) }
}

/// `C + min(L, L(± 1) + P1, min L + P2) − min L`, with the path costs L from below, at the same height and above.
#[inline(always)]
fn path<V: Bytes>(cost: V, [below, same, above]: [V; 3], step: V, least: V, jump: V) -> V {
    let smooth = same.min(below.min(above).plus(step));
    cost.plus(smooth.minus(least).min(jump))
}

/// # Safety
/// The paths have `at`, two and a register's lanes more.
#[inline(always)]
unsafe fn around<V: Bytes>(paths: *const u8, at: usize) -> [V; 3] {
    // SAFETY: the caller's.
    unsafe { [V::load(paths.add(at)), V::load(paths.add(at + 1)), V::load(paths.add(at + 2))] }
}

impl<'a, I: Instructions> Last<'a, I> {
    /// Nothing comes before a row's first pixel. The buffers have room for the most hypotheses of a pixel and three times
    /// [`LANES`] more.
    pub(crate) fn none(wide: [&'a mut [u8]; 2], aside: &'a mut [u8]) -> Self {
        let (narrow, least) = (I::Narrow::splat(FAR), I::Narrow::splat(0));
        wide[0][..LANES].fill(FAR);
        wide[1][..LANES].fill(FAR);
        Self { low: 0, count: 0, jump: 0, narrow, least, wide, aside }
    }

    /// Extends four paths to the pixel of `slot`, which gets the least path costs.
    #[inline(always)]
    pub(crate) fn extend(&mut self, slot: &mut Slot, step: u8, pixel: Pixel<'_>) {
        let len = padded(slot.count);
        assert!(pixel.costs.len() >= len && pixel.sums.len() >= len);
        assert!(pixel.before.is_none_or(|sums| sums.len() >= len));
        assert!(pixel.paths.len() >= 2 * pixel.apart + len + GUARD);
        assert!(pixel.upper.iter().all(|q| q.paths.len() >= len + 2));
        // SAFETY: the lengths are checked above.
        slot.least = unsafe {
            match len <= LANES / 2 {
                true => self.extend_narrow(slot, step, pixel),
                false => self.extend_wide(slot, step, pixel),
            }
        };
        (self.low, self.count, self.jump) = (slot.low, slot.count, slot.jump);
    }

    /// # Safety
    /// All slices are as long as [`Pixel`] says.
    #[inline(always)]
    unsafe fn extend_narrow(&mut self, slot: &Slot, step: u8, pixel: Pixel<'_>) -> [u8; 4] {
        let (step, jump) = (I::Narrow::splat(step), I::Narrow::splat(slot.jump));
        let along = match self.count <= LANES / 2 {
            true => {
                let by = slot.low - self.low;
                [self.narrow.moved(by - 1), self.narrow.moved(by), self.narrow.moved(by + 1)]
            }
            // SAFETY: as many as a register and two.
            false => unsafe { around(self.window(slot).as_ptr(), 0) },
        };
        let along_jump = jump.min(I::Narrow::splat(self.jump));
        // SAFETY: the caller's.
        unsafe {
            let outside = outside::<I::Narrow>(slot.count);
            let cost = I::Narrow::load(pixel.costs.as_ptr());
            let mut values = [path(cost, along, step, self.least, along_jump); 4];
            self.narrow = values[0].or(outside);
            self.least = self.narrow.least();
            let mut own = [self.narrow; 4];
            for d in 0..3 {
                values[d + 1] = pixel.upper[d].extended(0, cost, step, jump);
                own[d + 1] = values[d + 1].or(outside);
                let to = pixel.paths.as_mut_ptr().add(d * pixel.apart);
                own[d + 1].store(to);
                close(to.add(slot.count));
            }
            add_up(values, pixel.before, 0, pixel.sums);
            I::Narrow::least_of_each(own)
        }
    }

    /// # Safety
    /// All slices are as long as [`Pixel`] says.
    #[inline(always)]
    unsafe fn extend_wide(&mut self, slot: &Slot, step: u8, mut pixel: Pixel<'_>) -> [u8; 4] {
        if self.count <= LANES / 2 {
            self.spill();
        }
        let far = I::Wide::splat(FAR);
        // Whole registers are read as they were written, where they can be.
        let in_place = slot.low == self.low && padded(slot.count) <= self.count.next_multiple_of(LANES);
        let paths = if in_place { &self.wide[0][LANES..] } else { self.window(slot) }.as_ptr();
        let mut along = Along { in_place, paths, before: far, here: far, to: self.wide[1][LANES..].as_mut_ptr() };
        let jump = I::Wide::splat(slot.jump);
        let common = Common {
            step: I::Wide::splat(step),
            jump,
            along_jump: jump.min(I::Wide::splat(self.jump)),
            along_least: I::widened(self.least),
        };
        let mut least = [far; 4];
        let whole = slot.count - slot.count % LANES;
        // SAFETY: the caller's, and the lengths of the buffers.
        unsafe {
            along.here = I::Wide::load(paths);
            for at in (0..whole).step_by(LANES) {
                extend_part(at, None, &common, &mut along, &mut pixel, &mut least);
            }
            if whole < slot.count {
                extend_part(whole, Some(outside(slot.count - whole)), &common, &mut along, &mut pixel, &mut least);
            }
            far.store(along.to.add(padded(slot.count)));
            for d in 0..3 {
                close(pixel.paths.as_mut_ptr().add(d * pixel.apart + slot.count));
            }
        }
        self.least = I::narrowed(least[0].least());
        self.wide.swap(0, 1);
        I::Wide::least_of_each(least)
    }

    /// Writes the path costs of up to sixteen hypotheses where those of more lie.
    #[inline(always)]
    fn spill(&mut self) {
        let to = &mut self.wide[0][LANES..][..2 * LANES];
        to.fill(FAR);
        // SAFETY: there is room for more than the register.
        unsafe { self.narrow.store(to.as_mut_ptr()) }
    }

    /// The path costs from the height below the first one of `slot` on, as whole registers take them.
    #[inline(always)]
    fn window(&mut self, slot: &Slot) -> &[u8] {
        let (first, len) = (slot.low - self.low - 1, padded(slot.count) + 2);
        let begin = LANES as i32 + first;
        if begin >= 0 && begin as usize + slot.count + 2 <= self.count + 2 * LANES {
            &self.wide[0][begin as usize..][..len]
        } else {
            moved(&self.wide[0][LANES..][..self.count], first, &mut self.aside[..len])
        }
    }
}

/// What all hypotheses of a pixel have in common.
struct Common<V> {
    step: V,
    jump: V,
    along_jump: V,
    along_least: V,
}

/// The path along the row, a register after the other.
struct Along<V> {
    /// Whether registers are read as they were written, one ahead of the one at hand.
    in_place: bool,
    paths: *const u8,
    before: V,
    here: V,
    to: *mut u8,
}

impl<V: Bytes> Along<V> {
    /// # Safety
    /// There are path costs of the last pixel from `at` on, and as many behind them as [`Last::none`] asks for.
    #[inline(always)]
    unsafe fn around(&mut self, at: usize) -> [V; 3] {
        // SAFETY: the caller's.
        unsafe {
            if !self.in_place {
                return around(self.paths, at);
            }
            let next = V::load(self.paths.add(at + LANES));
            let around = [self.here.behind(self.before), self.here, self.here.ahead(next)];
            (self.before, self.here) = (self.here, next);
            around
        }
    }
}

/// The hypotheses of a pixel from `at` on, as many as a register holds; `outside` are the lanes of others.
///
/// # Safety
/// All slices are as long as [`Pixel`] says, and `along` has room.
#[inline(always)]
unsafe fn extend_part<V: Bytes>(
    at: usize,
    outside: Option<V>,
    common: &Common<V>,
    along: &mut Along<V>,
    pixel: &mut Pixel<'_>,
    least: &mut [V; 4],
) {
    // SAFETY: the caller's.
    unsafe {
        let cost = V::load(pixel.costs.as_ptr().add(at));
        let around = along.around(at);
        let mut values = [path(cost, around, common.step, common.along_least, common.along_jump); 4];
        let mut to = along.to;
        for d in 0..4 {
            if d > 0 {
                values[d] = pixel.upper[d - 1].extended(at, cost, common.step, common.jump);
                to = pixel.paths.as_mut_ptr().add((d - 1) * pixel.apart);
            }
            let own = outside.map_or(values[d], |outside| values[d].or(outside));
            own.store(to.add(at));
            least[d] = least[d].min(own);
        }
        add_up(values, pixel.before, at, pixel.sums);
    }
}

/// The path costs from the hypothesis `first` on, which may lie outside, as many as `to` holds.
pub(crate) fn moved<'a>(paths: &[u8], first: i32, to: &'a mut [u8]) -> &'a [u8] {
    let (have, want) = (paths.len() as i32, to.len() as i32);
    let from = first.clamp(0, have);
    let end = first.saturating_add(want).clamp(from, have);
    to.fill(FAR);
    if from < end {
        let at = (from - first) as usize;
        to[at..at + (end - from) as usize].copy_from_slice(&paths[from as usize..end as usize]);
    }
    to
}

/// Writes the guard behind a pixel's path costs, which is the one before those of the next.
///
/// # Safety
/// [`GUARD`] bytes can be written.
#[inline(always)]
unsafe fn close(to: *mut u8) {
    // SAFETY: the caller's.
    unsafe { to.cast::<[u8; GUARD]>().write([FAR; GUARD]) }
}

/// Writes the sums of four paths from the hypothesis `at` on.
///
/// # Safety
/// The slices hold a register's lanes from there on.
#[inline(always)]
unsafe fn add_up<V: Bytes>(four: [V; 4], before: Option<&[u16]>, at: usize, sums: &mut [u16]) {
    // SAFETY: the caller's.
    unsafe {
        let to = sums.as_mut_ptr().add(at);
        match before {
            Some(before) => V::sum_with(four, before.as_ptr().add(at), to),
            None => V::sum(four, to),
        }
    }
}
