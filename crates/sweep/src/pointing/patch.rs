//! A patch of one image compared with parts of another, which is resampled to the frame of the
//! first.

use multiversion::multiversion;
use raster::{Grid, bicubic_along};

use super::moments::inverse_deviations;

/// Values that are worked on together. Rows of patches are padded to multiples of it.
const LANES: usize = 16;
/// Neighbouring places that are compared together: four vectors of eight values hide the latency of
/// an addition.
const TOGETHER: usize = 32;
/// Correlation with a part of an image that has no valid pixels or no texture.
pub(crate) const NO_PIXELS: f32 = -1.0;

/// A zero-mean, unit-norm patch of `2 · radius + 1` pixels.
pub(crate) struct Patch {
    side: usize,
    /// Values in rows of [`padded`]`(side)`; 0 behind the patch.
    values: Vec<f32>,
}

/// Returns the length of a patch's rows in memory, which is also how many columns of an image a
/// comparison reads.
pub(crate) fn padded(side: usize) -> usize {
    side.next_multiple_of(LANES)
}

impl Patch {
    /// Cuts out the patch around a pixel; `None` if it leaves the image, holds invalid pixels, or
    /// is flatter than the noise.
    pub(crate) fn around(image: &Grid<f32>, [x, y]: [f64; 2], radius: i32, noise: f32) -> Option<Self> {
        let side = 2 * radius as usize + 1;
        let mut values = vec![0.0; padded(side) * side];
        for (row, j) in values.chunks_exact_mut(padded(side)).zip(-radius..) {
            bicubic_along(image, [x - f64::from(radius), y + f64::from(j)], [1.0, 0.0], &mut row[..side]);
        }
        let own = || values.chunks_exact(padded(side)).flat_map(|row| &row[..side]);
        let n = (side * side) as f32;
        let mean = own().sum::<f32>() / n;
        let square: f32 = own().map(|v| (v - mean) * (v - mean)).sum();
        if square.is_nan() || square <= n * noise * noise {
            return None;
        }
        let scale = square.sqrt().recip();
        for row in values.chunks_exact_mut(padded(side)) {
            row[..side].iter_mut().for_each(|v| *v = (*v - mean) * scale);
        }
        Some(Self { side, values })
    }

    /// Computes the sums of products with the parts of an image that begin at `(x, y)`, `(x + 1,
    /// y)` and so on. The image must be free of NaN and have [`padded`] columns from the last
    /// one on.
    pub(crate) fn products(&self, image: &Grid<f32>, (x, y): (usize, usize), out: &mut [f32]) {
        let stride = padded(self.side);
        let (together, rest) = out.as_chunks_mut::<TOGETHER>();
        for (at, sums) in (x..).step_by(TOGETHER).zip(together.iter_mut()) {
            products_together(&self.values, stride, image, (at, y), sums);
        }
        let at = x + TOGETHER * together.len();
        for (x, sum) in (at..).zip(rest) {
            *sum = product(&self.values, stride, image, (x, y));
        }
    }

    /// Returns the zero-mean normalised cross-correlation with every part of an image;
    /// [`NO_PIXELS`] where a part holds invalid pixels or is flatter than the noise. The image
    /// must have a mean near 0. A part without [`padded`] columns from its first one counts as
    /// invalid.
    pub(crate) fn correlations(&self, mut image: Grid<f32>, noise: f32) -> Grid<f32> {
        let mut scores = inverse_deviations(&image, self.side, noise, 0.0);
        image.data_mut().iter_mut().filter(|v| v.is_nan()).for_each(|v| *v = 0.0);
        let columns = (image.width() + 1).saturating_sub(padded(self.side));
        let mut products = vec![0.0; columns.min(scores.width())];
        for y in 0..scores.height() {
            self.products(&image, (0, y), &mut products);
            let row = scores.row_mut(y);
            let (within, behind) = row.split_at_mut(products.len());
            for (score, product) in within.iter_mut().zip(&products) {
                *score = if score.is_nan() { NO_PIXELS } else { *score * product / self.side as f32 };
            }
            behind.fill(NO_PIXELS);
        }
        scores
    }
}

#[multiversion(targets("x86_64+avx2"))]
fn product(values: &[f32], stride: usize, image: &Grid<f32>, at: (usize, usize)) -> f32 {
    let mut sums = [0.0f32; LANES];
    for (own, other) in rows(values, stride, image, at) {
        for (a, b) in own.iter().zip(other) {
            (0..LANES).for_each(|i| sums[i] += a[i] * b[i]);
        }
    }
    sums.iter().sum()
}

/// Adds in the order of [`product`], so that a place has the same bits alone and beside others.
#[multiversion(targets("x86_64+avx512f+avx512dq+avx512vl", "x86_64+avx2"))]
fn products_together(
    values: &[f32],
    stride: usize,
    image: &Grid<f32>,
    (x, y): (usize, usize),
    out: &mut [f32; TOGETHER],
) {
    let width = image.width();
    let under = &image.data()[y * width + x..];
    let mut sums = [0.0f32; TOGETHER];
    for lane in 0..LANES {
        let mut sum = [0.0f32; TOGETHER];
        for (row, own) in values.chunks_exact(stride).enumerate() {
            for column in (lane..stride).step_by(LANES) {
                let other = &under[row * width + column..][..TOGETHER];
                (0..TOGETHER).for_each(|i| sum[i] += own[column] * other[i]);
            }
        }
        (0..TOGETHER).for_each(|i| sums[i] += sum[i]);
    }
    *out = sums;
}

