//! Path costs of one row along four directions: from the pixel before, and from three pixels of the row before.
//!
//! The path costs along the row of up to [`LANES`] hypotheses stay in a register: what has just been written cannot be read one
//! lane off without waiting for the memory.

#![allow(unsafe_code)]

use super::layout::{FAR, GUARD, LANES, Pixels, RUN, Range, Row};
use super::links::{HALF, Links, MORE, ONE, TWO};
use super::pixel::{Pixel, lanes};
use super::store::{Backward, Forward, Store};
use crate::simd::prefetch::fetch;
use crate::simd::{Bytes, Instructions};

/// Costs and results that are asked for before their turn: half a microsecond ahead, several times what memory takes. The machine
/// itself looks ahead to the end of a page only.
const AHEAD: usize = 2048;

/// What a row of pixels is computed from, and where its results go.
pub(crate) struct Task<'a> {
    /// The costs of the row's pixels from left to right and, behind them, [`LANES`] others.
    pub(crate) costs: &'a [u8],
    /// The penalty of a step.
    pub(crate) step: u8,
    pub(crate) results: Results<'a>,
}

/// What becomes of four path costs; [`LANES`] entries more are overwritten.
pub(crate) enum Results<'a> {
    /// From left to right: halves of what they add to the cost, rounded up, in the layout of the costs.
    Forward(&'a mut [u8]),
    /// From right to left: with twice the halves of the other four, the sums of eight path costs, the last pixel's first.
    Backward(&'a [u8], &'a mut [u16]),
}

/// Room for single pixels' path costs: along the row of two, and of those before one, moved to where it has its own.
#[derive(Default)]
pub(crate) struct Room {
    along: [Vec<u8>; 2],
    aside: [Vec<u8>; 4],
}

impl Room {
    /// Makes room for pixels of up to so many hypotheses, behind [`LANES`] entries and before as many and more.
    fn prepare(&mut self, most: usize) {
        let len = most + 4 * LANES;
        for room in self.along.iter_mut().chain(&mut self.aside) {
            if room.len() < len {
                room.resize(len, FAR);
            }
            room[..LANES].fill(FAR);
        }
    }
}

