//! The graded census of images, and the cost of two of them: the inner loops of the cost volume.
//!
//! Images and everything made from them are rows without gaps, so that a register may run across
//! the end of a row. The results in the first and last rows and columns, which lack a neighbour,
//! are meaningless; parts of tiles have a margin for them.

#![allow(unsafe_code)]

use crate::simd::wide::Wide;
use crate::simd::wide_kernel::{WideKernel, run_wide};

/// Bytes that are worked on together: one of the longest registers, or two of the shorter ones.
pub(crate) const CHUNK: usize = 64;

/// Bytes that do not cross cache lines.
#[derive(Clone, Copy)]
#[repr(C, align(64))]
struct Chunk([u8; CHUNK]);

type Chunks = Vec<Chunk>;

fn fit(chunks: &mut Chunks, count: usize) {
    chunks.resize(count, Chunk([0; CHUNK]));
}

fn bytes(chunks: &[Chunk]) -> &[u8] {
    // SAFETY: `Chunk` is `repr(C)` with 64 bytes and an alignment of 64, so it has no padding, and
    // the slice spans exactly the chunks' bytes for the same lifetime.
    unsafe { std::slice::from_raw_parts(chunks.as_ptr().cast(), chunks.len() * CHUNK) }
}

fn bytes_mut(chunks: &mut [Chunk]) -> &mut [u8] {
    // SAFETY: `Chunk` has no padding and any bytes are valid in it; the slice spans exactly the
    // chunks' bytes, which are borrowed mutably for its lifetime.
    unsafe { std::slice::from_raw_parts_mut(chunks.as_mut_ptr().cast(), chunks.len() * CHUNK) }
}

/// Returns how many values must follow an image of `width` columns, so that its neighbours can be
/// read in whole registers.
pub(crate) fn overhang(width: usize) -> usize {
    width + 1 + CHUNK
}

/// The graded census of an image: for every pixel four of the differences to its neighbours, as
/// bytes.
///
/// The differences are: right − own, below − own, below right − own, and below − right. The other
/// four neighbours' differences are those of other pixels.
#[derive(Default)]
pub(crate) struct Census {
    /// Differences cut at ±128, plus 128. The order of the bytes within 64 is that of the pixels,
    /// or the one in which registers pack them ([`Wide::in_order`]); it is the same for all
    /// images.
    grades: [Chunks; 4],
}

/// Scratch buffers for the cost of two images.
#[derive(Default)]
pub(crate) struct CensusScratch {
    /// Census of an image that came without one.
    graded: Census,
    /// Absolute differences of grades, after room for a row and a pixel.
    differences: [Chunks; 4],
}

impl Census {
    /// Grades the first `area` values of an image of `width` columns. [`overhang`] more must
    /// follow.
    ///
    /// # Panics
    /// Panics if the image is shorter.
    pub(crate) fn fill(&mut self, image: &[i16], width: usize, area: usize) {
        let image = &image[..area.next_multiple_of(CHUNK) + width + 1];
        self.fit(area);
        run_wide(Grade { image, width, grades: &mut self.grades });
    }

    fn fit(&mut self, area: usize) {
        self.grades.iter_mut().for_each(|g| fit(g, area.div_ceil(CHUNK)));
    }

    /// Returns the number of bytes of each grade.
    fn len(&self) -> usize {
        self.grades[0].len() * CHUNK
    }
}

/// Computes the cost of every pixel of two images of `width` columns.
///
/// The cost is the mean absolute difference of their census over the eight neighbours, cut at 128
/// and scaled to 0 to 112. Whole chunks of `out` are written.
///
/// # Panics
/// Panics if the images differ in size or `out` is shorter.
pub(crate) fn census_cost(a: &Census, b: &Census, width: usize, scratch: &mut CensusScratch, out: &mut [u8]) {
    assert!(a.len() == b.len() && out.len() >= a.len(), "{} and {} grades for {} costs", a.len(), b.len(), out.len());
    scratch.fit(width, b);
    run_wide(CompareCensus { a, b, width, differences: &mut scratch.differences, out });
}

