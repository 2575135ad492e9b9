//! Bytes and words side by side: AVX2 where the machine has it, plain arrays elsewhere, with the same results.
//!
//! The only unsafe module of the crate.
#![allow(unsafe_code)]

use multiversion::multiversion;
use multiversion::target::match_target;

/// A picture of `stride` columns per row, with [`OVERHANG`] values behind it.
#[derive(Clone, Copy)]
pub(crate) struct Picture<'a> {
    pub(crate) data: &'a [i16],
    pub(crate) stride: usize,
}

/// Values that may be read, and changed, behind what is asked for: whole registers are written.
pub(crate) const OVERHANG: usize = 16;

/// `out[y][x] = Σ wy[j] wx[i] picture[y0 + y + j][x0 + x + i]`: a whole tile shifted by one sub-pixel vector; weights in 2¹⁵ths,
/// each product rounded. `rows` is for three rows more than `out`, and both for [`OVERHANG`] values more.
#[multiversion(targets("x86_64+avx2"))]
pub(crate) fn shift_bicubic(
    picture: Picture<'_>,
    (x0, y0): (usize, usize),
    (wx, wy): ([i16; 4], [i16; 4]),
    (width, height): (usize, usize),
    rows: &mut [i16],
    out: &mut [i16],
) {
    for y in 0..height + 3 {
        let from = &picture.data[(y0 + y) * picture.stride + x0..];
        let to = &mut rows[y * width..(y + 1) * width + OVERHANG];
        match_target! {
            "x86_64+avx2" => avx2::weigh(from, 1, wx, width, to),
            _ => weigh(from, 1, wx, width, to),
        };
    }
    match_target! {
        "x86_64+avx2" => avx2::weigh(rows, width, wy, width * height, out),
        _ => weigh(rows, width, wy, width * height, out),
    };
}

/// The weighted sums of four values `apart`, from each of the first `count` on.
#[cfg_attr(target_arch = "x86_64", allow(dead_code, reason = "for machines without AVX2"))]
#[inline(always)]
fn weigh(from: &[i16], apart: usize, [p, q, r, s]: [i16; 4], count: usize, out: &mut [i16]) {
    let product = |v: i16, w: i16| ((((i32::from(v) * i32::from(w)) >> 14) + 1) >> 1) as i16;
    let (a, b, c, d) = (from, &from[apart..], &from[2 * apart..], &from[3 * apart..]);
    for x in 0..count {
        let outer = product(a[x], p).wrapping_add(product(d[x], s));
        out[x] = outer.wrapping_add(product(b[x], q)).saturating_add(product(c[x], r));
    }
}

/// Columns of sixteen rows of sixteen bytes, which begin `stride` apart.
#[inline(always)]
pub(crate) fn transposed(rows: &[u8], stride: usize) -> [[u8; 16]; 16] {
    #[cfg(target_arch = "x86_64")]
    {
        sse2::transposed(rows, stride)
    }
    #[cfg(not(target_arch = "x86_64"))]
    {
        std::array::from_fn(|x| std::array::from_fn(|y| rows[y * stride + x]))
    }
}

/// What every x86-64 has.
#[cfg(target_arch = "x86_64")]
mod sse2 {
    use std::arch::x86_64::*;

    #[inline(always)]
    pub(super) fn transposed(rows: &[u8], stride: usize) -> [[u8; 16]; 16] {
        // SAFETY: loads and stores are bound by the slices, which are as long as the register.
        let mut m: [__m128i; 16] =
            std::array::from_fn(|y| unsafe { _mm_loadu_si128(rows[y * stride..][..16].as_ptr().cast()) });
        // Laying row i beside row i + 8, byte by byte, moves one bit of the row's number into the column's.
        for _ in 0..4 {
            // SAFETY: SSE2 is part of x86-64.
            m = std::array::from_fn(|i| unsafe {
                match i % 2 {
                    0 => _mm_unpacklo_epi8(m[i / 2], m[i / 2 + 8]),
                    _ => _mm_unpackhi_epi8(m[i / 2], m[i / 2 + 8]),
                }
            });
        }
        let mut out = [[0u8; 16]; 16];
        for (out, m) in out.iter_mut().zip(m) {
            // SAFETY: as above.
            unsafe { _mm_storeu_si128(out.as_mut_ptr().cast(), m) }
        }
        out
    }
}