/// Places the pixels in `here` and extends four paths to each; `above` is the row before, of as many. `jump` is the penalty of a
/// jump by the edge, at most [`super::penalties::JUMP_MAX`].
///
/// # Panics
/// Slices that are not as long as [`Task`] and [`Results`] say, and rows of different widths.
#[inline(always)]
pub(crate) fn extend_row<I: Instructions>(
    above: &Row,
    here: &mut Row,
    (pixels, jump): (Pixels<'_>, impl Fn(u8) -> u8),
    task: Task<'_>,
    room: &mut Room,
) {
    let Task { costs, step, results } = task;
    here.place(pixels, matches!(results, Results::Backward(..)), jump);
    assert!(costs.len() >= here.count + LANES && above.width == here.width);
    room.prepare(here.most);
    match results {
        Results::Forward(halves) => {
            assert!(halves.len() >= here.count + LANES);
            extend_pixels::<I, _>(above, here, (costs, step), Forward(halves.as_mut_ptr()), room);
        }
        Results::Backward(halves, sums) => {
            assert!(halves.len().min(sums.len()) >= here.count + LANES);
            extend_pixels::<I, _>(above, here, (costs, step), Backward(halves.as_ptr(), sums.as_mut_ptr()), room);
        }
    }
}

#[inline(always)]
fn extend_pixels<I: Instructions, S: Store>(
    above: &Row,
    here: &mut Row,
    (costs, step): (&[u8], u8),
    results: S,
    room: &mut Room,
) {
    let Room { along: [along, next], aside: [aside @ .., along_aside] } = room;
    let rows = Rows {
        step,
        costs: costs.as_ptr(),
        from: [0, 1, 2].map(|d| above.paths[d * above.apart()..].as_ptr()),
        befores: above.least.as_ptr(),
        apart: here.apart(),
        paths: here.paths.as_mut_ptr(),
        leasts: here.least[1..].as_mut_ptr(),
        results,
    };
    let mut last = Last::<I>::new([along, next].map(|room| room[LANES..].as_mut_ptr()));
    let mut links = Links::new();
    let runs = here.width.div_ceil(RUN);
    for run in 0..runs {
        let start = RUN * if S::BACKWARD { runs - 1 - run } else { run };
        links.prepare(above, here, start, S::BACKWARD);
        let many = RUN.min(here.width - start);
        let order = |done: usize| if S::BACKWARD { many - 1 - done } else { done };
        let mut done = 0;
        while done < many {
            let (first, class) = (order(done), links.class[order(done)]);
            // SAFETY: places are those that `Row::place` made room for, with whole registers and guards behind the last; what is read of
            // the row before begins less than a guard before a pixel's path costs and counts less than a guard behind them, or is moved
            // aside; costs and results are as many as the row's hypotheses and a register more, as `extend_row` checks.
            unsafe {
                // Each kind has a loop of its own, for the sake of its registers.
                macro_rules! each {
                    ($extend:expr) => {
                        loop {
                            let i = order(done);
                            $extend(i);
                            done += 1;
                            if done == many || links.class[order(done)] != class {
                                break;
                            }
                        }
                    };
                }
                match class {
                    HALF => each!(|i: usize| last.extend_half(links.by[i], rows.pixel(&links, start, i))),
                    ONE => each!(|i: usize| last.extend_one(links.by[i], rows.pixel(&links, start, i))),
                    TWO => each!(|i: usize| last.extend_two(rows.pixel(&links, start, i))),
                    MORE => each!(|i: usize| last.extend_more(last.more[0], rows.pixel(&links, start, i))),
                    _ => {
                        let i = first;
                        let mut pixel = rows.pixel(&links, start, i);
                        let p = here.range(start + i + 1);
                        let q =
                            here.range(if S::BACKWARD { start + i + 2 } else { start + i }).climbed(links.climbs[0][i]);
                        let along = last.moved(q, p, along_aside);
                        for (d, (upper, aside)) in pixel.upper.iter_mut().zip(&mut *aside).enumerate() {
                            let entry = start + i + if S::BACKWARD { 2 - d } else { d };
                            let q = above.range(entry).climbed(links.climbs[d + 1][i]);
                            if p.beyond(q) >= GUARD as i32 {
                                *upper = moved(q, rows.from[d].add(above.place[entry] as usize), p, aside);
                            }
                        }
                        last.extend_more(along, pixel);
                        done += 1;
                    }
                }
            }
        }
    }
}

/// A row's and the row's before it, from their first pixels on.
struct Rows<S> {
    step: u8,
    costs: *const u8,
    from: [*const u8; 3],
    befores: *const [u8; 4],
    apart: usize,
    paths: *mut u8,
    leasts: *mut [u8; 4],
    results: S,
}

impl<S: Store> Rows<S> {
    /// The pixel `i` of the run from `start` on.
    ///
    /// # Safety
    /// The links are those of the run, and the row has as many pixels.
    #[inline(always)]
    unsafe fn pixel<'a>(&self, links: &'a Links, start: usize, i: usize) -> Pixel<'a, S> {
        // SAFETY: the caller's.
        unsafe {
            let q = self.befores.add(start + i);
            let (a, c) = if S::BACKWARD { (q.add(2), q) } else { (q, q.add(2)) };
            let own = links.costs[i] as usize;
            let ahead = if S::BACKWARD { own.wrapping_sub(AHEAD) } else { own.wrapping_add(AHEAD) };
            fetch(self.costs.wrapping_add(ahead));
            self.results.fetch(ahead);
            Pixel {
                count: links.count[i] as usize,
                step: self.step,
                costs: self.costs.add(own),
                upper: lanes(|d| self.from[d].wrapping_add(links.from[d][i] as usize)),
                least: [&(*a)[1], &(*q.add(1))[2], &(*c)[3]],
                jumps: lanes(|d| &links.jumps[d][i]),
                paths: self.paths.add(links.to[i] as usize),
                apart: self.apart,
                results: self.results.pixel(own, links.before[i] as usize),
                leasts: self.leasts.add(start + i),
            }
        }
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
    let to = &mut to[LANES - 1..][..p.count().next_multiple_of(LANES) + 2];
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

/// The path costs of the last pixel along the row.
struct Last<I: Instructions> {
    /// Of up to twice [`LANES`] hypotheses.
    two: [I::One; 2],
    least: I::First,
    /// Those of more hypotheses, behind [`LANES`] entries that are [`FAR`] and before as many; the second is for the next pixel.
    /// There is room for the most hypotheses of a pixel and three times [`LANES`].
    more: [*mut u8; 2],
}

impl<I: Instructions> Last<I> {
    /// Whatever is before a row's first pixel: a jump from there costs nothing.
    #[inline(always)]
    fn new(more: [*mut u8; 2]) -> Self {
        Self { two: [I::One::splat(FAR); 2], least: I::Half::splat(FAR).first(), more }
    }

    /// A pixel of [`HALF`].
    ///
    /// # Safety
    /// What [`Pixel`] says, and `by` is up to [`crate::simd::bytes::REACH`].
    #[inline(always)]
    unsafe fn extend_half<S: Store>(&mut self, by: i32, pixel: Pixel<'_, S>) {
        // SAFETY: the caller's.
        unsafe {
            let around = I::half(self.two[0]).around(by);
            let ([along], leasts) = pixel.extend((0, pixel.count), [around], I::Half::splat_first(self.least));
            pixel.close();
            self.least = I::Half::leasts(leasts, &mut *pixel.leasts);
            self.two[0] = I::one(along);
        }
    }

    /// A pixel of [`ONE`].
    ///
    /// # Safety
    /// What [`Pixel`] says, and `by` is up to [`crate::simd::bytes::REACH`].
    #[inline(always)]
    unsafe fn extend_one<S: Store>(&mut self, by: i32, pixel: Pixel<'_, S>) {
        let (last, far) = (self.two[0], I::One::splat(FAR));
        // SAFETY: the caller's.
        unsafe {
            let around = if by == 0 { [last.behind(far), last, last.ahead(far)] } else { last.around(by) };
            let ([along], leasts) = pixel.extend((0, pixel.count), [around], I::One::splat_first(self.least));
            pixel.close();
            self.least = I::One::leasts(leasts, &mut *pixel.leasts);
            self.two[0] = along;
        }
    }

    /// A pixel of [`TWO`].
    ///
    /// # Safety
    /// What [`Pixel`] says.
    #[inline(always)]
    unsafe fn extend_two<S: Store>(&mut self, pixel: Pixel<'_, S>) {
        let ([first, second], far) = (self.two, I::One::splat(FAR));
        let around =
            [[first.behind(far), first, first.ahead(second)], [second.behind(first), second, second.ahead(far)]];
        // SAFETY: the caller's.
        unsafe {
            let (along, leasts) = pixel.extend((0, pixel.count), around, I::One::splat_first(self.least));
            pixel.close();
            self.least = I::One::leasts(leasts, &mut *pixel.leasts);
            self.two = along;
        }
    }

    /// Any pixel; `from` are the path costs along the row at its heights, as many as its registers hold and one on either side.
    ///
    /// # Safety
    /// What [`Pixel`] and [`Last`] say; there are as many behind and before `from` as a register holds.
    #[inline(always)]
    unsafe fn extend_more<S: Store>(&mut self, from: *const u8, pixel: Pixel<'_, S>) {
        let (least, far, count) = (I::One::splat_first(self.least), I::One::splat(FAR), pixel.count);
        // SAFETY: the caller's.
        unsafe {
            let to = self.more[1];
            let mut along = Along { from, before: I::One::load(from.sub(LANES)), here: I::One::load(from) };
            let (mut at, mut leasts) = (0, [far; 4]);
            while at < count {
                let left = (count - at).min(2 * LANES);
                let others = if left > LANES {
                    let (own, others) = pixel.extend((at, left), along.around::<2>(at), least);
                    own[0].store(to.add(at));
                    own[1].store(to.add(at + LANES));
                    others
                } else {
                    let ([own], others) = pixel.extend((at, left), along.around::<1>(at), least);
                    own.store(to.add(at));
                    others
                };
                leasts = lanes(|d| leasts[d].min(others[d]));
                at += 2 * LANES;
            }
            far.store(to.add(count.next_multiple_of(LANES)));
            pixel.close();
            self.least = I::One::leasts(leasts, &mut *pixel.leasts);
            self.two = lanes(|i| I::One::load(to.add(i * LANES)));
            self.more.swap(0, 1);
        }
    }

    /// The path costs of `q` at the heights of `p`, as its registers take them.
    ///
    /// # Safety
    /// What [`Last`] says.
    #[inline(always)]
    unsafe fn moved(&mut self, q: Range, p: Range, to: &mut [u8]) -> *const u8 {
        // SAFETY: the caller's.
        unsafe {
            if q.count() <= 2 * LANES {
                self.two[0].store(self.more[0]);
                self.two[1].store(self.more[0].add(LANES));
            }
            moved(q, self.more[0], p, to).add(1)
        }
    }
}

/// The path along the row, register after register, one ahead of the one at hand.
struct Along<V> {
    from: *const u8,
    before: V,
    here: V,
}

impl<V: Bytes> Along<V> {
    /// The next path costs from `at` on below, at the same height and above.
    ///
    /// # Safety
    /// What [`Last::extend_more`] says.
    #[inline(always)]
    unsafe fn around<const N: usize>(&mut self, at: usize) -> [[V; 3]; N] {
        lanes(|i| {
            // SAFETY: the caller's.
            let next = unsafe { V::load(self.from.add(at + (i + 1) * LANES)) };
            let around = [self.here.behind(self.before), self.here, self.here.ahead(next)];
            (self.before, self.here) = (self.here, next);
            around
        })
    }
}