/// Computes [`census_cost`] of an image that is not graded yet. [`overhang`] more values must
/// follow it.
///
/// # Panics
/// Panics if the image or `out` is shorter than `b`.
pub(crate) fn image_cost(image: &[i16], b: &Census, width: usize, scratch: &mut CensusScratch, out: &mut [u8]) {
    assert!(image.len() > b.len() + width && out.len() >= b.len(), "{} values of {}", image.len(), b.len());
    scratch.fit(width, b);
    run_wide(CompareImage { image, b, width, scratch, out });
}

impl CensusScratch {
    fn fit(&mut self, width: usize, b: &Census) {
        let lead = (width + 1).div_ceil(CHUNK);
        self.differences.iter_mut().for_each(|d| fit(d, lead + b.len() / CHUNK));
    }
}

/// Grades an image, which has a row, a pixel and at least as many values as there are grades.
struct Grade<'a> {
    image: &'a [i16],
    width: usize,
    grades: &'a mut [Chunks; 4],
}

impl WideKernel for Grade<'_> {
    #[inline(always)]
    fn run<V: Wide>(self, token: V::Token) {
        registers::grade::<V>(token, self.image, self.width, self.grades);
    }

    fn run_plain(self) {
        plain::grade(self.image, self.width, self.grades);
    }
}

/// Compares two images that are graded.
struct CompareCensus<'a> {
    a: &'a Census,
    b: &'a Census,
    width: usize,
    differences: &'a mut [Chunks; 4],
    out: &'a mut [u8],
}

impl WideKernel for CompareCensus<'_> {
    #[inline(always)]
    fn run<V: Wide>(self, token: V::Token) {
        registers::compare_census::<V>(token, self);
    }

    fn run_plain(self) {
        plain::compare(self);
    }
}

/// Compares an image with one that is graded.
struct CompareImage<'a> {
    image: &'a [i16],
    b: &'a Census,
    width: usize,
    scratch: &'a mut CensusScratch,
    out: &'a mut [u8],
}

impl WideKernel for CompareImage<'_> {
    #[inline(always)]
    fn run<V: Wide>(self, token: V::Token) {
        registers::compare_image::<V>(token, self);
    }

    fn run_plain(self) {
        let Self { image, b, width, scratch, out } = self;
        let CensusScratch { graded, differences } = scratch;
        graded.fit(b.len());
        plain::grade(image, width, &mut graded.grades);
        plain::compare(CompareCensus { a: graded, b, width, differences, out });
    }
}

/// The kernels without registers.
mod plain {
    use super::*;

    pub(super) fn grade(image: &[i16], width: usize, grades: &mut [Chunks; 4]) {
        let [right, below, falling, rising] = grades.each_mut().map(|g| bytes_mut(g));
        codes(&image[1..], image, right);
        codes(&image[width..], image, below);
        codes(&image[width + 1..], image, falling);
        codes(&image[width..], &image[1..], rising);
    }

    /// Grades differences.
    #[inline(always)]
    fn codes(to: &[i16], from: &[i16], out: &mut [u8]) {
        for ((o, to), from) in out.iter_mut().zip(to).zip(from) {
            *o = (to.saturating_sub(*from).clamp(-128, 127) as i8 as u8) ^ 0x80;
        }
    }

