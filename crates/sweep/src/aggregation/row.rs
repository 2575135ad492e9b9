//! Path costs of one row along four directions: from the pixel before it in the row, and from three
//! pixels of the row before.
//!
//! The path costs along the row stay in registers for pixels of up to 2 · [`LANES`] hypotheses:
//! what has just been written cannot be read again one byte off without waiting for the memory.

#![allow(unsafe_code)]

use super::layout::{FAR, GUARD, HypothesisRange, LANES, PathRow, RUN, RowPixels};
use super::links::{HALF, Links, MORE, ONE, TWO};
use super::pixel::{Pixel, Span, registers};
use super::store::{Backward, Forward, Store};
use crate::simd::prefetch::prefetch;
use crate::simd::{Bytes, Instructions};

/// Costs and results are prefetched this many bytes ahead: half a microsecond, several times what
/// the memory takes. The processor's own prefetching stops at the end of a page.
const PREFETCH_BYTES: usize = 2048;

/// Input and output of a row.
pub(super) struct RowTask<'a> {
    /// Costs of the row's pixels from left to right, followed by [`LANES`] others.
    pub(super) costs: &'a [u8],
    /// Penalty of a step.
    pub(super) step: u8,
    /// Destination of the results.
    pub(super) results: RowResults<'a>,
}

/// Destination of a row's results. [`LANES`] entries behind the row's are overwritten.
pub(super) enum RowResults<'a> {
    /// Forward, from left to right: half of what four directions add to the cost, rounded up, in
    /// the layout of the costs.
    Forward(&'a mut [u8]),
    /// Backward, from right to left: the halves of the forward pass as input, and the sums of eight
    /// path costs as output, the last pixel's first.
    Backward(&'a [u8], &'a mut [u16]),
}

/// Scratch buffers for the path costs of single pixels.
#[derive(Default)]
pub(super) struct RowScratch {
    /// Path costs along the row of the pixel before and of the current one.
    along: [Vec<u8>; 2],
    /// Path costs of the pixels before, moved to the heights of the current one: three in the row
    /// before, then the one along the row.
    aside: [Vec<u8>; 4],
}

impl RowScratch {
    /// Makes room for pixels of up to `most` hypotheses, after [`LANES`] guards and before at least
    /// as many.
    fn prepare(&mut self, most: usize) {
        let len = most + 4 * LANES;
        for buffer in self.along.iter_mut().chain(&mut self.aside) {
            if buffer.len() < len {
                buffer.resize(len, FAR);
            }
            buffer[..LANES].fill(FAR);
        }
    }
}

/// Lays out the pixels in `here` and extends four paths to each of them; `above` is the row before.
///
/// `jump` maps the strength of an edge to the penalty of a jump, at most
/// [`super::penalties::JUMP_MAX`].
///
/// # Panics
/// Panics if slices are shorter than [`RowTask`] and [`RowResults`] state, or if the rows differ in
/// width.
#[inline(always)]
pub(super) fn extend_row<I: Instructions>(
    token: I,
    above: &PathRow,
    here: &mut PathRow,
    pixels: RowPixels<'_>,
    jump: impl Fn(u8) -> u8,
    task: RowTask<'_>,
    scratch: &mut RowScratch,
) {
    let RowTask { costs, step, results } = task;
    here.place(pixels, matches!(results, RowResults::Backward(..)), jump);
    assert!(costs.len() >= here.count + LANES && above.width == here.width);
    scratch.prepare(here.most);
    match results {
        RowResults::Forward(halves) => {
            assert!(halves.len() >= here.count + LANES);
            extend_pixels(token, above, here, costs, step, Forward(halves.as_mut_ptr()), scratch);
        }
        RowResults::Backward(halves, sums) => {
            assert!(halves.len().min(sums.len()) >= here.count + LANES);
            let results = Backward(halves.as_ptr(), sums.as_mut_ptr());
            extend_pixels(token, above, here, costs, step, results, scratch);
        }
    }
}

