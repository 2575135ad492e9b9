//! An image shifted by a sub-pixel vector: bicubic interpolation in 16-bit integers.

#![allow(unsafe_code)]

use crate::simd::wide::Wide;
use crate::simd::wide_kernel::{WideKernel, run_wide};

/// An image of `stride` columns, followed by [`OVERHANG`] values.
#[derive(Clone, Copy)]
pub(crate) struct Image<'a> {
    /// Values, row after row.
    pub(crate) data: &'a [i16],
    /// Number of columns.
    pub(crate) stride: usize,
}

/// Values behind an image and behind the result that may be read and overwritten: whole registers
/// are read and written.
pub(crate) const OVERHANG: usize = 16;

/// A shift of a window of an image by one sub-pixel vector.
///
/// `out[y][x] = Σ wy[j] wx[i] image[y0 + y + j][x0 + x + i]` over `i` and `j` from 0 to 3.
/// Weights are in 2¹⁵ths, and each product is rounded.
pub(crate) struct BicubicShift<'a> {
    /// The image.
    pub(crate) image: Image<'a>,
    /// First column `x0` and row `y0` of the image that the result takes.
    pub(crate) at: (usize, usize),
    /// Weights `wx` of four columns.
    pub(crate) column_weights: [i16; 4],
    /// Weights `wy` of four rows.
    pub(crate) row_weights: [i16; 4],
    /// Columns and rows of the result.
    pub(crate) size: (usize, usize),
    /// Scratch buffer for rows that are weighted along.
    pub(crate) rows: &'a mut Vec<i16>,
    /// The result, row after row, followed by [`OVERHANG`] values.
    pub(crate) out: &'a mut [i16],
}

/// Computes a shift.
///
/// # Panics
/// Panics if the image or the result is too short.
pub(crate) fn shift_bicubic(shift: BicubicShift<'_>) {
    run_wide(shift);
}

impl WideKernel for BicubicShift<'_> {
    #[inline(always)]
    fn run<V: Wide>(self, token: V::Token) {
        registers::shift::<V>(token, self);
    }

    fn run_plain(self) {
        let Self { image, at: (x0, y0), column_weights, row_weights, size: (width, height), rows, out } = self;
        rows.resize(width * (height + 3), 0);
        for (y, row) in rows.chunks_exact_mut(width).enumerate() {
            weigh(&image.data[(y0 + y) * image.stride + x0..], 1, column_weights, row);
        }
        weigh(rows, width, row_weights, &mut out[..width * height]);
    }
}

/// Computes the weighted sums of four values, `stride` from one to the next, from each value on.
#[inline(always)]
fn weigh(from: &[i16], stride: usize, [p, q, r, s]: [i16; 4], out: &mut [i16]) {
    let product = |v: i16, w: i16| ((((i32::from(v) * i32::from(w)) >> 14) + 1) >> 1) as i16;
    let (a, b, c, d) = (from, &from[stride..], &from[2 * stride..], &from[3 * stride..]);
    for (x, out) in out.iter_mut().enumerate() {
        let outer = product(a[x], p).wrapping_add(product(d[x], s));
        *out = outer.wrapping_add(product(b[x], q)).saturating_add(product(c[x], r));
    }
}

/// The kernel with registers.
#[cfg_attr(not(target_arch = "x86_64"), allow(dead_code, reason = "there are no registers"))]
mod registers {
    use super::{BicubicShift, OVERHANG};
    use crate::simd::wide::Wide;

    /// Shifts by strips as wide as a register, down the rows. Three rows that are weighted along
    /// stay in registers until the fourth one is there.
    ///
    /// The strips go from right to left: the last one overhangs into the next row, where the others
    /// write later. It is a short register if that holds the columns left over, so that it never
    /// writes more than [`OVERHANG`] values beyond the result.
    #[inline(always)]
    pub(super) fn shift<V: Wide>(token: V::Token, job: BicubicShift<'_>) {
        let BicubicShift { image, at: (x0, y0), column_weights, row_weights, size: (width, height), out, .. } = job;
        let stride = image.stride;
        let from = &image.data[y0 * stride + x0..][..(height + 2) * stride + width.next_multiple_of(OVERHANG) + 3];
        let out = &mut out[..(height - 1) * width + width.next_multiple_of(OVERHANG)];
        let mut strips = Strips { from, stride, column_weights, row_weights, out, width, height };
        let columns = V::BYTES / 2;
        let rest = width % columns;
        let last = width - rest;
        // SAFETY: every strip begins at a multiple of its register's length, or of a longer one's,
        // and holds a column of the result. In the last row it therefore ends before
        // `width.next_multiple_of(OVERHANG)`: a long register is taken only for more than
        // `OVERHANG` columns, which round up to its length, and a short one has `OVERHANG` words.
        unsafe {
            if rest > OVERHANG {
                strips.write::<V>(token, last);
            } else if rest > 0 {
                strips.write::<V::Short>(V::short_token(token), last);
            }
            for x in (0..last).step_by(columns).rev() {
                strips.write::<V>(token, x);
            }
        }
    }