    pub(super) fn compare(pair: CompareCensus<'_>) {
        let CompareCensus { a, b, width, differences, out } = pair;
        for ((a, b), d) in a.grades.iter().zip(&b.grades).zip(differences.iter_mut()) {
            let differences = bytes_mut(d).iter_mut().zip(bytes(a)).zip(bytes(b));
            differences.for_each(|((d, a), b)| *d = a.abs_diff(*b));
        }
        let [right, below, falling, rising] = differences.each_ref().map(|d| bytes(d));
        let mean = |a: u8, b: u8| (u16::from(a) + u16::from(b)).div_ceil(2) as u8;
        for (i, o) in out[..b.len()].iter_mut().enumerate().skip(width + 1) {
            let beside = mean(mean(right[i], below[i]), mean(right[i - 1], rising[i - 1]));
            let across = mean(falling[i - width - 1], falling[i]);
            let sum = beside.saturating_add(mean(mean(below[i - width], rising[i - width]), across));
            *o = sum / 2 - sum / 16;
        }
    }
}

/// The kernels with registers.
#[cfg_attr(not(target_arch = "x86_64"), allow(dead_code, reason = "there are no registers"))]
mod registers {
    use super::*;

    /// Registers of differences that are computed before they are summed: a register that has just
    /// been written cannot be read at another offset without waiting for the memory.
    const BAND: usize = 16;

    #[inline(always)]
    pub(super) fn grade<V: Wide>(token: V::Token, image: &[i16], width: usize, grades: &mut [Chunks; 4]) {
        let len = grades[0].len() * CHUNK;
        assert!(image.len() > len + width && grades.iter().all(|g| g.len() * CHUNK == len));
        for at in (0..len).step_by(V::BYTES) {
            // SAFETY: `at + V::BYTES` is at most `len`, a multiple of `CHUNK` and thus of
            // `V::BYTES`. The image has `width + 1` values more than that, as `grades_at` needs;
            // each grade has `len`.
            unsafe {
                let own = grades_at::<V>(token, image.as_ptr().add(at), width);
                for (to, own) in grades.iter_mut().zip(own) {
                    own.store(start_mut(to).add(at));
                }
            }
        }
    }

    #[inline(always)]
    pub(super) fn compare_census<V: Wide>(token: V::Token, pair: CompareCensus<'_>) {
        let CompareCensus { a, b, width, differences, out } = pair;
        assert!(a.grades.iter().all(|g| g.len() * CHUNK == b.len()));
        // SAFETY: `compare` calls the closure with `at + V::BYTES <= b.len()`, and each grade of
        // `a` has `b.len()` bytes.
        unsafe { compare::<V>(token, |at| all_at(token, &a.grades, at), b, width, differences, out) }
    }

    #[inline(always)]
    pub(super) fn compare_image<V: Wide>(token: V::Token, pair: CompareImage<'_>) {
        let CompareImage { image, b, width, scratch, out } = pair;
        assert!(image.len() > b.len() + width);
        let own = |at: usize| {
            // SAFETY: `compare` calls the closure with `at + V::BYTES <= b.len()`, and the image
            // has `width + 1` values more than that, as `grades_at` needs.
            unsafe { grades_at(token, image.as_ptr().add(at), width) }
        };
        // SAFETY: the closure is safe to call with `at + V::BYTES <= b.len()`.
        unsafe { compare::<V>(token, own, b, width, &mut scratch.differences, out) }
    }

    #[inline(always)]
    fn start(chunks: &Chunks) -> *const u8 {
        chunks.as_ptr().cast()
    }

    #[inline(always)]
    fn start_mut(chunks: &mut Chunks) -> *mut u8 {
        chunks.as_mut_ptr().cast()
    }

    /// Reads a register of each grade.
    ///
    /// # Safety
    /// Each grade has `V::BYTES` bytes from `at` on.
    #[inline(always)]
    unsafe fn all_at<V: Wide>(token: V::Token, [p, q, r, s]: &[Chunks; 4], at: usize) -> [V; 4] {
        // SAFETY: the caller vouches for the bytes of each grade.
        unsafe { [p, q, r, s].map(|grades| V::load(token, start(grades).add(at))) }
    }

