//! Structural similarity (Wang et al., "Image Quality Assessment: From Error Visibility to
//! Structural Similarity", 2004) of a channel, and its gradient.
//!
//! As in 3DGS and 2DGS: Gaussian windows of 11 pixels with σ = 1.5 px, zeros beyond the border, the
//! constants 0.01² and 0.03². With the windowed moments m₁ = G·x, m₂ = G·x², m₁₂ = G·xy and the
//! similarity S, the gradient by x is G·∂S/∂m₁ + 2x G·∂S/∂m₂ + y G·∂S/∂m₁₂.

use rayon::prelude::*;

use crate::simd::{InstructionSet, Kernel, Registers, dispatch};

/// Pixels of a window on each side of its middle.
const RADIUS: usize = 5;
/// Lines or columns of a window.
const WINDOW: usize = 2 * RADIUS + 1;
/// Standard deviation of a window, pixels.
const SIGMA_PX: f64 = 1.5;
/// Keep the division from 0, for colours from 0 to 1.
const C1: f32 = 1e-4;
const C2: f32 = 9e-4;
/// Moments of a row: of x, y, x², y², x y.
const MOMENTS: usize = 5;
/// Derivatives of a row: by m₁, m₂ and m₁₂.
const SLOPES: usize = 3;

/// Computes similarities. Keeps its memory from one image to the next.
#[derive(Debug, Clone, Default)]
pub(crate) struct Similarity {
    /// Moments blurred along rows; row by row, each with its moments one after another.
    moments: Vec<f32>,
    /// Derivatives blurred along rows, likewise.
    slopes: Vec<f32>,
}

/// A channel of two images; both are 0 where pixels do not count.
pub(crate) struct Channel<'a> {
    /// Columns and rows.
    pub(crate) size: [usize; 2],
    pub(crate) shown: &'a [f32],
    pub(crate) truth: &'a [f32],
    pub(crate) counts: &'a [bool],
}

impl Similarity {
    /// Returns the sum of the similarities of the pixels that count, and adds `factor` times its
    /// gradient by what is shown to `out`.
    pub(crate) fn add_gradient(&mut self, channel: &Channel<'_>, factor: f32, out: &mut [f32]) -> f64 {
        let [width, height] = channel.size;
        if width == 0 || height == 0 {
            return 0.0;
        }
        let window = window();
        self.moments.resize(MOMENTS * width * height, 0.0);
        self.slopes.resize(SLOPES * width * height, 0.0);
        let padded = || vec![0.0f32; width + 2 * RADIUS];
        let zeros = vec![0.0f32; width];
        self.moments.par_chunks_mut(MOMENTS * width).enumerate().for_each_init(padded, |padded, (row, out)| {
            dispatch(Registers::Longest, MomentsOfRow { channel, row, window: &window, padded, out });
        });
        let moments = &self.moments;
        let scratch = || (padded(), vec![0.0f32; (MOMENTS + SLOPES) * width]);
        let rows = self.slopes.par_chunks_mut(SLOPES * width).enumerate();
        let sums = rows.map_init(scratch, |(padded, local), (row, out)| {
            let moments = Lines { values: moments, planes: MOMENTS, width, zeros: &zeros };
            dispatch(Registers::Longest, SlopesOfRow { channel, row, window: &window, moments, padded, local, out })
        });
        // Rows are added in their order, whichever thread made them.
        let sums: Vec<f64> = sums.collect();
        let slopes = &self.slopes;
        let local = || vec![0.0f32; SLOPES * width];
        out.par_chunks_mut(width).enumerate().for_each_init(local, |local, (row, out)| {
            let slopes = Lines { values: slopes, planes: SLOPES, width, zeros: &zeros };
            dispatch(Registers::Longest, GradientOfRow { channel, row, window: &window, slopes, factor, local, out });
        });
        sums.iter().sum()
    }
}

/// Returns the weights of a window from its middle outwards.
fn window() -> [f32; RADIUS + 1] {
    let weight = |d: usize| (-0.5 * (d as f64 / SIGMA_PX).powi(2)).exp();
    let sum = weight(0) + 2.0 * (1..=RADIUS).map(weight).sum::<f64>();
    std::array::from_fn(|d| (weight(d) / sum) as f32)
}

/// Rows with several planes each.
struct Lines<'a> {
    values: &'a [f32],
    planes: usize,
    width: usize,
    zeros: &'a [f32],
}

