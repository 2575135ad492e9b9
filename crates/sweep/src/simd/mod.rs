//! Bytes and words side by side: AVX2 where the machine has it, plain arrays elsewhere, with the same results.
//!
//! The only unsafe module of the crate.
#![allow(unsafe_code)]

#[cfg(target_arch = "x86_64")]
mod avx2;
mod bytes;
pub(crate) mod paths;
pub(crate) mod rows;
pub(crate) mod sums;

use multiversion::multiversion;
use multiversion::target::match_target;

#[cfg(target_arch = "x86_64")]
pub(crate) use avx2::Avx2;
pub(crate) use bytes::Anywhere;

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
            "x86_64+avx2" => registers::weigh(from, 1, wx, width, to),
            _ => weigh(from, 1, wx, width, to),
        };
    }
    match_target! {
        "x86_64+avx2" => registers::weigh(rows, width, wy, width * height, out),
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

/// For functions that are compiled for AVX2, and nowhere else.
#[cfg(target_arch = "x86_64")]
mod registers {
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
}

#[cfg(test)]
mod tests {
    use super::*;

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
}