/// Lanes of unsigned bytes.
pub(crate) trait Bytes: Copy {
    /// How many.
    const LANES: usize;
    fn splat(value: u8) -> Self;
    /// The first [`Self::LANES`] of `from`.
    fn load(from: &[u8]) -> Self;
    /// Into the first [`Self::LANES`] of `to`.
    fn store(self, to: &mut [u8]);
    fn min(self, other: Self) -> Self;
    /// Sums, 255 where they are more.
    fn plus(self, other: Self) -> Self;
    /// Differences, 0 where they are less.
    fn minus(self, other: Self) -> Self;
    fn and(self, other: Self) -> Self;
    /// `self`, and 255 where `mask` is 0; `mask` is 0 or 255.
    fn or_not(self, mask: Self) -> Self;
    /// Adds four of them to the first [`Self::LANES`] of `sums`.
    fn add_to(four: [Self; 4], sums: &mut [u16]);
    /// The least lane of each of four.
    fn least(four: [Self; 4]) -> [u8; 4];
}

/// Bytes as an array.
#[derive(Debug, Clone, Copy)]
pub(crate) struct Plain<const N: usize>([u8; N]);

impl<const N: usize> Plain<N> {
    #[inline(always)]
    fn zip(self, other: Self, f: impl Fn(u8, u8) -> u8) -> Self {
        Self(std::array::from_fn(|i| f(self.0[i], other.0[i])))
    }
}

impl<const N: usize> Bytes for Plain<N> {
    const LANES: usize = N;

    #[inline(always)]
    fn splat(value: u8) -> Self {
        Self([value; N])
    }

    #[inline(always)]
    fn load(from: &[u8]) -> Self {
        let mut out = [0; N];
        out.copy_from_slice(&from[..N]);
        Self(out)
    }

    #[inline(always)]
    fn store(self, to: &mut [u8]) {
        to[..N].copy_from_slice(&self.0);
    }

    #[inline(always)]
    fn min(self, other: Self) -> Self {
        self.zip(other, u8::min)
    }

    #[inline(always)]
    fn plus(self, other: Self) -> Self {
        self.zip(other, u8::saturating_add)
    }

    #[inline(always)]
    fn minus(self, other: Self) -> Self {
        self.zip(other, u8::saturating_sub)
    }

    #[inline(always)]
    fn and(self, other: Self) -> Self {
        self.zip(other, |a, b| a & b)
    }

    #[inline(always)]
    fn or_not(self, mask: Self) -> Self {
        self.zip(mask, |a, mask| a | !mask)
    }

    #[inline(always)]
    fn add_to(four: [Self; 4], sums: &mut [u16]) {
        for (i, sum) in sums[..N].iter_mut().enumerate() {
            *sum += four.iter().map(|v| u16::from(v.0[i])).sum::<u16>();
        }
    }

    #[inline(always)]
    fn least(four: [Self; 4]) -> [u8; 4] {
        four.map(|v| v.0.iter().fold(u8::MAX, |least, v| least.min(*v)))
    }
}

#[cfg(target_arch = "x86_64")]
pub(crate) use avx2::{Sixteen, ThirtyTwo};

/// For functions that are compiled for AVX2, and nowhere else.
#[cfg(target_arch = "x86_64")]
mod avx2 {
    use super::Bytes;
    use std::arch::x86_64::*;