impl Lines<'_> {
    /// Returns the lines of a plane around a row; zeros beyond the image.
    fn around(&self, row: usize, plane: usize) -> [&[f32]; WINDOW] {
        std::array::from_fn(|k| {
            let line = (row + k).wrapping_sub(RADIUS).wrapping_mul(self.planes).wrapping_add(plane);
            let start = line.wrapping_mul(self.width);
            let end = start.wrapping_add(self.width);
            if row + k < RADIUS { self.zeros } else { self.values.get(start..end).unwrap_or(self.zeros) }
        })
    }
}

/// Writes the weighted sum of eleven lines.
#[inline(always)]
fn weigh(lines: [&[f32]; WINDOW], window: &[f32; RADIUS + 1], out: &mut [f32]) {
    for (out, middle) in out.iter_mut().zip(lines[RADIUS]) {
        *out = window[0] * middle;
    }
    for k in 1..=RADIUS {
        for ((out, before), behind) in out.iter_mut().zip(lines[RADIUS - k]).zip(lines[RADIUS + k]) {
            *out += window[k] * (before + behind);
        }
    }
}

/// Writes the weighted sums along a row, which has zeros on both sides.
#[inline(always)]
fn weigh_along(padded: &[f32], window: &[f32; RADIUS + 1], out: &mut [f32]) {
    let width = out.len();
    weigh(std::array::from_fn(|k| &padded[k..k + width]), window, out);
}

/// Blurs the moments of a row along it.
struct MomentsOfRow<'a> {
    channel: &'a Channel<'a>,
    row: usize,
    window: &'a [f32; RADIUS + 1],
    padded: &'a mut [f32],
    out: &'a mut [f32],
}

impl Kernel for MomentsOfRow<'_> {
    type Output = ();

    #[inline(always)]
    fn run<I: InstructionSet>(self, _: I) {
        let Self { channel, row, window, padded, out } = self;
        let width = channel.size[0];
        let (shown, truth) = (&channel.shown[row * width..][..width], &channel.truth[row * width..][..width]);
        for (plane, out) in out.chunks_exact_mut(width).enumerate() {
            let (a, b) = match plane {
                0 => (shown, None),
                1 => (truth, None),
                2 => (shown, Some(shown)),
                3 => (truth, Some(truth)),
                _ => (shown, Some(truth)),
            };
            let middle = &mut padded[RADIUS..RADIUS + width];
            match b {
                Some(b) => middle.iter_mut().zip(a).zip(b).for_each(|((to, a), b)| *to = a * b),
                None => middle.copy_from_slice(a),
            }
            weigh_along(padded, window, out);
        }
    }
}

/// Computes the similarities of a row, and the derivatives by the moments, blurred along the row.
struct SlopesOfRow<'a> {
    channel: &'a Channel<'a>,
    row: usize,
    window: &'a [f32; RADIUS + 1],
    moments: Lines<'a>,
    padded: &'a mut [f32],
    local: &'a mut [f32],
    out: &'a mut [f32],
}

impl Kernel for SlopesOfRow<'_> {
    /// The sum of the similarities.
    type Output = f64;

    #[inline(always)]
    fn run<I: InstructionSet>(self, _: I) -> f64 {
        let Self { channel, row, window, moments, padded, local, out } = self;
        let width = channel.size[0];
        let (blurred, slopes) = local.split_at_mut(MOMENTS * width);
        for (plane, blurred) in blurred.chunks_exact_mut(width).enumerate() {
            weigh(moments.around(row, plane), window, blurred);
        }
        let counts = &channel.counts[row * width..][..width];
        let (by_first, rest) = slopes.split_at_mut(width);
        let (by_second, by_mixed) = rest.split_at_mut(width);
        let mut sum = 0.0f64;
        for i in 0..width {
            let [x, y, xx, yy, xy] = [0, 1, 2, 3, 4].map(|plane| blurred[plane * width + i]);
            let (a1, a2) = (2.0 * x * y + C1, 2.0 * (xy - x * y) + C2);
            let (b1, b2) = (x * x + y * y + C1, (xx - x * x) + (yy - y * y) + C2);
            let shared = 1.0 / (b1 * b2);
            let similarity = a1 * a2 * shared;
            let (mixed, second) = (2.0 * a1 * shared, -similarity / b2);
            let first = 2.0 * y * a2 * shared - 2.0 * x * similarity / b1 - y * mixed - 2.0 * x * second;
            let counted = if counts[i] { 1.0 } else { 0.0 };
            sum += f64::from(counted * similarity);
            by_first[i] = counted * first;
            by_second[i] = counted * second;
            by_mixed[i] = counted * mixed;
        }
        for (slope, out) in slopes.chunks_exact(width).zip(out.chunks_exact_mut(width)) {
            padded[RADIUS..RADIUS + width].copy_from_slice(slope);
            weigh_along(padded, window, out);
        }
        sum
    }
}