    /// Grades the pixels from `at` on, in the order of [`Wide::pack`].
    ///
    /// # Safety
    /// `V::BYTES + width + 1` values can be read from `at` on.
    #[inline(always)]
    unsafe fn grades_at<V: Wide>(token: V::Token, at: *const i16, width: usize) -> [V; 4] {
        // SAFETY: the farthest register begins `width + 1` values behind `at` and has `V::BYTES`
        // values.
        unsafe {
            let (own, right) = (values(token, at), values(token, at.add(1)));
            let (below, falling) = (values(token, at.add(width)), values(token, at.add(width + 1)));
            [codes(token, right, own), codes(token, below, own), codes(token, falling, own), codes(token, below, right)]
        }
    }

    /// Reads as many values as a register has bytes.
    ///
    /// # Safety
    /// `V::BYTES` values can be read from `at` on.
    #[inline(always)]
    unsafe fn values<V: Wide>(token: V::Token, at: *const i16) -> [V; 2] {
        // SAFETY: two registers of `V::BYTES / 2` values each are the values that the caller
        // vouches for.
        unsafe { [V::load(token, at), V::load(token, at.add(V::BYTES / 2))] }
    }

    #[inline(always)]
    fn codes<V: Wide>(token: V::Token, to: [V; 2], from: [V; 2]) -> V {
        let (first, second) = (to[0].saturating_sub_words(from[0]), to[1].saturating_sub_words(from[1]));
        first.pack(second).xor(V::splat(token, -128))
    }

    /// Compares the grades that `own` returns with those of `b`.
    ///
    /// # Safety
    /// `own` can be called with any multiple of `V::BYTES` below `b.len()`.
    #[inline(always)]
    unsafe fn compare<V: Wide>(
        token: V::Token,
        own: impl Fn(usize) -> [V; 4],
        b: &Census,
        width: usize,
        differences: &mut [Chunks; 4],
        out: &mut [u8],
    ) {
        let (len, lead) = (b.len(), (width + 1).next_multiple_of(CHUNK));
        assert!(b.grades.iter().all(|g| g.len() * CHUNK == len) && out.len() >= len);
        assert!(differences.iter().all(|d| d.len() * CHUNK == lead + len));
        for first in (0..len).step_by(BAND * V::BYTES) {
            let band = (first..len.min(first + BAND * V::BYTES)).step_by(V::BYTES);
            for at in band.clone() {
                // SAFETY: `at + V::BYTES` is at most `len`, which is the length of each grade of
                // `b`, and `lead + len` that of the differences.
                unsafe { differ(own(at), all_at(token, &b.grades, at), lead + at, differences) };
            }
            for at in band {
                // SAFETY: `cost` reads from `width + 1`, at most `lead`, bytes before `lead + at`
                // up to `V::BYTES` behind it, which lie in the differences; `out` has `len` bytes.
                unsafe { cost::<V>(token, differences, lead + at, width).store(out.as_mut_ptr().add(at)) };
            }
        }
    }

    /// Stores means of those differences that a pixel needs in pairs, and the difference along the
    /// falling diagonal.
    ///
    /// # Safety
    /// Each buffer has `V::BYTES` bytes from `at` on.
    #[inline(always)]
    unsafe fn differ<V: Wide>(a: [V; 4], b: [V; 4], at: usize, differences: &mut [Chunks; 4]) {
        let difference = |j: usize| a[j].max(b[j]).saturating_sub(a[j].min(b[j]));
        let (right, below, falling, rising) = (difference(0), difference(1), difference(2), difference(3));
        let all = [right.average(below), right.average(rising), below.average(rising), falling];
        for (to, d) in differences.iter_mut().zip(all) {
            // SAFETY: the caller vouches for the bytes of each buffer.
            unsafe { d.in_order().store(start_mut(to).add(at)) };
        }
    }

