//! The inner loops: plain arithmetic on rows, compiled for several instruction sets and chosen at run time.
//!
//! NaN marks invalid pixels and spreads to every patch that touches one.

use multiversion::multiversion;

/// The cost of a pair that cannot be compared: more than any that can, so that it comes last.
pub(crate) const INVALID: f32 = 2.0;
/// A void says nothing of a height, so that two views suffice where a third has one; but a height that takes fewer views
/// into account must not win by having fewer that can disagree.
const INVALID_WEIGHT: f32 = 0.25;

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

/// Mean absolute difference of the graded census of every pixel of two tiles of `width` columns that are padded by one
/// pixel and in the unit that counts fully; cut at 1, which is what unrelated pictures differ by; [`INVALID`] where a
/// patch is.
#[multiversion(targets("x86_64+avx2+fma"))]
pub(crate) fn census_cost(a: &[f32], b: &[f32], width: usize, out: &mut [f32]) {
    let core = width - 2;
    for (y, o) in out.chunks_exact_mut(core).enumerate() {
        let (a0, a1, a2) = three_rows(a, y, width);
        let (b0, b1, b2) = three_rows(b, y, width);
        for x in 0..core {
            let (p, q) = (a1[x + 1], b1[x + 1]);
            let mut sum = apart(a0[x], p, b0[x], q);
            sum += apart(a0[x + 1], p, b0[x + 1], q);
            sum += apart(a0[x + 2], p, b0[x + 2], q);
            sum += apart(a1[x], p, b1[x], q);
            sum += apart(a1[x + 2], p, b1[x + 2], q);
            sum += apart(a2[x], p, b2[x], q);
            sum += apart(a2[x + 1], p, b2[x + 1], q);
            sum += apart(a2[x + 2], p, b2[x + 2], q);
            let mean = sum * 0.125;
            o[x] = if mean.is_nan() { INVALID } else { mean.min(1.0) };
        }
    }
}

/// The rows `y`, `y + 1` and `y + 2` of a tile.
#[inline(always)]
fn three_rows(tile: &[f32], y: usize, width: usize) -> (&[f32], &[f32], &[f32]) {
    let rows = &tile[y * width..(y + 3) * width];
    (&rows[..width], &rows[width..2 * width], &rows[2 * width..])
}