    /// Input and output of all strips.
    struct Strips<'a> {
        from: &'a [i16],
        stride: usize,
        column_weights: [i16; 4],
        row_weights: [i16; 4],
        out: &'a mut [i16],
        width: usize,
        height: usize,
    }

    impl Strips<'_> {
        /// Writes the strip from column `x` on.
        ///
        /// # Safety
        /// `out` holds the register at column `x` of its last row. `from` holds it too, three rows
        /// farther down and with three values more.
        #[inline(always)]
        unsafe fn write<V: Wide>(&mut self, token: V::Token, x: usize) {
            let (column_weights, row_weights) = (splat(token, self.column_weights), splat(token, self.row_weights));
            // SAFETY: the caller vouches for the registers of the last row, and those of the other
            // rows lie before them.
            unsafe {
                let (from, out) = (self.from.as_ptr().add(x), self.out.as_mut_ptr().add(x));
                let (stride, width) = (self.stride, self.width);
                let mut a: V = along(token, from, column_weights);
                let mut b: V = along(token, from.add(stride), column_weights);
                let mut c: V = along(token, from.add(2 * stride), column_weights);
                for y in 0..self.height {
                    let d = along(token, from.add((y + 3) * stride), column_weights);
                    weigh([a, b, c, d], row_weights).store(out.add(y * width));
                    (a, b, c) = (b, c, d);
                }
            }
        }
    }

    /// Computes the weighted sums of four values of a row, from each value on.
    ///
    /// # Safety
    /// A register and three values more can be read from `from` on.
    #[inline(always)]
    unsafe fn along<V: Wide>(token: V::Token, from: *const i16, weights: [V; 4]) -> V {
        // SAFETY: the farthest register begins three values behind `from`.
        unsafe {
            let (a, b) = (V::load(token, from), V::load(token, from.add(1)));
            let (c, d) = (V::load(token, from.add(2)), V::load(token, from.add(3)));
            weigh([a, b, c, d], weights)
        }
    }

    #[inline(always)]
    fn splat<V: Wide>(token: V::Token, [p, q, r, s]: [i16; 4]) -> [V; 4] {
        [V::splat_word(token, p), V::splat_word(token, q), V::splat_word(token, r), V::splat_word(token, s)]
    }

    #[inline(always)]
    fn weigh<V: Wide>([a, b, c, d]: [V; 4], [p, q, r, s]: [V; 4]) -> V {
        let outer = a.multiply_words(p).wrapping_add_words(d.multiply_words(s));
        outer.wrapping_add_words(b.multiply_words(q)).saturating_add_words(c.multiply_words(r))
    }
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::simd::wide_kernel::run_with_avx2;

    #[test]
    fn a_shifted_image_is_the_weighted_sum_of_sixteen_values() {
        // Whole registers of the longest kind, then half a register left over, less, and more.
        [64, 71, 53, 16, 21, 5].into_iter().for_each(shifted);
    }

    fn shifted(width: usize) {
        let (stride, height) = (width as i32 + 8, 5);
        let data: Vec<i16> = (0..stride * 12 + OVERHANG as i32).map(|i| ((i * 977) % 16_001 - 8_000) as i16).collect();
        let (wx, wy) = ([-2048, 18_000, 19_000, -2184], [-1000, 30_000, 4_000, -232]);
        let at = |x: usize, y: usize| f64::from(data[y * stride as usize + x]);
        let image = Image { data: &data, stride: stride as usize };
        let (mut rows, mut out, mut plain) = (Vec::new(), vec![0; width * height + OVERHANG], vec![0; width * height]);
        fn job<'a>(
            image: Image<'a>,
            weights: ([i16; 4], [i16; 4]),
            size: (usize, usize),
            rows: &'a mut Vec<i16>,
            out: &'a mut [i16],
        ) -> BicubicShift<'a> {
            let (column_weights, row_weights) = weights;
            BicubicShift { image, at: (4, 2), column_weights, row_weights, size, rows, out }
        }
        shift_bicubic(job(image, (wx, wy), (width, height), &mut rows, &mut out));
        job(image, (wx, wy), (width, height), &mut rows, &mut plain).run_plain();
        assert_eq!(out[..plain.len()], plain);
        out.fill(0);
        if run_with_avx2(job(image, (wx, wy), (width, height), &mut rows, &mut out)) {
            assert_eq!(out[..plain.len()], plain);
        }
        let rounded = |v: f64, w: i16| (v * f64::from(w) / 32_768.0 + 0.5).floor();
        for y in 0..height {
            for x in 0..width {
                let row = |j: usize| (0..4).map(|i| rounded(at(4 + x + i, 2 + y + j), wx[i])).sum::<f64>();
                let expected = (0..4).map(|j| rounded(row(j), wy[j])).sum::<f64>();
                assert_eq!(f64::from(plain[y * width + x]), expected);
            }
        }
    }
}