/// Adds the gradient of a row.
struct GradientOfRow<'a> {
    channel: &'a Channel<'a>,
    row: usize,
    window: &'a [f32; RADIUS + 1],
    slopes: Lines<'a>,
    factor: f32,
    local: &'a mut [f32],
    out: &'a mut [f32],
}

impl Kernel for GradientOfRow<'_> {
    type Output = ();

    #[inline(always)]
    fn run<I: InstructionSet>(self, _: I) {
        let Self { channel, row, window, slopes, factor, local, out } = self;
        let width = channel.size[0];
        for (plane, local) in local.chunks_exact_mut(width).enumerate() {
            weigh(slopes.around(row, plane), window, local);
        }
        let at = row * width;
        for (i, out) in out.iter_mut().enumerate() {
            let [first, second, mixed] = [0, 1, 2].map(|plane| local[plane * width + i]);
            let slope = first + 2.0 * channel.shown[at + i] * second + channel.truth[at + i] * mixed;
            *out += if channel.counts[at + i] { factor * slope } else { 0.0 };
        }
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    const SIZE: [usize; 2] = [13, 9];

    fn plane(seed: usize) -> Vec<f32> {
        (0..SIZE[0] * SIZE[1]).map(|i| ((seed * 37 + i * 7919 + 31) % 1009) as f32 / 1009.0).collect()
    }

    /// The sum of the similarities by the definition, in f64.
    fn slow(shown: &[f32], truth: &[f32], counts: &[bool]) -> f64 {
        let [width, height] = SIZE.map(|s| s as i64);
        let weight = |d: i64| (-0.5 * (d as f64 / SIGMA_PX).powi(2)).exp();
        let norm: f64 = (-5..=5).map(weight).sum();
        let mut sum = 0.0;
        for pixel in (0..shown.len()).filter(|&p| counts[p]) {
            let (column, row) = (pixel as i64 % width, pixel as i64 / width);
            let mut m = [0.0; 5];
            for (dy, dx) in (-5..=5).flat_map(|dy| (-5..=5).map(move |dx| (dy, dx))) {
                let (c, r) = (column + dx, row + dy);
                if (0..width).contains(&c) && (0..height).contains(&r) {
                    let at = (r * width + c) as usize;
                    let (x, y) = (f64::from(shown[at]), f64::from(truth[at]));
                    let w = weight(dx) * weight(dy) / (norm * norm);
                    m.iter_mut().zip([x, y, x * x, y * y, x * y]).for_each(|(m, v)| *m += w * v);
                }
            }
            let [x, y, xx, yy, xy] = m;
            let (c1, c2) = (1e-4, 9e-4);
            sum += (2.0 * x * y + c1) * (2.0 * (xy - x * y) + c2)
                / ((x * x + y * y + c1) * (xx - x * x + yy - y * y + c2));
        }
        sum
    }

    #[test]
    fn similarities_and_their_gradient_are_those_of_the_definition() {
        let counts: Vec<bool> = (0..SIZE[0] * SIZE[1]).map(|i| i % 7 > 0).collect();
        let masked =
            |seed| plane(seed).iter().zip(&counts).map(|(v, c)| if *c { *v } else { 0.0 }).collect::<Vec<f32>>();
        let (shown, truth) = (masked(1), masked(2));
        let mut found = vec![0.0; shown.len()];
        let channel = Channel { size: SIZE, shown: &shown, truth: &truth, counts: &counts };
        let sum = Similarity::default().add_gradient(&channel, 1.0, &mut found);
        assert!((sum - slow(&shown, &truth, &counts)).abs() < 1e-3, "{sum}");
        for pixel in 0..shown.len() {
            let moved = |by: f32| {
                let mut shown = shown.clone();
                shown[pixel] += by;
                slow(&shown, &truth, &counts)
            };
            let slope = if counts[pixel] { (moved(1e-3) - moved(-1e-3)) / 2e-3 } else { 0.0 };
            let error = (slope - f64::from(found[pixel])).abs();
            assert!(error < 2e-3 * slope.abs().max(1.0), "{pixel}: {} is not {slope}", found[pixel]);
        }
        let same = Channel { size: SIZE, shown: &truth, truth: &truth, counts: &counts };
        let all = counts.iter().filter(|c| **c).count() as f64;
        assert!((Similarity::default().add_gradient(&same, 0.0, &mut found) - all).abs() < 1e-3);
    }
}