/// Difference of two graded bits: of neighbours `u`, `v` to their centres `p`, `q`.
#[inline(always)]
fn apart(u: f32, p: f32, v: f32, q: f32) -> f32 {
    // `clamp` passes a NaN on.
    ((u - p).clamp(-1.0, 1.0) - (v - q).clamp(-1.0, 1.0)).abs()
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

/// `out`: the weighted mean of each pixel's costs, in which an invalid one counts as chance does, 1, with [`INVALID_WEIGHT`].
#[multiversion(targets("x86_64+avx2+fma"))]
pub(crate) fn mean_cost(costs: &[Vec<f32>], weights: &mut [f32], out: &mut [f32]) {
    out.fill(0.0);
    weights.fill(0.0);
    for pair in costs {
        for ((o, n), c) in out.iter_mut().zip(weights.iter_mut()).zip(pair) {
            let weight = if *c <= 1.0 { 1.0 } else { INVALID_WEIGHT };
            *o += weight * c.min(1.0);
            *n += weight;
        }
    }
    for (o, n) in out.iter_mut().zip(weights.iter()) {
        *o /= n;
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

    const SIDE: usize = 3;

    /// The cost of two tiles of one patch.
    fn patch_cost(a: &[f32], b: &[f32], (scale_a, scale_b): (f32, f32)) -> f32 {
        let scaled = |t: &[f32], scale: f32| t.iter().map(|v| v * scale).collect::<Vec<_>>();
        let mut out = [0.0];
        census_cost(&scaled(a, scale_a), &scaled(b, scale_b), SIDE, &mut out);
        out[0]
    }

    fn patch() -> impl Strategy<Value = Vec<f32>> {
        prop::collection::vec(-60.0..60.0f32, SIDE * SIDE)
    }

    /// Patches with a common picture, so that no cost is cut.
    fn alike(n: usize) -> impl Strategy<Value = Vec<Vec<f32>>> {
        let own = prop::collection::vec(-20.0..20.0f32, SIDE * SIDE);
        (patch(), prop::collection::vec(own, n)).prop_map(|(common, own)| {
            let add = |o: Vec<f32>| o.iter().zip(&common).map(|(a, b)| a + b).collect();
            own.into_iter().map(add).collect()
        })
    }

    proptest! {
        /// For bits the mean over pairs of `|s − t|` is `4 N / (N − 1) · mean p (1 − p)`, p the share of views with the bit.
        #[test]
        fn the_mean_over_all_pairs_is_the_variance_of_the_census_bits(patches in (2..6usize).prop_flat_map(alike)) {
            const HARD: f32 = 1e12;
            let n = patches.len() as f64;
            let centre = SIDE * SIDE / 2;
            let bits = (0..SIDE * SIDE).filter(|k| *k != centre);
            let share = |k: usize| patches.iter().filter(|p| p[k] > p[centre]).count() as f64 / n;
            prop_assume!(patches.iter().all(|p| bits.clone().all(|k| (p[k] - p[centre]).abs() > 1e-3)));
            let variance = bits.clone().map(|k| share(k) * (1.0 - share(k))).sum::<f64>() / bits.count() as f64;
            let pairs = (0..patches.len()).flat_map(|i| (0..i).map(move |j| (i, j)));
            let costs: Vec<f64> = pairs
                .map(|(i, j)| f64::from(patch_cost(&patches[i], &patches[j], (HARD, HARD))))
                .collect();
            // A pair that differs in more than half of its bits is cut at 1.
            prop_assume!(costs.iter().all(|c| *c < 1.0));
            let mean = costs.iter().sum::<f64>() / costs.len() as f64;
            prop_assert!((mean - 4.0 * n / (n - 1.0) * variance).abs() < 1e-5, "{mean} {variance}");
        }

        #[test]
        fn gain_and_offset_do_not_change_the_cost(
            (a, b) in (patch(), patch()), gain in 0.2..20.0f32, offset in -500.0..500.0f32,
        ) {
            let changed: Vec<f32> = b.iter().map(|v| gain * v + offset).collect();
            let (before, after) = (patch_cost(&a, &b, (0.1, 0.1)), patch_cost(&a, &changed, (0.1, 0.1 / gain)));
            prop_assert!((before - after).abs() < 1e-3, "{before} {after}");
            prop_assert!(patch_cost(&b, &changed, (0.1, 0.1 / gain)) < 1e-3);
        }

        #[test]
        fn whatever_a_pixel_holds_the_cost_lies_between_0_and_1(
            a in prop::collection::vec(any_pixel(), SIDE * SIDE),
            b in prop::collection::vec(any_pixel(), SIDE * SIDE),
        ) {
            let cost = patch_cost(&a, &b, (0.1, 0.1));
            prop_assert!((0.0..=1.0).contains(&cost) || cost == INVALID, "{cost}");
            let (mut mean, mut out) = ([0.0], [255u8]);
            mean_cost(&[vec![cost], vec![INVALID]], &mut [0.0], &mut mean);
            prop_assert!(mean[0] >= cost.min(1.0) && mean[0] <= 1.0);
            quantise(&mean, 127.0, &mut out);
            prop_assert!(out[0] <= 127);
            prop_assert!(!a.iter().chain(&b).any(|v| v.is_nan()) || cost == INVALID, "{cost} of a patch that is not valid");
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
    fn an_invalid_pixel_makes_every_patch_invalid_that_holds_it() {
        let mut a: Vec<f32> = (0..49).map(|i| ((i * 37) % 23) as f32).collect();
        a[0] = f32::NAN;
        let mut out = vec![0.0; 25];
        census_cost(&a, &a, 7, &mut out);
        assert_eq!(out[0], INVALID);
        assert!(out[1..].iter().all(|&c| c == 0.0));
    }
}
