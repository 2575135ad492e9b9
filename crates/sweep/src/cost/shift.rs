//! A picture shifted by a sub-pixel vector: bicubic, in 16-bit integers.

#![allow(unsafe_code)]

use multiversion::multiversion;
use multiversion::target::match_target;
#[cfg(target_arch = "x86_64")]
use std::arch::x86_64::{__m256i, __m512i};

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
#[multiversion(targets("x86_64+avx512bw", "x86_64+avx2"))]
pub(crate) fn shift_bicubic(
    picture: Picture<'_>,
    at: (usize, usize),
    weights: ([i16; 4], [i16; 4]),
    (width, height): (usize, usize),
    rows: &mut Vec<i16>,
    out: &mut [i16],
) {
    match_target! {
        "x86_64+avx512bw" => registers::shift::<__m512i>(picture, at, weights, (width, height), rows, out),
        "x86_64+avx2" => registers::shift::<__m256i>(picture, at, weights, (width, height), rows, out),
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

/// For functions that are compiled for the instructions of `V`, and nowhere else.
#[cfg(target_arch = "x86_64")]
mod registers {
    use super::{OVERHANG, Picture};
    use crate::simd::wide::Wide;
    use std::arch::x86_64::__m256i;

    /// [`super::shift`] by strips as wide as a register, down the rows: what is summed along a row stays in registers until
    /// the three rows below are there.
    #[inline(always)]
    pub(super) fn shift<V: Wide>(
        picture: Picture<'_>,
        (x0, y0): (usize, usize),
        weights: ([i16; 4], [i16; 4]),
        (width, height): (usize, usize),
        _: &mut Vec<i16>,
        out: &mut [i16],
    ) {
        let stride = picture.stride;
        let from = &picture.data[y0 * stride + x0..][..(height + 2) * stride + width.next_multiple_of(OVERHANG) + 3];
        let out = &mut out[..(height - 1) * width + width.next_multiple_of(OVERHANG)];
        let columns = V::BYTES / 2;
        let rest = width % columns;
        // The last strip's overhang lies where the others write later; it is no wider than it must be.
        let last = width - rest;
        // SAFETY: no strip reaches beyond whole registers of [`OVERHANG`], for which there is room.
        unsafe {
            if rest > OVERHANG {
                strip::<V>((from, stride), weights, (out, width), last, height);
            } else if rest > 0 {
                strip::<__m256i>((from, stride), weights, (out, width), last, height);
            }
            for x in (0..last).step_by(columns).rev() {
                strip::<V>((from, stride), weights, (out, width), x, height);
            }
        }
    }

    /// The strip from the column `x` on.
    ///
    /// # Safety
    /// The slices hold the register that begins there in the last row, and `from` three values and three rows more.
    #[inline(always)]
    unsafe fn strip<V: Wide>(
        (from, stride): (&[i16], usize),
        (wx, wy): ([i16; 4], [i16; 4]),
        (out, width): (&mut [i16], usize),
        x: usize,
        height: usize,
    ) {
        let (wx, wy) = (wx.map(V::splat_word), wy.map(V::splat_word));
        // SAFETY: the caller's.
        unsafe {
            let (from, out) = (from.as_ptr().add(x), out.as_mut_ptr().add(x));
            let (mut a, mut b) = (along(from, wx), along(from.add(stride), wx));
            let mut c = along(from.add(2 * stride), wx);
            for y in 0..height {
                let d = along(from.add((y + 3) * stride), wx);
                weigh([a, b, c, d], wy).store(out.add(y * width));
                (a, b, c) = (b, c, d);
            }
        }
    }

    /// The weighted sums of four values of a row, from each on.
    #[inline(always)]
    unsafe fn along<V: Wide>(from: *const i16, weights: [V; 4]) -> V {
        // SAFETY: as above.
        unsafe { weigh([V::load(from), V::load(from.add(1)), V::load(from.add(2)), V::load(from.add(3))], weights) }
    }

    #[inline(always)]
    fn weigh<V: Wide>([a, b, c, d]: [V; 4], [p, q, r, s]: [V; 4]) -> V {
        let outer = a.times_words(p).add_words(d.times_words(s));
        outer.add_words(b.times_words(q)).add_words_cut(c.times_words(r))
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn a_shifted_picture_is_the_weighted_sum_of_sixteen_values() {
        // Strips of the longest registers with nothing left, with half a register left and less, and with more.
        [64, 71, 53, 16, 21, 5].into_iter().for_each(shifted);
    }

    fn shifted(width: usize) {
        let (stride, height) = (width as i32 + 8, 5);
        let data: Vec<i16> = (0..stride * 12 + OVERHANG as i32).map(|i| ((i * 977) % 16_001 - 8_000) as i16).collect();
        let (wx, wy) = ([-2048, 18_000, 19_000, -2184], [-1000, 30_000, 4_000, -232]);
        let at = |x: usize, y: usize| f64::from(data[y * stride as usize + x]);
        let picture = Picture { data: &data, stride: stride as usize };
        let (mut rows, mut out, mut plain) = (Vec::new(), vec![0; width * height + OVERHANG], vec![0; width * height]);
        shift_bicubic(picture, (4, 2), (wx, wy), (width, height), &mut rows, &mut out);
        shift(picture, (4, 2), (wx, wy), (width, height), &mut rows, &mut plain);
        assert_eq!(out[..plain.len()], plain);
        #[cfg(target_arch = "x86_64")]
        if std::is_x86_feature_detected!("avx2") {
            out.fill(0);
            registers::shift::<__m256i>(picture, (4, 2), (wx, wy), (width, height), &mut rows, &mut out);
            assert_eq!(out[..plain.len()], plain);
        }
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