#[inline(always)]
fn extend_pixels<I: Instructions, S: Store>(
    token: I,
    above: &PathRow,
    here: &mut PathRow,
    costs: &[u8],
    step: u8,
    results: S,
    scratch: &mut RowScratch,
) {
    let RowScratch { along: [along, next], aside: [aside @ .., along_aside] } = scratch;
    let rows = RowPointers {
        step,
        costs: costs.as_ptr(),
        from: [0, 1, 2].map(|d| above.paths[d * above.direction_stride()..].as_ptr()),
        leasts_before: above.least.as_ptr(),
        direction_stride: here.direction_stride(),
        paths: here.paths.as_mut_ptr(),
        leasts: here.least[1..].as_mut_ptr(),
        results,
    };
    // `wrapping_add` keeps the pointer valid for the guards before it too.
    let mut previous = Previous::new(token, [along, next].map(|buffer| buffer.as_mut_ptr().wrapping_add(LANES)));
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
            // SAFETY: `PathRow::place` made room for all path costs of the row, with guards and
            // overhang as it draws them. What is read of the row before begins less than a guard
            // before a pixel's path costs and its heights end less than a guard behind them (the
            // classes `HALF` to `MORE`, and the check of `excess_over`), or it was copied aside.
            // Costs and results are as many as the row's hypotheses and a vector more, as
            // `extend_row` has checked. The scratch buffers have room for the largest pixel between
            // `LANES` guards and two vectors (`RowScratch::prepare`).
            unsafe {
                // Each class has a loop of its own, so that its values stay in registers.
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
                    HALF => each!(|i: usize| previous.extend_half(links.rise[i], rows.pixel(&links, start, i))),
                    ONE => each!(|i: usize| previous.extend_one(links.rise[i], rows.pixel(&links, start, i))),
                    TWO => each!(|i: usize| previous.extend_two(rows.pixel(&links, start, i))),
                    MORE => each!(|i: usize| previous.extend_more(previous.more[0], rows.pixel(&links, start, i))),
                    _ => {
                        let i = first;
                        let mut pixel = rows.pixel(&links, start, i);
                        let p = here.range(start + i + 1);
                        let before = if S::BACKWARD { start + i + 2 } else { start + i };
                        let q = here.range(before).climbed(links.climbs[0][i]);
                        let along = previous.realigned(q, p, along_aside);
                        for (d, (upper, aside)) in pixel.upper.iter_mut().zip(&mut *aside).enumerate() {
                            let entry = start + i + if S::BACKWARD { 2 - d } else { d };
                            let q = above.range(entry).climbed(links.climbs[d + 1][i]);
                            if p.excess_over(q) >= GUARD as i32 {
                                *upper = realigned(q, rows.from[d].add(above.start[entry] as usize), p, aside);
                            }
                        }
                        previous.extend_more(along, pixel);
                        done += 1;
                    }
                }
            }
        }
    }
}

/// Pointers to the first entries of a row and of the row before.
struct RowPointers<S> {
    /// Penalty of a step.
    step: u8,
    /// Costs of the row.
    costs: *const u8,
    /// Path costs of the row before, for each direction.
    from: [*const u8; 3],
    /// Least path costs of the row before, from its entry 0 on.
    leasts_before: *const [u8; 4],
    /// Number of bytes between the directions of `paths`.
    direction_stride: usize,
    /// Path costs of the row.
    paths: *mut u8,
    /// Least path costs of the row, from its first pixel on.
    leasts: *mut [u8; 4],
    /// Destination of the results.
    results: S,
}

impl<S: Store> RowPointers<S> {
    /// Returns the inputs and outputs of pixel `i` of the run from `start` on.
    ///
    /// # Safety
    /// `links` are those of the run, and the row has that pixel.
    #[inline(always)]
    unsafe fn pixel<'a>(&self, links: &'a Links, start: usize, i: usize) -> Pixel<'a, S> {
        // SAFETY: `leasts_before` has an entry more than pixels at either end, so entries
        // `start + i` to `start + i + 2` exist for a pixel of the row. The offsets of the other
        // pointers come from the links of this pixel, which `PathRow::place` keeps inside the row.
        // What may lie outside, the prefetched address and path costs that are not read in place,
        // is made by `wrapping_add`.
        unsafe {
            let q = self.leasts_before.add(start + i);
            let (a, c) = if S::BACKWARD { (q.add(2), q) } else { (q, q.add(2)) };
            let own = links.costs[i] as usize;
            let ahead = if S::BACKWARD { own.wrapping_sub(PREFETCH_BYTES) } else { own.wrapping_add(PREFETCH_BYTES) };
            prefetch(self.costs.wrapping_add(ahead));
            self.results.prefetch(ahead);
            Pixel {
                count: links.count[i] as usize,
                step: self.step,
                costs: self.costs.add(own),
                upper: registers(|d| self.from[d].wrapping_add(links.from[d][i] as usize)),
                least: [&(*a)[1], &(*q.add(1))[2], &(*c)[3]],
                jumps: registers(|d| &links.jumps[d][i]),
                paths: self.paths.add(links.to[i] as usize),
                direction_stride: self.direction_stride,
                results: self.results.pixel(own, links.preceding[i] as usize),
                leasts: self.leasts.add(start + i),
            }
        }
    }
}