    /// Computes the costs of a register's pixels from the differences to all eight neighbours.
    ///
    /// # Safety
    /// Each buffer has the bytes from `at − width − 1` to `at + V::BYTES`.
    #[inline(always)]
    unsafe fn cost<V: Wide>(token: V::Token, [here, left, above, falling]: &[Chunks; 4], at: usize, width: usize) -> V {
        // SAFETY: `before` is at most `width + 1`, and the caller vouches for the bytes from there
        // on.
        let bytes = |of: &Chunks, before: usize| unsafe { V::load(token, start(of).add(at - before)) };
        let beside = bytes(here, 0).average(bytes(left, 1));
        let across = bytes(falling, width + 1).average(bytes(falling, 0));
        let sum = beside.saturating_add(bytes(above, width).average(across));
        let half = sum.shift_words_right(1).and(V::splat(token, 0x7f));
        let sixteenth = sum.shift_words_right(4).and(V::splat(token, 0x0f));
        half.saturating_sub(sixteenth)
    }
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::simd::wide_kernel::run_with_avx2;

    #[test]
    fn the_cost_is_the_mean_difference_to_eight_neighbours() {
        let (width, height) = if cfg!(miri) { (21, 9) } else { (37, 61) };
        let area = width * height;
        let image = |factor: usize| -> Vec<i16> {
            (0..area + overhang(width)).map(|i| ((i * factor) % 331) as i16 / 2 - 80).collect()
        };
        let (a, b) = (image(9973), image(7919));
        let (mut census, mut other) = (Census::default(), Census::default());
        census.fill(&a, width, area);
        other.fill(&b, width, area);
        let mut scratch = CensusScratch::default();
        let mut costs = vec![vec![0; area.next_multiple_of(CHUNK)]; 3];
        census_cost(&census, &other, width, &mut scratch, &mut costs[0]);
        image_cost(&a, &other, width, &mut scratch, &mut costs[1]);
        let mut plain = [Census::default(), Census::default()];
        for (plain, image) in plain.iter_mut().zip([&a, &b]) {
            plain.fit(area);
            Grade { image, width, grades: &mut plain.grades }.run_plain();
        }
        let [own, other] = &plain;
        let (differences, out) = (&mut scratch.differences, &mut costs[2][..]);
        CompareCensus { a: own, b: other, width, differences, out }.run_plain();
        let mut graded = [Census::default(), Census::default()];
        let mut has_avx2 = true;
        for (graded, image) in graded.iter_mut().zip([&a, &b]) {
            graded.fit(area);
            has_avx2 &= run_with_avx2(Grade { image, width, grades: &mut graded.grades });
        }
        if has_avx2 {
            let [own, other] = &graded;
            let mut further = vec![vec![0; area.next_multiple_of(CHUNK)]; 2];
            let (differences, out) = (&mut scratch.differences, &mut further[0][..]);
            run_with_avx2(CompareCensus { a: own, b: other, width, differences, out });
            let (scratch, out) = (&mut scratch, &mut further[1][..]);
            run_with_avx2(CompareImage { image: &a, b: other, width, scratch, out });
            costs.extend(further);
        }
        for y in 1..height - 1 {
            for x in 1..width - 1 {
                let i = y * width + x;
                let neighbours = [1, width - 1, width, width + 1].into_iter().flat_map(|n| [i + n, i - n]);
                let grade = |p: &[i16], n: usize| f64::from((p[n] - p[i]).clamp(-128, 128));
                let sum = neighbours.map(|n| (grade(&a, n) - grade(&b, n)).abs()).sum::<f64>();
                let expected = (sum / 8.0).min(128.0) * 112.0 / 128.0;
                // The means of two are rounded up.
                assert!((-0.7..2.0).contains(&(f64::from(costs[0][i]) - expected)), "{} {expected}", costs[0][i]);
                assert!(
                    costs.iter().all(|c| c[i] == costs[0][i]),
                    "{:?}",
                    costs.iter().map(|c| c[i]).collect::<Vec<_>>()
                );
            }
        }
    }
}
