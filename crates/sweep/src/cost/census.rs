//! The graded census of pictures, and how far two of them are apart: the inner loops of the cost.
//!
//! Pictures and all that comes of them are rows one directly after the other, so that registers go on across their ends;
//! what that gives in the first and last columns and rows, which lack a neighbour, means nothing.

#![allow(unsafe_code)]

use multiversion::multiversion;
use multiversion::target::match_target;
#[cfg(target_arch = "x86_64")]
use std::arch::x86_64::{__m256i, __m512i};

/// Bytes that are worked on together: the longest register, or two.
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
    // SAFETY: a chunk is nothing but its bytes, as many as it is aligned to.
    unsafe { std::slice::from_raw_parts(chunks.as_ptr().cast(), chunks.len() * CHUNK) }
}

fn bytes_mut(chunks: &mut [Chunk]) -> &mut [u8] {
    // SAFETY: as above.
    unsafe { std::slice::from_raw_parts_mut(chunks.as_mut_ptr().cast(), chunks.len() * CHUNK) }
}

/// Values that a picture of `width` columns must have behind it.
pub(crate) fn overhang(width: usize) -> usize {
    width + 1 + CHUNK
}

/// The graded census of a picture: every pixel's difference to the neighbours to the right, below, below on the right, and
/// of its right neighbour to the one below; the other four are those of neighbours.
#[derive(Default)]
pub(crate) struct Census {
    /// 128 for no difference; in the order of the pixels or in what the registers make of it.
    grades: [Chunks; 4],
}

/// Room for what two pictures differ by.
#[derive(Default)]
pub(crate) struct Room {
    graded: Census,
    apart: [Chunks; 4],
}

impl Census {
    /// Grades the first `area` values of a picture of `width` columns; [`overhang`] more lie behind them.
    pub(crate) fn fill(&mut self, picture: &[i16], width: usize, area: usize) {
        let picture = &picture[..area.next_multiple_of(CHUNK) + width + 1];
        self.grades.iter_mut().for_each(|g| fit(g, area.div_ceil(CHUNK)));
        grade(picture, width, &mut self.grades);
    }

    /// Bytes of each grade.
    fn len(&self) -> usize {
        self.grades[0].len() * CHUNK
    }
}

/// The cost of every pixel of two pictures of `width` columns: the mean absolute difference of their census, cut at 128, as
/// 0 to 112. Whole chunks are written.
pub(crate) fn census_cost(a: &Census, b: &Census, width: usize, room: &mut Room, out: &mut [u8]) {
    assert!(a.len() == b.len() && out.len() >= a.len(), "{} and {} grades for {} costs", a.len(), b.len(), out.len());
    let lead = (width + 1).div_ceil(CHUNK);
    room.apart.iter_mut().for_each(|d| fit(d, lead + b.len() / CHUNK));
    compare_census(a, b, width, &mut room.apart, out);
}

/// [`census_cost`] of a picture that is not graded yet; [`overhang`] more values lie behind it.
pub(crate) fn picture_cost(picture: &[i16], b: &Census, width: usize, room: &mut Room, out: &mut [u8]) {
    assert!(picture.len() > b.len() + width && out.len() >= b.len(), "{} values of {}", picture.len(), b.len());
    let lead = (width + 1).div_ceil(CHUNK);
    room.apart.iter_mut().for_each(|d| fit(d, lead + b.len() / CHUNK));
    compare_picture(picture, b, width, room, out);
}

#[multiversion(targets("x86_64+avx512bw", "x86_64+avx2"))]
fn grade(picture: &[i16], width: usize, grades: &mut [Chunks; 4]) {
    match_target! {
        "x86_64+avx512bw" => registers::grade::<__m512i>(picture, width, grades),
        "x86_64+avx2" => registers::grade::<__m256i>(picture, width, grades),
        _ => plain::grade(picture, width, grades),
    }
}