    /// [`super::weigh`], a register at a time.
    #[inline(always)]
    pub(super) fn weigh(from: &[i16], apart: usize, [p, q, r, s]: [i16; 4], count: usize, out: &mut [i16]) {
        let whole = count.next_multiple_of(super::OVERHANG);
        let (out, from) = (&mut out[..whole], &from[..3 * apart + whole]);
        // SAFETY: the instructions are those of AVX2, for whose functions alone this is; every register that is read or
        // written lies in the slices, whose lengths are checked above.
        unsafe {
            let [p, q, r, s] = [_mm256_set1_epi16(p), _mm256_set1_epi16(q), _mm256_set1_epi16(r), _mm256_set1_epi16(s)];
            for x in (0..whole).step_by(super::OVERHANG) {
                let at = from.as_ptr().add(x);
                let outer = _mm256_add_epi16(
                    _mm256_mulhrs_epi16(_mm256_loadu_si256(at.cast()), p),
                    _mm256_mulhrs_epi16(_mm256_loadu_si256(at.add(3 * apart).cast()), s),
                );
                let second = _mm256_mulhrs_epi16(_mm256_loadu_si256(at.add(apart).cast()), q);
                let third = _mm256_mulhrs_epi16(_mm256_loadu_si256(at.add(2 * apart).cast()), r);
                let sum = _mm256_adds_epi16(_mm256_add_epi16(outer, second), third);
                _mm256_storeu_si256(out.as_mut_ptr().add(x).cast(), sum);
            }
        }
    }

    #[derive(Debug, Clone, Copy)]
    pub(crate) struct Sixteen(__m128i);

    #[derive(Debug, Clone, Copy)]
    pub(crate) struct ThirtyTwo(__m256i);

    // SAFETY of all blocks below: the instructions are those of AVX2, for whose functions alone these types are; loads and
    // stores are bound by the slices, which are as long as the register.
    impl Bytes for Sixteen {
        const LANES: usize = 16;

        #[inline(always)]
        fn splat(value: u8) -> Self {
            // SAFETY: as above.
            Self(unsafe { _mm_set1_epi8(value as i8) })
        }

        #[inline(always)]
        fn load(from: &[u8]) -> Self {
            // SAFETY: as above.
            Self(unsafe { _mm_loadu_si128(from[..16].as_ptr().cast()) })
        }

        #[inline(always)]
        fn store(self, to: &mut [u8]) {
            // SAFETY: as above.
            unsafe { _mm_storeu_si128(to[..16].as_mut_ptr().cast(), self.0) }
        }

        #[inline(always)]
        fn min(self, other: Self) -> Self {
            // SAFETY: as above.
            Self(unsafe { _mm_min_epu8(self.0, other.0) })
        }

        #[inline(always)]
        fn plus(self, other: Self) -> Self {
            // SAFETY: as above.
            Self(unsafe { _mm_adds_epu8(self.0, other.0) })
        }

        #[inline(always)]
        fn minus(self, other: Self) -> Self {
            // SAFETY: as above.
            Self(unsafe { _mm_subs_epu8(self.0, other.0) })
        }

        #[inline(always)]
        fn and(self, other: Self) -> Self {
            // SAFETY: as above.
            Self(unsafe { _mm_and_si128(self.0, other.0) })
        }

        #[inline(always)]
        fn or_not(self, mask: Self) -> Self {
            // SAFETY: as above.
            Self(unsafe { _mm_or_si128(self.0, _mm_cmpeq_epi8(mask.0, _mm_setzero_si128())) })
        }

        #[inline(always)]
        fn add_to([a, b, c, d]: [Self; 4], sums: &mut [u16]) {
            let sums = &mut sums[..16];
            // SAFETY: as above; the sums are 32 bytes long.
            unsafe {
                let ones = _mm_set1_epi8(1);
                let low = _mm_add_epi16(
                    _mm_maddubs_epi16(_mm_unpacklo_epi8(a.0, b.0), ones),
                    _mm_maddubs_epi16(_mm_unpacklo_epi8(c.0, d.0), ones),
                );
                let high = _mm_add_epi16(
                    _mm_maddubs_epi16(_mm_unpackhi_epi8(a.0, b.0), ones),
                    _mm_maddubs_epi16(_mm_unpackhi_epi8(c.0, d.0), ones),
                );
                let at: *mut __m256i = sums.as_mut_ptr().cast();
                _mm256_storeu_si256(at, _mm256_add_epi16(_mm256_loadu_si256(at), _mm256_set_m128i(high, low)));
            }
        }

