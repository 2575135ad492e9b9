//! The inner loops: plain arithmetic on rows, compiled for several instruction sets and chosen at run time.
//!
//! NaN marks invalid pixels and spreads to every patch that touches one.

use multiversion::multiversion;

/// A picture of `width` columns per row, read from an offset on.
#[derive(Clone, Copy)]
pub(crate) struct Picture<'a> {
    pub(crate) data: &'a [f32],
    pub(crate) stride: usize,
}

/// `out[y][x] = Σ wy[j] wx[i] picture[y0 + y + j][x0 + x + i]`: a whole tile shifted by one sub-pixel vector.
#[multiversion(targets("x86_64+avx2+fma"))]
pub(crate) fn shift_bicubic(
    picture: Picture<'_>,
    (x0, y0): (usize, usize),
    (wx, wy): ([f32; 4], [f32; 4]),
    (width, height): (usize, usize),
    rows: &mut [f32],
    out: &mut [f32],
) {
    for y in 0..height + 3 {
        let from = (y0 + y) * picture.stride + x0;
        let s = &picture.data[from..from + width + 3];
        let to = &mut rows[y * width..(y + 1) * width];
        let (a, b, c, d) = (&s[..width], &s[1..width + 1], &s[2..width + 2], &s[3..width + 3]);
        for x in 0..width {
            to[x] = wx[0] * a[x] + wx[1] * b[x] + wx[2] * c[x] + wx[3] * d[x];
        }
    }
    for y in 0..height {
        let row = |j: usize| &rows[(y + j) * width..(y + j + 1) * width];
        let (a, b, c, d) = (row(0), row(1), row(2), row(3));
        let to = &mut out[y * width..(y + 1) * width];
        for x in 0..width {
            to[x] = wy[0] * a[x] + wy[1] * b[x] + wy[2] * c[x] + wy[3] * d[x];
        }
    }
}

/// Sums over windows of `side` columns: `out[x] = Σ_{i < side} v[x + i]`.
#[inline(always)]
fn slide(v: &[f32], side: usize, out: &mut [f32]) {
    let n = out.len();
    out.copy_from_slice(&v[..n]);
    for i in 1..side {
        let s = &v[i..i + n];
        for x in 0..n {
            out[x] += s[x];
        }
    }
}

/// Mean and `1 / sqrt(variance + floor)` of every `side × side` patch of a padded tile of `width` columns.
#[multiversion(targets("x86_64+avx2+fma"))]
pub(crate) fn patch_moments(
    tile: &[f32],
    width: usize,
    side: usize,
    floor: f32,
    line: &mut [f32],
    mean: &mut [f32],
    inverse_deviation: &mut [f32],
) {
    let core = width + 1 - side;
    let rows = mean.len() / core;
    let inv_n = 1.0 / (side * side) as f32;
    let (sum, square) = line[..2 * width].split_at_mut(width);
    for y in 0..rows {
        let first = &tile[y * width..(y + 1) * width];
        for x in 0..width {
            sum[x] = first[x];
            square[x] = first[x] * first[x];
        }
        for j in 1..side {
            let r = &tile[(y + j) * width..(y + j + 1) * width];
            for x in 0..width {
                sum[x] += r[x];
                square[x] += r[x] * r[x];
            }
        }
        let m = &mut mean[y * core..(y + 1) * core];
        let s = &mut inverse_deviation[y * core..(y + 1) * core];
        slide(sum, side, m);
        slide(square, side, s);
        for x in 0..core {
            m[x] *= inv_n;
            let variance = (s[x] * inv_n - m[x] * m[x]).max(0.0) + floor;
            // `max` drops a NaN; adding 0 · mean brings it back.
            s[x] = 1.0 / variance.sqrt() + 0.0 * m[x];
        }
    }
}

/// One side of a correlation: a padded tile and the moments of its patches.
#[derive(Clone, Copy)]
pub(crate) struct Side<'a> {
    pub(crate) tile: &'a [f32],
    pub(crate) mean: &'a [f32],
    pub(crate) inverse_deviation: &'a [f32],
}

