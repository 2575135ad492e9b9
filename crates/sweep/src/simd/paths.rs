//! Path costs of one row along four directions: from the pixel before, and from three pixels of the row before.
//!
//! A pixel of up to sixteen hypotheses is one register of half the lanes, and its path costs along the row stay there: what
//! has just been written cannot be read one lane off without waiting for the memory.

use super::bytes::{Bytes, Half, Instructions};
use super::rows::{Between, FAR, GUARD, LANES, Range, Row};

/// What a row of pixels is computed from, and where its results go.
pub(crate) struct Task<'a> {
    /// The costs of the row's pixels from left to right and, behind them, [`LANES`] others.
    pub(crate) costs: &'a [u8],
    /// From right to left.
    pub(crate) backward: bool,
    /// The penalty of a step.
    pub(crate) step: u8,
    /// What to add to the sums, in the layout of the costs.
    pub(crate) before: Option<&'a [u16]>,
    /// The sums of all four paths, in the order of the row; [`LANES`] entries more are overwritten.
    pub(crate) sums: &'a mut [u16],
}

/// Extends four paths to every pixel of `here`, whose pixels are placed; `above` is the row before, of as many.
///
/// # Panics
/// Slices that are not as long as [`Task`] says, and rows of different widths.
#[inline(always)]
pub(crate) fn extend_row<I: Instructions>(above: &Row, here: &mut Row, task: Task<'_>, between: &mut Between) {
    let Task { costs, backward, step, before, sums } = task;
    assert!(costs.len() >= here.count + LANES && sums.len() >= here.count + LANES);
    assert!(before.is_none_or(|before| before.len() >= here.count + LANES));
    assert!(above.low.len() == here.low.len());
    between.prepare(above, here);
    let (width, apart) = (here.low.len() - 2, here.apart());
    let from: [*const u8; 3] = std::array::from_fn(|d| above.paths[d * above.apart()..].as_ptr());
    let Between { jumps, beyond, along: [along, next], aside: [aside @ .., along_aside] } = between;
    let [jump_along, jump_a, jump_b, jump_c] = jumps.each_ref().map(|jumps| &jumps[..width]);
    let mut last = Last::<I>::none([along.as_mut_ptr(), next.as_mut_ptr()], along_aside);
    let (low, high, base, least) =
        (&here.low[1..=width], &here.high[1..=width], &here.base[1..=width], &mut here.least[1..=width]);
    let (q_low, q_high) = (&above.low[..width + 2], &above.high[..width + 2]);
    let (q_base, q_least) = (&above.base[..width + 2], &above.least[..width + 2]);
    let beyond = &beyond[..width];
    let to = here.paths.as_mut_ptr();
    let mut done = 0;
    for j in 0..width {
        let range = Range { low: low[j], high: high[j] };
        let own = range.count();
        let at = if backward { here.count - done - own } else { done };
        // SAFETY: places are those that `Row::place` made room for, with whole registers and guards behind the last; costs and sums
        // are as many as the row's hypotheses and a register more, checked above.
        unsafe {
            let mut upper = from;
            for (d, paths) in upper.iter_mut().enumerate() {
                *paths = paths.wrapping_offset((q_base[j + d].wrapping_add(range.low) - 1) as isize);
            }
            if beyond[j] >= GUARD as i32 {
                for d in 0..3 {
                    let q = Range { low: q_low[j + d], high: q_high[j + d] };
                    let paths = from[d].add(q_base[j + d].wrapping_add(q.low) as usize);
                    upper[d] = moved(q, paths, range, &mut aside[d]);
                }
            }
            let pixel = Pixel {
                range,
                costs: costs.as_ptr().add(at),
                upper,
                least: [&q_least[j][1], &q_least[j + 1][2], &q_least[j + 2][3]],
                jumps: [&jump_along[j], &jump_a[j], &jump_b[j], &jump_c[j]],
                before: before.map(|before| before.as_ptr().add(at)),
                paths: to.add(base[j].wrapping_add(range.low) as usize),
                apart,
                sums: sums.as_mut_ptr().add(done),
            };
            least[j] = match own <= LANES / 2 {
                true => last.extend_narrow(step, &pixel),
                false => last.extend_wide(step, &pixel),
            };
        }
        last.range = range;
        done += own;
    }
}

/// The path costs of a pixel that searches `q` from the height below the first of `p` on, as many as its registers hold and two.
///
/// # Safety
/// There are as many `paths` as `q` has hypotheses.
#[inline(never)]
unsafe fn moved(q: Range, paths: *const u8, p: Range, to: &mut [u8]) -> *const u8 {
    // SAFETY: the caller's.
    let paths = unsafe { std::slice::from_raw_parts(paths, q.count()) };
    let to = &mut to[..p.count().next_multiple_of(LANES) + 2];
    let (have, first) = (paths.len() as i64, i64::from(p.low) - i64::from(q.low) - 1);
    let from = first.clamp(0, have);
    let end = (first + to.len() as i64).clamp(from, have);
    to.fill(FAR);
    if from < end {
        let at = (from - first) as usize;
        to[at..at + (end - from) as usize].copy_from_slice(&paths[from as usize..end as usize]);
    }
    to.as_ptr()
}