        #[inline(always)]
        fn least([a, b, c, d]: [Self; 4]) -> [u8; 4] {
            // SAFETY: as above.
            unsafe {
                // Each step halves the lanes of every vector and lays two of them side by side.
                let ab = _mm_min_epu8(_mm_unpacklo_epi8(a.0, b.0), _mm_unpackhi_epi8(a.0, b.0));
                let cd = _mm_min_epu8(_mm_unpacklo_epi8(c.0, d.0), _mm_unpackhi_epi8(c.0, d.0));
                let all = _mm_min_epu8(_mm_unpacklo_epi16(ab, cd), _mm_unpackhi_epi16(ab, cd));
                let all = _mm_min_epu8(all, _mm_srli_si128::<8>(all));
                let all = _mm_min_epu8(all, _mm_srli_si128::<4>(all));
                _mm_cvtsi128_si32(all).to_le_bytes()
            }
        }
    }

    impl Bytes for ThirtyTwo {
        const LANES: usize = 32;

        #[inline(always)]
        fn splat(value: u8) -> Self {
            // SAFETY: as above.
            Self(unsafe { _mm256_set1_epi8(value as i8) })
        }

        #[inline(always)]
        fn load(from: &[u8]) -> Self {
            // SAFETY: as above.
            Self(unsafe { _mm256_loadu_si256(from[..32].as_ptr().cast()) })
        }

        #[inline(always)]
        fn store(self, to: &mut [u8]) {
            // SAFETY: as above.
            unsafe { _mm256_storeu_si256(to[..32].as_mut_ptr().cast(), self.0) }
        }

        #[inline(always)]
        fn min(self, other: Self) -> Self {
            // SAFETY: as above.
            Self(unsafe { _mm256_min_epu8(self.0, other.0) })
        }

        #[inline(always)]
        fn plus(self, other: Self) -> Self {
            // SAFETY: as above.
            Self(unsafe { _mm256_adds_epu8(self.0, other.0) })
        }

        #[inline(always)]
        fn minus(self, other: Self) -> Self {
            // SAFETY: as above.
            Self(unsafe { _mm256_subs_epu8(self.0, other.0) })
        }

        #[inline(always)]
        fn and(self, other: Self) -> Self {
            // SAFETY: as above.
            Self(unsafe { _mm256_and_si256(self.0, other.0) })
        }

        #[inline(always)]
        fn or_not(self, mask: Self) -> Self {
            // SAFETY: as above.
            Self(unsafe { _mm256_or_si256(self.0, _mm256_cmpeq_epi8(mask.0, _mm256_setzero_si256())) })
        }

        #[inline(always)]
        fn add_to([a, b, c, d]: [Self; 4], sums: &mut [u16]) {
            let sums = &mut sums[..32];
            // SAFETY: as above; the sums are 64 bytes long.
            unsafe {
                let ones = _mm256_set1_epi8(1);
                // Lanes 0 to 7 and 16 to 23, and the others: unpacking keeps to the halves of a register.
                let outer = _mm256_add_epi16(
                    _mm256_maddubs_epi16(_mm256_unpacklo_epi8(a.0, b.0), ones),
                    _mm256_maddubs_epi16(_mm256_unpacklo_epi8(c.0, d.0), ones),
                );
                let inner = _mm256_add_epi16(
                    _mm256_maddubs_epi16(_mm256_unpackhi_epi8(a.0, b.0), ones),
                    _mm256_maddubs_epi16(_mm256_unpackhi_epi8(c.0, d.0), ones),
                );
                let at: *mut __m256i = sums.as_mut_ptr().cast();
                let low = _mm256_permute2x128_si256::<0x20>(outer, inner);
                let high = _mm256_permute2x128_si256::<0x31>(outer, inner);
                _mm256_storeu_si256(at, _mm256_add_epi16(_mm256_loadu_si256(at), low));
                let at = at.add(1);
                _mm256_storeu_si256(at, _mm256_add_epi16(_mm256_loadu_si256(at), high));
            }
        }

        #[inline(always)]
        fn least(four: [Self; 4]) -> [u8; 4] {
            // SAFETY: as above.
            let half = |v: Self| unsafe {
                Sixteen(_mm_min_epu8(_mm256_castsi256_si128(v.0), _mm256_extracti128_si256::<1>(v.0)))
            };
            Sixteen::least(four.map(half))
        }
    }
}