/// `out = min(max(1 − ρ, 0), 1)` for every patch of two tiles; 1 where a patch is invalid.
#[multiversion(targets("x86_64+avx2+fma"))]
pub(crate) fn correlation_cost(a: Side<'_>, b: Side<'_>, width: usize, side: usize, line: &mut [f32], out: &mut [f32]) {
    let core = width + 1 - side;
    let rows = out.len() / core;
    let inv_n = 1.0 / (side * side) as f32;
    let product = &mut line[..width];
    for y in 0..rows {
        let (p, q) = (&a.tile[y * width..(y + 1) * width], &b.tile[y * width..(y + 1) * width]);
        for x in 0..width {
            product[x] = p[x] * q[x];
        }
        for j in 1..side {
            let at = (y + j) * width;
            let (p, q) = (&a.tile[at..at + width], &b.tile[at..at + width]);
            for x in 0..width {
                product[x] += p[x] * q[x];
            }
        }
        let at = y * core;
        let o = &mut out[at..at + core];
        slide(product, side, o);
        let (ma, mb) = (&a.mean[at..at + core], &b.mean[at..at + core]);
        let (sa, sb) = (&a.inverse_deviation[at..at + core], &b.inverse_deviation[at..at + core]);
        for x in 0..core {
            let rho = (o[x] * inv_n - ma[x] * mb[x]) * sa[x] * sb[x];
            let cost = 1.0 - rho;
            // A NaN compares false and becomes 1.
            o[x] = if cost < 1.0 { cost.max(0.0) } else { 1.0 };
        }
    }
}

/// Keeps the smaller of two rows in `a` and the larger in `b`.
#[multiversion(targets("x86_64+avx2+fma"))]
pub(crate) fn sort_pair(a: &mut [f32], b: &mut [f32]) {
    for (p, q) in a.iter_mut().zip(b) {
        let (lo, hi) = (p.min(*q), p.max(*q));
        *p = lo;
        *q = hi;
    }
}

/// `out += v`.
#[multiversion(targets("x86_64+avx2+fma"))]
pub(crate) fn add(out: &mut [f32], v: &[f32]) {
    for (o, x) in out.iter_mut().zip(v) {
        *o += x;
    }
}

/// `out = round(v · scale)` as an integer cost.
#[multiversion(targets("x86_64+avx2+fma"))]
pub(crate) fn quantise(v: &[f32], scale: f32, out: &mut [u8]) {
    // Adding 2²³ leaves the rounded integer in the lowest bits of the sum, which vectorises; a cast does not.
    const TWO_23: f32 = 8_388_608.0;
    for (o, x) in out.iter_mut().zip(v) {
        *o = (x * scale + TWO_23).to_bits() as u8;
    }
}

#[cfg(test)]
mod tests {
    use super::*;
    use proptest::prelude::*;

    #[test]
    fn identical_patches_cost_nothing_whatever_gain_and_offset() {
        let a: Vec<f32> = (0..100).map(|i| ((i * 37) % 23) as f32).collect();
        let b: Vec<f32> = a.iter().map(|x| 3.0 * x + 50.0).collect();
        let (mut line, mut out) = (vec![0.0; 20], vec![0.0; 36]);
        let moments = |t: &[f32], line: &mut [f32]| {
            let (mut m, mut s) = (vec![0.0; 36], vec![0.0; 36]);
            patch_moments(t, 10, 5, 1e-6, line, &mut m, &mut s);
            (m, s)
        };
        let (ma, sa) = moments(&a, &mut line);
        let (mb, sb) = moments(&b, &mut line);
        let side = |t, m, s| Side { tile: t, mean: m, inverse_deviation: s };
        correlation_cost(side(&a, &ma, &sa), side(&b, &mb, &sb), 10, 5, &mut line, &mut out);
        assert!(out.iter().all(|&c| c < 1e-4), "{out:?}");
    }

    const SIDE: usize = 5;

    /// The cost of two tiles of one patch.
    fn patch_cost(a: &[f32], b: &[f32], floor: f32) -> f32 {
        let moments = |t: &[f32]| {
            let (mut line, mut m, mut s) = (vec![0.0; 2 * SIDE], vec![0.0; 1], vec![0.0; 1]);
            patch_moments(t, SIDE, SIDE, floor, &mut line, &mut m, &mut s);
            (m, s)
        };
        let ((ma, sa), (mb, sb)) = (moments(a), moments(b));
        let side = |t, m, s| Side { tile: t, mean: m, inverse_deviation: s };
        let (mut line, mut out) = (vec![0.0; 2 * SIDE], vec![0.0; 1]);
        correlation_cost(side(a, &ma, &sa), side(b, &mb, &sb), SIDE, SIDE, &mut line, &mut out);
        out[0]
    }

    /// The zero-mean, unit-norm feature of a patch.
    fn feature(patch: &[f32]) -> Vec<f64> {
        let mean = patch.iter().map(|v| f64::from(*v)).sum::<f64>() / patch.len() as f64;
        let centred: Vec<f64> = patch.iter().map(|v| f64::from(*v) - mean).collect();
        let norm = centred.iter().map(|v| v * v).sum::<f64>().sqrt();
        centred.iter().map(|v| v / norm).collect()
    }