/// A pixel: what its path costs come from, and where they go. All that is read or written are whole registers.
struct Pixel<'a> {
    range: Range,
    costs: *const u8,
    /// The path costs of the three pixels before it in the row before, from the height below its first one on, and two more than
    /// its registers hold.
    upper: [*const u8; 3],
    /// The least of them.
    least: [&'a u8; 3],
    /// The penalties of a jump, along the row first.
    jumps: [&'a u8; 4],
    before: Option<*const u16>,
    /// For the path costs from the row before, each direction `apart` from the one before; there is room for a guard behind.
    paths: *mut u8,
    apart: usize,
    sums: *mut u16,
}

/// The path costs of the last pixel along the row.
struct Last<'a, I: Instructions> {
    range: Range,
    /// Of up to sixteen hypotheses.
    narrow: I::Narrow,
    /// The least, in all lanes.
    least: I::Narrow,
    /// Those of more hypotheses, behind [`LANES`] entries that are [`FAR`] and before as many; the second is for the next pixel.
    /// There is room for the most hypotheses of a pixel and five times [`LANES`].
    wide: [*mut u8; 2],
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
/// There are no more than the register has.
#[inline(always)]
unsafe fn outside<V: Bytes>(count: usize) -> V {
    debug_assert!(count <= V::LANES);
    // SAFETY: the table is twice as long as the longest register.
    unsafe { V::load(OUTSIDE.as_ptr().add(LANES - count)) }
}

/// `C + min(L, L(± 1) + P1, min L + P2) − min L`, with the path costs L from below, at the same height and above.
#[inline(always)]
fn path<V: Bytes>(cost: V, [below, same, above]: [V; 3], step: V, least: V, jump: V) -> V {
    let smooth = same.min(below.min(above).plus(step));
    cost.plus(smooth.minus(least).min(jump))
}

/// # Safety
/// There are a register's lanes and two.
#[inline(always)]
unsafe fn around<V: Bytes>(paths: *const u8) -> [V; 3] {
    // SAFETY: the caller's.
    unsafe { [V::load(paths), V::load(paths.add(1)), V::load(paths.add(2))] }
}

impl<'a, I: Instructions> Last<'a, I> {
    /// Nothing comes before a row's first pixel.
    #[inline(always)]
    fn none(wide: [*mut u8; 2], aside: &'a mut [u8]) -> Self {
        Self { range: Range::default(), narrow: I::Narrow::splat(FAR), least: I::Narrow::splat(0), wide, aside }
    }

    #[inline(always)]
    fn is_narrow(&self) -> bool {
        self.range.count() <= LANES / 2
    }

    /// Extends four paths to a pixel of up to sixteen hypotheses; returns the least path cost of each.
    ///
    /// # Safety
    /// What [`Pixel`] says.
    #[inline(always)]
    unsafe fn extend_narrow(&mut self, step: u8, pixel: &Pixel<'_>) -> [u8; 4] {
        let (step, count) = (I::Narrow::splat(step), pixel.range.count());
        // SAFETY: the caller's.
        unsafe {
            let along = match self.is_narrow() {
                true => self.narrow.around(pixel.range.low.wrapping_sub(self.range.low)),
                false => around(self.window(pixel.range)),
            };
            let outside = outside::<I::Narrow>(count);
            let cost = I::Narrow::load(pixel.costs);
            let mut values = [path(cost, along, step, self.least, I::Narrow::splat(*pixel.jumps[0])); 4];
            self.narrow = values[0].or(outside);
            self.least = self.narrow.least();
            let mut own = [self.narrow; 4];
            for d in 0..3 {
                let (least, jump) = (I::Narrow::splat(*pixel.least[d]), I::Narrow::splat(*pixel.jumps[d + 1]));
                values[d + 1] = path(cost, around(pixel.upper[d]), step, least, jump);
                own[d + 1] = values[d + 1].or(outside);
                let to = pixel.paths.add(d * pixel.apart);
                own[d + 1].store(to);
                close(to.add(count));
            }
            add_up(values, pixel.before, pixel.sums, 0);
            I::Narrow::least_of_each(own)
        }
    }

    /// Extends four paths to a pixel; returns the least path cost of each.
    ///
    /// # Safety
    /// What [`Pixel`] says.
    #[inline(always)]
    unsafe fn extend_wide(&mut self, step: u8, pixel: &Pixel<'_>) -> [u8; 4] {
        let (far, count) = (I::Wide::splat(FAR), pixel.range.count());
        let mut before = [I::widened(self.least); 4];
        let mut jumps = [I::Wide::splat(*pixel.jumps[0]); 4];
        for d in 0..3 {
            before[d + 1] = I::Wide::splat(*pixel.least[d]);
            jumps[d + 1] = I::Wide::splat(*pixel.jumps[d + 1]);
        }
        // SAFETY: the caller's, and the lengths of the buffers.
        unsafe {
            if self.is_narrow() {
                self.spill();
            }
            // Whole registers are read as they were written, where they can be.
            let in_place = pixel.range.low == self.range.low && count <= self.range.count().next_multiple_of(LANES);
            let from = if in_place { self.wide[0].add(LANES).cast_const() } else { self.window(pixel.range) };
            let to = self.wide[1].add(LANES);
            let along = Along { in_place, from, to, before: far, here: I::Wide::load(from) };
            let mut wide = Wide { step: I::Wide::splat(step), before, jumps, least: [far; 4], along };
            let whole = count & !(LANES - 1);
            // `step_by` would cost as much as half a register's work.
            let mut at = 0;
            while at < whole {
                wide.extend(at, None, pixel);
                at += LANES;
            }
            if whole < count {
                wide.extend(whole, Some(outside(count - whole)), pixel);
            }
            far.store(to.add(count.next_multiple_of(LANES)));
            for d in 0..3 {
                close(pixel.paths.add(d * pixel.apart + count));
            }
            self.least = I::narrowed(wide.least[0].least());
            self.wide.swap(0, 1);
            I::Wide::least_of_each(wide.least)
        }
    }

    /// Writes the path costs of up to sixteen hypotheses where those of more lie.
    ///
    /// # Safety
    /// What [`Last`] says.
    #[inline(always)]
    unsafe fn spill(&mut self) {
        // SAFETY: the caller's.
        unsafe {
            let to = self.wide[0].add(LANES);
            self.narrow.store(to);
            I::Narrow::splat(FAR).store(to.add(LANES / 2));
            I::Wide::splat(FAR).store(to.add(LANES));
        }
    }

    /// The path costs from the height below the first one of `range` on, as whole registers take them.
    ///
    /// # Safety
    /// What [`Last`] says.
    #[inline(always)]
    unsafe fn window(&mut self, range: Range) -> *const u8 {
        let q = self.range;
        // SAFETY: the caller's; there are more entries than the pixel has hypotheses.
        unsafe {
            let paths = self.wide[0].add(LANES).cast_const();
            match range.beyond(q) < LANES as i32 {
                true => paths.offset((range.low.wrapping_sub(q.low) - 1) as isize),
                false => moved(q, paths, range, self.aside),
            }
        }
    }
}

/// A pixel of more hypotheses than half a register holds: what they have in common, and the least path costs so far.
struct Wide<V> {
    step: V,
    /// The least path costs of the pixels before.
    before: [V; 4],
    jumps: [V; 4],
    least: [V; 4],
    along: Along<V>,
}

/// The path along the row, a register after the other.
struct Along<V> {
    /// Whether registers are read as they were written, one ahead of the one at hand.
    in_place: bool,
    from: *const u8,
    to: *mut u8,
    before: V,
    here: V,
}

impl<V: Bytes> Wide<V> {
    /// The hypotheses of a pixel from `at` on, as many as a register holds; `outside` are the lanes of others.
    ///
    /// # Safety
    /// What [`Pixel`] and [`Last`] say.
    #[inline(always)]
    unsafe fn extend(&mut self, at: usize, outside: Option<V>, pixel: &Pixel<'_>) {
        // SAFETY: the caller's.
        unsafe {
            let cost = V::load(pixel.costs.add(at));
            let mut values = [path(cost, self.along.around(at), self.step, self.before[0], self.jumps[0]); 4];
            for d in 0..3 {
                let upper = around(pixel.upper[d].add(at));
                values[d + 1] = path(cost, upper, self.step, self.before[d + 1], self.jumps[d + 1]);
            }
            for (d, value) in values.into_iter().enumerate() {
                let own = if let Some(outside) = outside { value.or(outside) } else { value };
                let to = if d == 0 { self.along.to } else { pixel.paths.add((d - 1) * pixel.apart) };
                own.store(to.add(at));
                self.least[d] = self.least[d].min(own);
            }
            add_up(values, pixel.before, pixel.sums, at);
        }
    }
}

impl<V: Bytes> Along<V> {
    /// # Safety
    /// There are path costs of the last pixel from `at` on, and as many behind them as [`Last`] says.
    #[inline(always)]
    unsafe fn around(&mut self, at: usize) -> [V; 3] {
        // SAFETY: the caller's.
        unsafe {
            if !self.in_place {
                return around(self.from.add(at));
            }
            let next = V::load(self.from.add(at + LANES));
            let around = [self.here.behind(self.before), self.here, self.here.ahead(next)];
            (self.before, self.here) = (self.here, next);
            around
        }
    }
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

/// Writes the sums of four paths, and of what was before, from the hypothesis `at` on.
///
/// # Safety
/// There are a register's lanes of both from there on.
#[inline(always)]
unsafe fn add_up<V: Bytes>(four: [V; 4], before: Option<*const u16>, sums: *mut u16, at: usize) {
    // SAFETY: the caller's.
    unsafe {
        match before {
            Some(before) => V::sum_with(four, before.add(at), sums.add(at)),
            None => V::sum(four, sums.add(at)),
        }
    }
}