/// Copies the path costs of a pixel that searches `q` to where a pixel that searches `p` reads
/// them: from one height below its first one, for its vectors and two bytes more. Other heights are
/// [`FAR`].
///
/// # Safety
/// `paths` points to as many path costs as `q` has hypotheses.
#[inline(never)]
unsafe fn realigned(q: HypothesisRange, paths: *const u8, p: HypothesisRange, buffer: &mut [u8]) -> *const u8 {
    // SAFETY: the caller vouches for `q.count()` bytes from `paths` on; nothing writes them
    // meanwhile, as `buffer` is a scratch buffer of its own.
    let paths = unsafe { std::slice::from_raw_parts(paths, q.count()) };
    let to = &mut buffer[LANES - 1..][..p.count().next_multiple_of(LANES) + 2];
    let (have, first) = (paths.len() as i64, i64::from(p.low) - i64::from(q.low) - 1);
    let from = first.clamp(0, have);
    let end = (first + to.len() as i64).clamp(from, have);
    to.fill(FAR);
    if from < end {
        let at = (from - first) as usize;
        to[at..at + (end - from) as usize].copy_from_slice(&paths[from as usize..end as usize]);
    }
    // The pointer is one to the whole buffer, as vectors are read from before and behind the range.
    buffer.as_ptr().wrapping_add(LANES - 1)
}

/// Path costs of the previous pixel along the row.
struct Previous<I: Instructions> {
    token: I,
    /// Path costs of up to twice [`LANES`] hypotheses.
    two: [I::One; 2],
    /// Least path cost.
    least: I::First,
    /// Path costs of pixels with more hypotheses, after [`LANES`] entries that are [`FAR`]; the
    /// second buffer is for the current pixel. Each has room for the largest pixel and two vectors
    /// more.
    more: [*mut u8; 2],
}

impl<I: Instructions> Previous<I> {
    /// Returns the state before a row's first pixel, from which a jump costs nothing.
    #[inline(always)]
    fn new(token: I, more: [*mut u8; 2]) -> Self {
        Self { token, two: [I::One::splat(token, FAR); 2], least: I::Half::splat(token, FAR).first(), more }
    }

    /// Extends to a pixel of class [`HALF`].
    ///
    /// # Safety
    /// The pixel's pointers are as [`Pixel`] states, and `rise` lies within
    /// ±[`crate::simd::bytes::SHIFT_MAX`].
    #[inline(always)]
    unsafe fn extend_half<S: Store>(&mut self, rise: i32, pixel: Pixel<'_, S>) {
        let span = Span { at: 0, left: pixel.count };
        // SAFETY: the caller vouches for `rise` and the pointers. The pixel fits half a vector, so
        // one vector of half the length covers it.
        unsafe {
            let around = I::lower_half(self.two[0]).three_shifts(rise);
            let ([along], leasts) = pixel.extend(self.token, span, [around], I::Half::splat_first(self.least));
            pixel.close();
            self.least = I::Half::minima(leasts, &mut *pixel.leasts);
            self.two[0] = I::widen(along);
        }
    }

    /// Extends to a pixel of class [`ONE`].
    ///
    /// # Safety
    /// The pixel's pointers are as [`Pixel`] states, and `rise` lies within
    /// ±[`crate::simd::bytes::SHIFT_MAX`].
    #[inline(always)]
    unsafe fn extend_one<S: Store>(&mut self, rise: i32, pixel: Pixel<'_, S>) {
        let (last, far) = (self.two[0], I::One::splat(self.token, FAR));
        let span = Span { at: 0, left: pixel.count };
        // SAFETY: the caller vouches for `rise` and the pointers. The pixel fits one vector.
        unsafe {
            let around =
                if rise == 0 { [last.preceded_by(far), last, last.followed_by(far)] } else { last.three_shifts(rise) };
            let ([along], leasts) = pixel.extend(self.token, span, [around], I::One::splat_first(self.least));
            pixel.close();
            self.least = I::One::minima(leasts, &mut *pixel.leasts);
            self.two[0] = along;
        }
    }