    /// Patches with a common picture, so that no correlation is truncated.
    fn alike(n: usize) -> impl Strategy<Value = Vec<Vec<f32>>> {
        let patch = || prop::collection::vec(-20.0..20.0f32, SIDE * SIDE);
        (prop::collection::vec(-60.0..60.0f32, SIDE * SIDE), prop::collection::vec(patch(), n)).prop_map(
            |(common, own)| {
                let add = |o: Vec<f32>| o.iter().zip(&common).map(|(a, b)| a + b).collect();
                own.into_iter().map(add).collect()
            },
        )
    }

    proptest! {
        /// `1 − ‖mean f‖² = (1 − 1/N)(1 − mean ρ)`; for two views `(1 − ρ) / 2`.
        #[test]
        fn the_variance_over_the_views_is_one_minus_their_mean_correlation(patches in (2..6usize).prop_flat_map(alike)) {
            let n = patches.len();
            let features: Vec<Vec<f64>> = patches.iter().map(|p| feature(p)).collect();
            let dot = |a: &[f64], b: &[f64]| a.iter().zip(b).map(|(x, y)| x * y).sum::<f64>();
            let pairs = (0..n).flat_map(|i| (0..i).map(move |j| (i, j)));
            prop_assume!(pairs.clone().all(|(i, j)| dot(&features[i], &features[j]) > 0.01));
            let mean: Vec<f64> = (0..SIDE * SIDE).map(|k| features.iter().map(|f| f[k]).sum::<f64>() / n as f64).collect();
            let variance = 1.0 - dot(&mean, &mean);
            let costs: Vec<f64> = pairs.map(|(i, j)| f64::from(patch_cost(&patches[i], &patches[j], 0.0))).collect();
            let mean_cost = costs.iter().sum::<f64>() / costs.len() as f64;
            prop_assert!((variance - (1.0 - 1.0 / n as f64) * mean_cost).abs() < 1e-4, "{variance} {mean_cost}");
        }

        #[test]
        fn gain_and_offset_do_not_change_the_cost(patches in alike(2), gain in 0.2..20.0f32, offset in -500.0..500.0f32) {
            let changed: Vec<f32> = patches[1].iter().map(|v| gain * v + offset).collect();
            let (a, b) = (patch_cost(&patches[0], &patches[1], 0.0), patch_cost(&patches[0], &changed, 0.0));
            // The offset stands in the sums of squares: the tiles of the sweep have their mean removed.
            prop_assert!((a - b).abs() < 5e-3, "{a} {b}");
        }

        #[test]
        fn whatever_a_pixel_holds_the_cost_lies_between_0_and_1(
            a in prop::collection::vec(any_pixel(), SIDE * SIDE),
            b in prop::collection::vec(any_pixel(), SIDE * SIDE),
        ) {
            let cost = patch_cost(&a, &b, 1.0 / 12.0);
            prop_assert!((0.0..=1.0).contains(&cost), "{cost}");
            let mut out = [255u8];
            quantise(&[cost], 127.0, &mut out);
            prop_assert!(out[0] <= 127);
            let finite = a.iter().chain(&b).all(|v| v.is_finite());
            prop_assert!(finite || cost == 1.0, "{cost} of a patch that is not finite");
        }
    }

    fn any_pixel() -> impl Strategy<Value = f32> {
        prop_oneof![
            6 => -2000.0..2000.0f32,
            1 => prop_oneof![Just(f32::NAN), Just(f32::INFINITY), Just(f32::NEG_INFINITY)],
            1 => prop_oneof![Just(1e30f32), Just(-3e38f32), Just(1e-40f32)],
        ]
    }

    #[test]
    fn an_invalid_pixel_costs_one_in_every_patch_that_holds_it() {
        let mut a: Vec<f32> = (0..49).map(|i| ((i * 37) % 23) as f32).collect();
        a[0] = f32::NAN;
        let (mut line, mut out) = (vec![0.0; 14], vec![0.0; 25]);
        let (mut m, mut s) = (vec![0.0; 25], vec![0.0; 25]);
        patch_moments(&a, 7, 3, 1e-6, &mut line, &mut m, &mut s);
        let side = Side { tile: &a, mean: &m, inverse_deviation: &s };
        correlation_cost(side, side, 7, 3, &mut line, &mut out);
        assert_eq!(out[0], 1.0);
        assert!(out[1..].iter().all(|&c| c < 1e-4));
    }
}