type Lanes = [f32; LANES];

/// Iterates over the rows of a patch, each with the row of the image below it from `(x, y)` on.
#[inline(always)]
fn rows<'a>(
    values: &'a [f32],
    stride: usize,
    image: &'a Grid<f32>,
    (x, y): (usize, usize),
) -> impl Iterator<Item = (&'a [Lanes], &'a [Lanes])> {
    let under = image.data()[y * image.width() + x..].chunks(image.width());
    let whole = move |row: &'a [f32]| row[..stride].as_chunks::<LANES>().0;
    values.chunks_exact(stride).zip(under).map(move |(own, other)| (whole(own), whole(other)))
}

/// Returns the offset, in [−0.5, 0.5], of the peak of a parabola through values at −1, 0 and 1; 0
/// if there is no peak.
pub(crate) fn parabola_peak(left: f32, middle: f32, right: f32) -> f64 {
    let curvature = f64::from(left) - 2.0 * f64::from(middle) + f64::from(right);
    if curvature >= 0.0 {
        return 0.0;
    }
    (0.5 * (f64::from(left) - f64::from(right)) / curvature).clamp(-0.5, 0.5)
}

#[cfg(test)]
mod tests {
    use super::*;

    /// Compares with the definition of the correlation on an image with a void.
    #[test]
    fn the_correlation_is_that_of_the_definition() {
        let value = |x: usize, y: usize| ((x * x + 3 * y * y + x * y) as f32 * 0.37).sin() * 20.0;
        let grid =
            |f: &dyn Fn(usize, usize) -> f32| Grid::from_vec(40, 30, (0..1200).map(|i| f(i % 40, i / 40)).collect());
        let image = grid(&value).unwrap();
        let mut other = grid(&|x, y| 3.0 * value(x + 2, y + 1) + 0.5 * value(y, x)).unwrap();
        other[(33, 5)] = f32::NAN;
        let patch = Patch::around(&image, [15.0, 12.0], 7, 0.1).unwrap();
        let window = |g: &Grid<f32>, x: usize, y: usize| -> Vec<f64> {
            let v: Vec<f64> = (0..225).map(|i| f64::from(g[(x + i % 15, y + i / 15)])).collect();
            let mean = v.iter().sum::<f64>() / 225.0;
            v.iter().map(|v| v - mean).collect()
        };
        let dot = |a: &[f64], b: &[f64]| a.iter().zip(b).map(|(a, b)| a * b).sum::<f64>();
        let a = window(&image, 8, 5);
        let scores = patch.correlations(other.clone(), 0.1);
        for at in [(6, 4), (0, 0), (18, 3), (3, 14)] {
            let b = window(&other, at.0, at.1);
            let expected = dot(&a, &b) / (dot(&a, &a) * dot(&b, &b)).sqrt();
            let found = scores[at];
            assert!((f64::from(found) - expected).abs() < 1e-4, "{found} {expected} at {at:?}");
            let mut products = [0.0];
            patch.products(&other, at, &mut products);
            let product = f64::from(products[0]) / dot(&b, &b).sqrt();
            assert!(at == (18, 3) || (product - expected).abs() < 1e-4, "{product} {expected} at {at:?}");
        }
        assert_eq!(scores[(19, 0)], NO_PIXELS);
        assert!(patch.correlations(image.clone(), 0.1)[(8, 5)] > 0.9999);
        assert!(patch.correlations(image.map(|_| 0.0), 0.0).data().iter().all(|score| *score == NO_PIXELS));
        assert!(
            Patch::around(&other, [30.0, 6.0], 7, 0.1).is_none() && Patch::around(&image, [3.0, 9.0], 7, 0.1).is_none()
        );
        assert!(Patch::around(&image, [15.0, 12.0], 7, 30.0).is_none());
    }

    /// Patches of one and of two vectors of columns, at places that are worked on together and at
    /// the rest of them.
    #[test]
    fn a_place_has_the_same_bits_alone_and_beside_others() {
        let value = |k: usize| ((k * k) as f32 * 0.013).sin() * 30.0 + (k % 7) as f32;
        let image = Grid::from_vec(130, 40, (0..130 * 40).map(value).collect()).unwrap();
        for radius in [7, 12] {
            let patch = Patch::around(&image, [60.0, 20.0], radius, 0.1).unwrap();
            let mut products = vec![0.0; 2 * TOGETHER + 5];
            patch.products(&image, (3, 4), &mut products);
            for (at, product) in (3..).zip(&products) {
                let mut alone = [0.0];
                patch.products(&image, (at, 4), &mut alone);
                assert_eq!(alone[0].to_bits(), product.to_bits(), "radius {radius}, column {at}");
            }
        }
    }
}