#[cfg(test)]
mod tests {
    use super::*;
    use proptest::prelude::*;

    /// Everything that `V` can do with some bytes.
    fn results<V: Bytes>(bytes: &[u8], sums: &[u16]) -> (Vec<Vec<u8>>, Vec<u16>, [u8; 4]) {
        let n = V::LANES;
        let four: [V; 4] = std::array::from_fn(|i| V::load(&bytes[i * n..]));
        let [a, b, c, d] = four;
        let mask: Vec<u8> = bytes[3 * n..].iter().map(|v| if *v < 100 { 0 } else { 255 }).collect();
        let made = [a.min(b), a.plus(b), a.minus(b), a.and(c), d.or_not(V::load(&mask)), V::splat(bytes[0])];
        let stored = made.map(|v| {
            let mut out = vec![0; n];
            v.store(&mut out);
            out
        });
        let mut sums = sums.to_vec();
        V::add_to(four, &mut sums);
        (stored.to_vec(), sums, V::least(four))
    }

    #[test]
    fn a_shifted_picture_is_the_weighted_sum_of_sixteen_values() {
        let (stride, width, height) = (29, 21, 5);
        let data: Vec<i16> = (0..stride * 12 + OVERHANG as i32).map(|i| ((i * 977) % 16_001 - 8_000) as i16).collect();
        let (wx, wy) = ([-2048, 18_000, 19_000, -2184], [-1000, 30_000, 4_000, -232]);
        let at = |x: usize, y: usize| f64::from(data[y * stride as usize + x]);
        let picture = Picture { data: &data, stride: stride as usize };
        let (mut rows, mut out) = (vec![0; width * (height + 3) + OVERHANG], vec![0; width * height + OVERHANG]);
        shift_bicubic(picture, (4, 2), (wx, wy), (width, height), &mut rows, &mut out);
        let rounded = |v: f64, w: i16| (v * f64::from(w) / 32_768.0 + 0.5).floor();
        for y in 0..height {
            for x in 0..width {
                let row = |j: usize| (0..4).map(|i| rounded(at(4 + x + i, 2 + y + j), wx[i])).sum::<f64>();
                let expected = (0..4).map(|j| rounded(row(j), wy[j])).sum::<f64>();
                assert_eq!(f64::from(out[y * width + x]), expected);
            }
        }
        let mut plain = vec![0; width];
        weigh(&data, stride as usize, wy, width, &mut plain);
        assert_eq!(f64::from(plain[3]), (0..4).map(|j| rounded(at(3, j), wy[j])).sum::<f64>());
    }

    #[test]
    fn columns_become_rows() {
        let rows: Vec<u8> = (0..16 * 21).map(|i| (i * 7 % 251) as u8).collect();
        let columns = transposed(&rows, 21);
        assert!((0..16).all(|x| (0..16).all(|y| columns[x][y] == rows[21 * y + x])));
    }

    proptest! {
        #[test]
        fn registers_do_what_arrays_do(
            bytes in prop::collection::vec(any::<u8>(), 128),
            sums in prop::collection::vec(0..60_000u16, 40),
        ) {
            #[cfg(target_arch = "x86_64")]
            if std::is_x86_feature_detected!("avx2") {
                prop_assert_eq!(results::<Sixteen>(&bytes, &sums), results::<Plain<16>>(&bytes, &sums));
                prop_assert_eq!(results::<ThirtyTwo>(&bytes, &sums), results::<Plain<32>>(&bytes, &sums));
            }
            let (stored, added, least) = results::<Plain<16>>(&bytes, &sums);
            prop_assert_eq!(stored[1][3], bytes[3].saturating_add(bytes[19]));
            let four: u16 = (0..4).map(|i| u16::from(bytes[16 * i + 5])).sum();
            prop_assert_eq!((added[5], added[16]), (sums[5] + four, sums[16]));
            prop_assert_eq!(Some(least[2]), bytes[32..48].iter().min().copied());
        }
    }
}