    /// Extends to a pixel of class [`TWO`].
    ///
    /// # Safety
    /// The pixel's pointers are as [`Pixel`] states.
    #[inline(always)]
    unsafe fn extend_two<S: Store>(&mut self, pixel: Pixel<'_, S>) {
        let ([first, second], far) = (self.two, I::One::splat(self.token, FAR));
        let around = [
            [first.preceded_by(far), first, first.followed_by(second)],
            [second.preceded_by(first), second, second.followed_by(far)],
        ];
        let span = Span { at: 0, left: pixel.count };
        // SAFETY: the caller vouches for the pointers. The pixel fits two vectors and needs the
        // second.
        unsafe {
            let (along, leasts) = pixel.extend(self.token, span, around, I::One::splat_first(self.least));
            pixel.close();
            self.least = I::One::minima(leasts, &mut *pixel.leasts);
            self.two = along;
        }
    }

    /// Extends to any pixel. `from` points to the path costs along the row at the pixel's own
    /// heights.
    ///
    /// # Safety
    /// The pixel's pointers are as [`Pixel`] states, and the buffers as [`Previous`] does. From a
    /// vector before `from` to a vector behind the pixel's vectors can be read.
    #[inline(always)]
    unsafe fn extend_more<S: Store>(&mut self, from: *const u8, pixel: Pixel<'_, S>) {
        let token = self.token;
        let (least, far, count) = (I::One::splat_first(self.least), I::One::splat(token, FAR), pixel.count);
        // SAFETY: the caller vouches for `from`, for the pointers and for the buffers. The loop
        // reads and writes one or two vectors at a time, of which each begins below `count`; the
        // guard behind them begins at most one vector later, where the buffer has room for two.
        unsafe {
            let to = self.more[1];
            let mut along = Along::<I::One> {
                token,
                from,
                before: I::One::load(token, from.sub(LANES)),
                here: I::One::load(token, from),
            };
            let (mut at, mut leasts) = (0, [far; 4]);
            while at < count {
                let left = (count - at).min(2 * LANES);
                let span = Span { at, left };
                let others = if left > LANES {
                    let (own, others) = pixel.extend(token, span, along.around::<2>(at), least);
                    own[0].store(to.add(at));
                    own[1].store(to.add(at + LANES));
                    others
                } else {
                    let ([own], others) = pixel.extend(token, span, along.around::<1>(at), least);
                    own.store(to.add(at));
                    others
                };
                leasts = registers(|d| leasts[d].min(others[d]));
                at += 2 * LANES;
            }
            far.store(to.add(count.next_multiple_of(LANES)));
            pixel.close();
            self.least = I::One::minima(leasts, &mut *pixel.leasts);
            self.two = registers(|i| I::One::load(token, to.add(i * LANES)));
            self.more.swap(0, 1);
        }
    }

    /// Copies the path costs of the previous pixel, which searches `q`, to the heights of a pixel
    /// that searches `p`, and returns a pointer to the one at its first height.
    ///
    /// # Safety
    /// The buffers are as [`Previous`] states, and `q` is the range of the previous pixel.
    #[inline(always)]
    unsafe fn realigned(&mut self, q: HypothesisRange, p: HypothesisRange, buffer: &mut [u8]) -> *const u8 {
        // SAFETY: the buffers have room for two vectors. They hold the path costs of the previous
        // pixel: `extend_more` wrote those of more than two vectors, and the others are written
        // here.
        unsafe {
            if q.count() <= 2 * LANES {
                self.two[0].store(self.more[0]);
                self.two[1].store(self.more[0].add(LANES));
            }
            realigned(q, self.more[0], p, buffer).add(1)
        }
    }
}

/// Path costs along the row, read vector by vector, one ahead of the one at hand.
struct Along<V: Bytes> {
    token: V::Token,
    from: *const u8,
    before: V,
    here: V,
}

impl<V: Bytes> Along<V> {
    /// Returns the next `N` vectors of path costs, from `at` on: one height below, the same height,
    /// and one above.
    ///
    /// # Safety
    /// A vector behind the last of these can be read.
    #[inline(always)]
    unsafe fn around<const N: usize>(&mut self, at: usize) -> [[V; 3]; N] {
        registers(|i| {
            // SAFETY: the caller vouches for the vector behind the last one, which is the farthest
            // that is read.
            let next = unsafe { V::load(self.token, self.from.add(at + (i + 1) * LANES)) };
            let around = [self.here.preceded_by(self.before), self.here, self.here.followed_by(next)];
            (self.before, self.here) = (self.here, next);
            around
        })
    }
}