#[multiversion(targets("x86_64+avx512bw", "x86_64+avx2"))]
fn compare_census(a: &Census, b: &Census, width: usize, apart: &mut [Chunks; 4], out: &mut [u8]) {
    match_target! {
        "x86_64+avx512bw" => registers::compare_census::<__m512i>(a, b, width, apart, out),
        "x86_64+avx2" => registers::compare_census::<__m256i>(a, b, width, apart, out),
        _ => plain::compare(a, b, width, apart, out),
    }
}

#[multiversion(targets("x86_64+avx512bw", "x86_64+avx2"))]
fn compare_picture(picture: &[i16], b: &Census, width: usize, room: &mut Room, out: &mut [u8]) {
    match_target! {
        "x86_64+avx512bw" => registers::compare_picture::<__m512i>(picture, b, width, &mut room.apart, out),
        "x86_64+avx2" => registers::compare_picture::<__m256i>(picture, b, width, &mut room.apart, out),
        _ => plain::compare_picture(picture, b, width, room, out),
    }
}

/// For all machines.
#[cfg_attr(target_arch = "x86_64", allow(dead_code, reason = "for machines without AVX2"))]
mod plain {
    use super::*;

    #[inline(always)]
    pub(super) fn grade(picture: &[i16], width: usize, grades: &mut [Chunks; 4]) {
        let [right, below, falling, rising] = grades.each_mut().map(|g| bytes_mut(g));
        codes(&picture[1..], picture, right);
        codes(&picture[width..], picture, below);
        codes(&picture[width + 1..], picture, falling);
        codes(&picture[width..], &picture[1..], rising);
    }

    /// The grades of differences.
    #[inline(always)]
    fn codes(to: &[i16], from: &[i16], out: &mut [u8]) {
        for ((o, to), from) in out.iter_mut().zip(to).zip(from) {
            *o = (to.saturating_sub(*from).clamp(-128, 127) as i8 as u8) ^ 0x80;
        }
    }

    #[inline(always)]
    pub(super) fn compare_picture(picture: &[i16], b: &Census, width: usize, room: &mut Room, out: &mut [u8]) {
        room.graded.fill(picture, width, b.len());
        compare(&room.graded, b, width, &mut room.apart, out);
    }

    #[inline(always)]
    pub(super) fn compare(a: &Census, b: &Census, width: usize, apart: &mut [Chunks; 4], out: &mut [u8]) {
        for ((a, b), d) in a.grades.iter().zip(&b.grades).zip(apart.iter_mut()) {
            let differences = bytes_mut(d).iter_mut().zip(bytes(a)).zip(bytes(b));
            differences.for_each(|((d, a), b)| *d = a.abs_diff(*b));
        }
        let [right, below, falling, rising] = apart.each_ref().map(|d| bytes(d));
        let mean = |a: u8, b: u8| (u16::from(a) + u16::from(b)).div_ceil(2) as u8;
        for (i, o) in out[..b.len()].iter_mut().enumerate().skip(width + 1) {
            let beside = mean(mean(right[i], below[i]), mean(right[i - 1], rising[i - 1]));
            let across = mean(falling[i - width - 1], falling[i]);
            let sum = beside.saturating_add(mean(mean(below[i - width], rising[i - width]), across));
            *o = sum / 2 - sum / 16;
        }
    }
}

/// For functions that are compiled for the instructions of `V`, and nowhere else.
#[cfg(target_arch = "x86_64")]
mod registers {
    use super::*;
    use crate::simd::wide::Wide;

    /// Registers of differences that are computed before they are summed: what has just been written cannot be read elsewhere in
    /// the register at once.
    const BAND: usize = 16;

    // SAFETY of all blocks below: every register that is read or written lies in a slice whose length is checked.

