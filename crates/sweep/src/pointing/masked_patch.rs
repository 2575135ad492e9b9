//! A patch with hidden pixels compared with parts of an image that has hidden pixels, too.
//!
//! The zero-mean normalised cross-correlation of the pixels that both show (Padfield 2012): with
//! the masks m and M, sums over m·M of both values, of their squares and of their product.

use multiversion::multiversion;
use raster::{Grid, bicubic_along};

use super::patch::{NO_PIXELS, padded};

/// Values that are worked on together; rows of patches are padded to multiples of it.
const LANES: usize = 16;
/// Pixels that are enough to compare, of a patch of 15 × 15: as few as a chip may have.
const ENOUGH: usize = 225;
/// Least share of clear pixels. With fewer, most of what a larger patch compares lies around the
/// hole.
const CLEAR_MIN: f64 = 0.5;
/// Greatest distance of the middle of the clear pixels from the point, radii. The place of a point
/// beside all pixels that were compared is extrapolated.
const ASIDE_MAX: f64 = 0.5;
/// Deviation that is texture, as a share of the mean: beyond the rounding of f32.
const TEXTURE: f32 = 1e-5;

/// Values of the pixels around a point, without their mean, and 0 where they are hidden.
pub(super) struct MaskedPatch {
    side: usize,
    values: Vec<f32>,
    squares: Vec<f32>,
    mask: Vec<f32>,
    clear: usize,
}

/// Returns how many of a patch's clear pixels the image must show, too: half of them, and of a
/// large patch no more than are enough.
pub(super) fn needed(clear: usize) -> usize {
    ENOUGH.min(clear / 2)
}

/// Returns the greatest half width, from `radii`, of a patch around a point that shows enough:
/// half of its pixels, and as many as the least patch has; `None` where none does.
pub(super) fn clear_radius(image: &Grid<f32>, point: [f64; 2], radii: [usize; 2]) -> Option<usize> {
    let [least, greatest] = radii;
    let far = greatest as i32;
    let window = sampled(image, point, far);
    // Clear pixels by the least patch that holds them, and the sum of their places.
    let mut rings = vec![(0usize, [0i64; 2]); greatest + 1];
    for (k, _) in window.iter().enumerate().filter(|(_, value)| value.is_finite()) {
        let side = 2 * greatest + 1;
        let at = [k % side, k / side].map(|v| v as i32 - far);
        let ring = &mut rings[at[0].abs().max(at[1].abs()) as usize];
        ring.0 += 1;
        (0..2).for_each(|axis| ring.1[axis] += i64::from(at[axis]));
    }
    let needed = (2 * least + 1) * (2 * least + 1);
    let (mut clear, mut sum, mut best) = (0, [0i64; 2], None);
    for (radius, ring) in rings.iter().enumerate() {
        clear += ring.0;
        (0..2).for_each(|axis| sum[axis] += ring.1[axis]);
        let side = (2 * radius + 1) as f64;
        let aside = sum.map(|v| v as f64 / clear as f64);
        let is_around = aside[0].hypot(aside[1]) <= ASIDE_MAX * radius as f64;
        if radius >= least && clear >= needed && clear as f64 >= CLEAR_MIN * side * side && is_around {
            best = Some(radius);
        }
    }
    best
}

/// Returns the values up to `radius` pixels around a point, row by row.
fn sampled(image: &Grid<f32>, [x, y]: [f64; 2], radius: i32) -> Vec<f32> {
    let side = 2 * radius as usize + 1;
    let mut values = vec![f32::NAN; side * side];
    for (row, j) in values.chunks_exact_mut(side).zip(-radius..) {
        bicubic_along(image, [x - f64::from(radius), y + f64::from(j)], [1.0, 0.0], row);
    }
    values
}

impl MaskedPatch {
    /// Cuts out the patch around a point; `None` where it has no texture.
    pub(super) fn around(image: &Grid<f32>, point: [f64; 2], radius: i32) -> Option<Self> {
        let side = 2 * radius as usize + 1;
        let all = sampled(image, point, radius);
        let clear = all.iter().filter(|value| value.is_finite()).count();
        let known = || all.iter().filter(|value| value.is_finite());
        let mean = known().sum::<f32>() / clear as f32;
        let variance = known().map(|v| (v - mean) * (v - mean)).sum::<f32>() / clear as f32;
        if clear == 0 || variance.sqrt() <= TEXTURE * mean.abs() {
            return None;
        }
        let stride = padded(side);
        let mut values = vec![0.0; stride * side];
        let mut mask = values.clone();
        for (row, own) in all.chunks_exact(side).enumerate() {
            for (column, value) in own.iter().enumerate().filter(|(_, value)| value.is_finite()) {
                (values[row * stride + column], mask[row * stride + column]) = (value - mean, 1.0);
            }
        }
        let squares = values.iter().map(|v| v * v).collect();
        Some(Self { side, values, squares, mask, clear })
    }

    /// Returns whether no pixel is hidden.
    pub(super) fn is_whole(&self) -> bool {
        self.clear == self.side * self.side
    }

