//! A picture shifted by a sub-pixel vector: bicubic, in 16-bit integers.

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
/// each product rounded. `out` is for [`OVERHANG`] values more; `rows` is room.
#[multiversion(targets("x86_64+avx2"))]
pub(crate) fn shift_bicubic(
    picture: Picture<'_>,
    at: (usize, usize),
    weights: ([i16; 4], [i16; 4]),
    (width, height): (usize, usize),
    rows: &mut Vec<i16>,
    out: &mut [i16],
) {
    match_target! {
        "x86_64+avx2" => registers::shift(picture, at, weights, (width, height), rows, out),
        _ => shift(picture, at, weights, (width, height), rows, out),
    }
}

/// Along the rows first, then across them.
#[cfg_attr(target_arch = "x86_64", allow(dead_code, reason = "for machines without AVX2"))]
#[inline(always)]
fn shift(
    picture: Picture<'_>,
    (x0, y0): (usize, usize),
    (wx, wy): ([i16; 4], [i16; 4]),
    (width, height): (usize, usize),
    rows: &mut Vec<i16>,
    out: &mut [i16],
) {
    rows.resize(width * (height + 3), 0);
    for (y, row) in rows.chunks_exact_mut(width).enumerate() {
        weigh(&picture.data[(y0 + y) * picture.stride + x0..], 1, wx, row);
    }
    weigh(rows, width, wy, &mut out[..width * height]);
}

/// The weighted sums of four values `apart`, from each on.
#[cfg_attr(target_arch = "x86_64", allow(dead_code, reason = "for machines without AVX2"))]
#[inline(always)]
fn weigh(from: &[i16], apart: usize, [p, q, r, s]: [i16; 4], out: &mut [i16]) {
    let product = |v: i16, w: i16| ((((i32::from(v) * i32::from(w)) >> 14) + 1) >> 1) as i16;
    let (a, b, c, d) = (from, &from[apart..], &from[2 * apart..], &from[3 * apart..]);
    for (x, out) in out.iter_mut().enumerate() {
        let outer = product(a[x], p).wrapping_add(product(d[x], s));
        *out = outer.wrapping_add(product(b[x], q)).saturating_add(product(c[x], r));
    }
}

/// For functions that are compiled for AVX2, and nowhere else.
#[cfg(target_arch = "x86_64")]
mod registers {
    use super::{OVERHANG, Picture};
    use std::arch::x86_64::*;

    /// [`super::shift`] by strips as wide as a register, down the rows: what is summed along a row stays in registers until
    /// the three rows below are there.
    #[inline(always)]
    pub(super) fn shift(
        picture: Picture<'_>,
        (x0, y0): (usize, usize),
        (wx, wy): ([i16; 4], [i16; 4]),
        (width, height): (usize, usize),
        _: &mut Vec<i16>,
        out: &mut [i16],
    ) {
        // SAFETY of all blocks below: the instructions are those of AVX2, for whose functions alone this is; every register that
        // is read or written lies in a slice whose length is checked.
        // SAFETY: as above.
        let (wx, wy) = unsafe { (wx.map(|w| _mm256_set1_epi16(w)), wy.map(|w| _mm256_set1_epi16(w))) };
        let stride = picture.stride;
        let from = &picture.data[y0 * stride + x0..][..(height + 2) * stride + width.next_multiple_of(OVERHANG) + 3];
        let out = &mut out[..(height - 1) * width + width.next_multiple_of(OVERHANG)];
        // The last strip's overhang lies where the first one writes later.
        for x in (0..width).step_by(OVERHANG).rev() {
            // SAFETY: as above.
            unsafe {
                let from = from.as_ptr().add(x);
                let (mut a, mut b) = (along(from, wx), along(from.add(stride), wx));
                let mut c = along(from.add(2 * stride), wx);
                for y in 0..height {
                    let d = along(from.add((y + 3) * stride), wx);
                    _mm256_storeu_si256(out.as_mut_ptr().add(y * width + x).cast(), weigh([a, b, c, d], wy));
                    (a, b, c) = (b, c, d);
                }
            }
        }
    }

    /// The weighted sums of four values of a row, from each on.
    #[inline(always)]
    unsafe fn along(from: *const i16, weights: [__m256i; 4]) -> __m256i {
        // SAFETY: as above.
        unsafe {
            let (a, b) = (_mm256_loadu_si256(from.cast()), _mm256_loadu_si256(from.add(1).cast()));
            let (c, d) = (_mm256_loadu_si256(from.add(2).cast()), _mm256_loadu_si256(from.add(3).cast()));
            weigh([a, b, c, d], weights)
        }
    }

    #[inline(always)]
    unsafe fn weigh([a, b, c, d]: [__m256i; 4], [p, q, r, s]: [__m256i; 4]) -> __m256i {
        // SAFETY: as above.
        unsafe {
            let outer = _mm256_add_epi16(_mm256_mulhrs_epi16(a, p), _mm256_mulhrs_epi16(d, s));
            _mm256_adds_epi16(_mm256_add_epi16(outer, _mm256_mulhrs_epi16(b, q)), _mm256_mulhrs_epi16(c, r))
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
        let (mut rows, mut out, mut plain) = (Vec::new(), vec![0; width * height + OVERHANG], vec![0; width * height]);
        shift_bicubic(picture, (4, 2), (wx, wy), (width, height), &mut rows, &mut out);
        shift(picture, (4, 2), (wx, wy), (width, height), &mut rows, &mut plain);
        assert_eq!(out[..plain.len()], plain);
        let rounded = |v: f64, w: i16| (v * f64::from(w) / 32_768.0 + 0.5).floor();
        for y in 0..height {
            for x in 0..width {
                let row = |j: usize| (0..4).map(|i| rounded(at(4 + x + i, 2 + y + j), wx[i])).sum::<f64>();
                let expected = (0..4).map(|j| rounded(row(j), wy[j])).sum::<f64>();
                assert_eq!(f64::from(out[y * width + x]), expected);
            }
        }
    }
}