    #[inline(always)]
    pub(super) fn grade<V: Wide>(picture: &[i16], width: usize, grades: &mut [Chunks; 4]) {
        let len = grades[0].len() * CHUNK;
        assert!(picture.len() > len + width && grades.iter().all(|g| g.len() * CHUNK == len));
        for at in (0..len).step_by(V::BYTES) {
            // SAFETY: as above.
            unsafe {
                let own = grades_at::<V>(picture.as_ptr().add(at), width);
                for (to, own) in grades.iter_mut().zip(own) {
                    own.store(start_mut(to).add(at));
                }
            }
        }
    }

    #[inline(always)]
    pub(super) fn compare_census<V: Wide>(
        a: &Census,
        b: &Census,
        width: usize,
        apart: &mut [Chunks; 4],
        out: &mut [u8],
    ) {
        assert!(a.grades.iter().all(|g| g.len() * CHUNK == b.len()));
        // SAFETY: as above.
        unsafe { compare::<V>(|at| all_at(&a.grades, at), b, width, apart, out) }
    }

    #[inline(always)]
    pub(super) fn compare_picture<V: Wide>(
        picture: &[i16],
        b: &Census,
        width: usize,
        apart: &mut [Chunks; 4],
        out: &mut [u8],
    ) {
        assert!(picture.len() > b.len() + width);
        // SAFETY: as above.
        unsafe { compare::<V>(|at| grades_at(picture.as_ptr().add(at), width), b, width, apart, out) }
    }

    #[inline(always)]
    fn start(chunks: &Chunks) -> *const u8 {
        chunks.as_ptr().cast()
    }

    #[inline(always)]
    fn start_mut(chunks: &mut Chunks) -> *mut u8 {
        chunks.as_mut_ptr().cast()
    }

    #[inline(always)]
    unsafe fn all_at<V: Wide>([p, q, r, s]: &[Chunks; 4], at: usize) -> [V; 4] {
        // SAFETY: as above.
        unsafe { [p, q, r, s].map(|grades| V::load(start(grades).add(at))) }
    }

    /// The four grades of the pixels from `at` on, which [`Wide::in_order`] brings into their order.
    #[inline(always)]
    unsafe fn grades_at<V: Wide>(at: *const i16, width: usize) -> [V; 4] {
        // SAFETY: as above.
        unsafe {
            let (own, right) = (values(at), values(at.add(1)));
            let (below, falling) = (values(at.add(width)), values(at.add(width + 1)));
            [codes(right, own), codes(below, own), codes(falling, own), codes(below, right)]
        }
    }

    #[inline(always)]
    unsafe fn values<V: Wide>(at: *const i16) -> [V; 2] {
        // SAFETY: as above.
        unsafe { [V::load(at), V::load(at.add(V::BYTES / 2))] }
    }

    #[inline(always)]
    fn codes<V: Wide>(to: [V; 2], from: [V; 2]) -> V {
        to[0].minus_words_cut(from[0]).pack(to[1].minus_words_cut(from[1])).xor(V::splat(-128))
    }

    #[inline(always)]
    unsafe fn compare<V: Wide>(
        own: impl Fn(usize) -> [V; 4],
        b: &Census,
        width: usize,
        apart: &mut [Chunks; 4],
        out: &mut [u8],
    ) {
        let (len, lead) = (b.len(), (width + 1).next_multiple_of(CHUNK));
        assert!(b.grades.iter().all(|g| g.len() * CHUNK == len) && out.len() >= len);
        assert!(apart.iter().all(|d| d.len() * CHUNK == lead + len));
        for first in (0..len).step_by(BAND * V::BYTES) {
            let band = (first..len.min(first + BAND * V::BYTES)).step_by(V::BYTES);
            for at in band.clone() {
                // SAFETY: as above.
                unsafe { differ(own(at), all_at(&b.grades, at), lead + at, apart) };
            }
            for at in band {
                // SAFETY: as above.
                unsafe { cost::<V>(apart, lead + at, width).store(out.as_mut_ptr().add(at)) };
            }
        }
    }