    /// Returns the correlation with every part of an image whose mean is near 0; [`NO_PIXELS`]
    /// where both show too little together, or one has no texture there. A part without [`padded`]
    /// columns from its first one counts as hidden.
    pub(super) fn correlations(&self, image: &Grid<f32>) -> Grid<f32> {
        let mask = image.map(|v| if v.is_finite() { 1.0 } else { 0.0 });
        let values = image.map(|v| if v.is_finite() { *v } else { 0.0 });
        let squares = values.map(|v| v * v);
        let (columns, rows) = ((image.width() + 1).saturating_sub(padded(self.side)), image.height() + 1);
        let mut scores = Grid::filled(columns, rows.saturating_sub(self.side), NO_PIXELS);
        let own = [&self.values[..], &self.squares, &self.mask];
        let other = [values.data(), squares.data(), mask.data()];
        let needed = needed(self.clear).max(1) as f32;
        for y in 0..scores.height() {
            for (x, score) in scores.row_mut(y).iter_mut().enumerate() {
                let [n, f, ff, g, gg, fg] = sums(own, padded(self.side), other, image.width(), (x, y));
                let (vf, vg) = (ff - f * f / n, gg - g * g / n);
                if n >= needed && vf > TEXTURE * ff && vg > TEXTURE * gg {
                    *score = (fg - f * g / n) / (vf * vg).sqrt();
                }
            }
        }
        scores
    }
}

/// Returns the number of pixels that both show, the sums of the image's values and squares and of
/// the patch's over them, and the sum of products.
#[multiversion(targets("x86_64+avx2"))]
fn sums(own: [&[f32]; 3], stride: usize, other: [&[f32]; 3], width: usize, (x, y): (usize, usize)) -> [f32; 6] {
    let mut out = [[0.0f32; LANES]; 6];
    for row in 0..own[0].len() / stride {
        let (at, from) = (row * stride, (y + row) * width + x);
        let (g, gg, m) = (lanes(own[0], at, stride), lanes(own[1], at, stride), lanes(own[2], at, stride));
        let (f, ff, shown) =
            (lanes(other[0], from, stride), lanes(other[1], from, stride), lanes(other[2], from, stride));
        for (((g, gg), m), ((f, ff), shown)) in g.iter().zip(gg).zip(m).zip(f.iter().zip(ff).zip(shown)) {
            for i in 0..LANES {
                out[0][i] += m[i] * shown[i];
                out[1][i] += m[i] * f[i];
                out[2][i] += m[i] * ff[i];
                out[3][i] += g[i] * shown[i];
                out[4][i] += gg[i] * shown[i];
                out[5][i] += g[i] * f[i];
            }
        }
    }
    let mut total = [0.0; 6];
    for (total, lanes) in total.iter_mut().zip(&out) {
        for value in lanes {
            *total += value;
        }
    }
    total
}

/// Returns the values of a row from a place on.
#[inline(always)]
fn lanes(values: &[f32], from: usize, count: usize) -> &[[f32; LANES]] {
    values[from..from + count].as_chunks::<LANES>().0
}

#[cfg(test)]
mod tests {
    use super::*;

    fn value(x: usize, y: usize) -> f32 {
        ((x * x + 3 * y * y + x * y) as f32 * 0.37).sin() * 20.0
    }

    fn grid(hidden: impl Fn(usize, usize) -> bool, shift: usize) -> Grid<f32> {
        let one = |i: usize| if hidden(i % 64, i / 64) { f32::NAN } else { value(i % 64 + shift, i / 64) };
        Grid::from_vec(64, 40, (0..64 * 40).map(one).collect()).unwrap()
    }

    #[test]
    fn the_correlation_is_that_of_the_pixels_that_both_show() {
        let image = grid(|x, y| x % 7 == 3 && y > 12, 0);
        let other = grid(|x, y| (x + y) % 5 == 0, 2);
        let patch = MaskedPatch::around(&image, [20.0, 18.0], 7).unwrap();
        assert!(!patch.is_whole());
        let scores = patch.correlations(&other);
        for at in [(0, 0), (11, 11), (30, 4), (25, 20)] {
            let pairs: Vec<(f64, f64)> = (0..225)
                .map(|i| (i % 15, i / 15))
                .map(|(i, j)| (f64::from(image[(13 + i, 11 + j)]), f64::from(other[(at.0 + i, at.1 + j)])))
                .filter(|(a, b)| (a + b).is_finite())
                .collect();
            let n = pairs.len() as f64;
            let (a, b) = pairs.iter().fold((0.0, 0.0), |sum, pair| (sum.0 + pair.0 / n, sum.1 + pair.1 / n));
            let dot = |f: &dyn Fn(f64, f64) -> f64| pairs.iter().map(|(x, y)| f(x - a, y - b)).sum::<f64>();
            let expected = dot(&|x, y| x * y) / (dot(&|x, _| x * x) * dot(&|_, y| y * y)).sqrt();
            assert!((f64::from(scores[at]) - expected).abs() < 1e-4, "{} {expected} at {at:?}", scores[at]);
        }
        assert!(scores[(11, 11)] > 0.9999, "the same pixels, two columns on");
    }

    #[test]
    fn a_patch_shrinks_to_what_is_clear() {
        let radii = [7, 24];
        let big = |hidden: &dyn Fn(i32, i32) -> bool| {
            let one = |i: usize| {
                let (x, y) = ((i % 61) as i32 - 30, (i / 61) as i32 - 30);
                if hidden(x, y) { f32::NAN } else { value(i % 61, i / 61) }
            };
            let image = Grid::from_vec(61, 61, (0..61 * 61).map(one).collect()).unwrap();
            clear_radius(&image, [30.0, 30.0], radii)
        };
        assert_eq!(big(&|_, _| false), Some(24));
        let shrunk = big(&|x, y| x.abs().max(y.abs()) > 10).unwrap();
        assert!((10..=15).contains(&shrunk), "{shrunk}");
        assert_eq!(big(&|x, y| x.abs().max(y.abs()) > 6), None, "less than the least chip is clear");
        assert_eq!(big(&|x, _| x < 12), None, "all that is clear lies aside");
        let flat = Grid::filled(61, 61, 3.0);
        assert!(MaskedPatch::around(&flat, [30.0, 30.0], 10).is_none());
    }
}