    /// The means of those differences of which a pixel needs two of the same place, and those along the falling diagonal.
    #[inline(always)]
    unsafe fn differ<V: Wide>(a: [V; 4], b: [V; 4], at: usize, apart: &mut [Chunks; 4]) {
        let apart_of = |j: usize| a[j].max(b[j]).minus(a[j].min(b[j]));
        let (right, below, falling, rising) = (apart_of(0), apart_of(1), apart_of(2), apart_of(3));
        let all = [right.average(below), right.average(rising), below.average(rising), falling];
        for (to, d) in apart.iter_mut().zip(all) {
            // SAFETY: as above.
            unsafe { d.in_order().store(start_mut(to).add(at)) };
        }
    }

    /// The costs of a register's pixels from the differences to all eight neighbours.
    #[inline(always)]
    unsafe fn cost<V: Wide>([here, left, above, falling]: &[Chunks; 4], at: usize, width: usize) -> V {
        // SAFETY: as above; the chunks before the first have room for what lies a row and a pixel before it.
        let bytes = |of: &Chunks, before: usize| unsafe { V::load(start(of).add(at - before)) };
        let beside = bytes(here, 0).average(bytes(left, 1));
        let across = bytes(falling, width + 1).average(bytes(falling, 0));
        let sum = beside.plus(bytes(above, width).average(across));
        let half = sum.right(1).and(V::splat(0x7f));
        let sixteenth = sum.right(4).and(V::splat(0x0f));
        half.minus(sixteenth)
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn the_cost_is_the_mean_difference_to_eight_neighbours() {
        let (width, height) = (37, 61);
        let area = width * height;
        let picture = |factor: usize| -> Vec<i16> {
            (0..area + overhang(width)).map(|i| ((i * factor) % 331) as i16 / 2 - 80).collect()
        };
        let (a, b) = (picture(9973), picture(7919));
        let (mut census, mut other) = (Census::default(), Census::default());
        census.fill(&a, width, area);
        other.fill(&b, width, area);
        let mut room = Room::default();
        let mut costs = vec![vec![0; area.next_multiple_of(CHUNK)]; 3];
        census_cost(&census, &other, width, &mut room, &mut costs[0]);
        picture_cost(&a, &other, width, &mut room, &mut costs[1]);
        let mut plain = [Census::default(), Census::default()];
        for (plain, picture) in plain.iter_mut().zip([&a, &b]) {
            plain.grades.iter_mut().for_each(|g| fit(g, area.div_ceil(CHUNK)));
            plain::grade(picture, width, &mut plain.grades);
        }
        plain::compare(&plain[0], &plain[1], width, &mut room.apart, &mut costs[2]);
        #[cfg(target_arch = "x86_64")]
        if std::is_x86_feature_detected!("avx2") {
            let mut graded = [Census::default(), Census::default()];
            for (graded, picture) in graded.iter_mut().zip([&a, &b]) {
                graded.grades.iter_mut().for_each(|g| fit(g, area.div_ceil(CHUNK)));
                registers::grade::<__m256i>(picture, width, &mut graded.grades);
            }
            let [own, other] = &graded;
            let mut further = vec![vec![0; area.next_multiple_of(CHUNK)]; 2];
            registers::compare_census::<__m256i>(own, other, width, &mut room.apart, &mut further[0]);
            registers::compare_picture::<__m256i>(&a, other, width, &mut room.apart, &mut further[1]);
            costs.extend(further);
        }
        for y in 1..height - 1 {
            for x in 1..width - 1 {
                let i = y * width + x;
                let neighbours = [1, width - 1, width, width + 1].into_iter().flat_map(|n| [i + n, i - n]);
                let grade = |p: &[i16], n: usize| f64::from((p[n] - p[i]).clamp(-128, 128));
                let sum = neighbours.map(|n| (grade(&a, n) - grade(&b, n)).abs()).sum::<f64>();
                let expected = (sum / 8.0).min(128.0) * 112.0 / 128.0;
                // Means of two are rounded upwards.
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
