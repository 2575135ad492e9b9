//! The inner loops: integer arithmetic on rows, compiled for several instruction sets and chosen at run time.
//!
//! Grey values are 16-bit integers in [`FULL`]ths of the difference that counts fully; which of them are valid is told apart.

use multiversion::multiversion;

use super::COST_MAX;

/// The cost of a pair that cannot be compared: more than any that can, so that it comes last.
pub(crate) const INVALID: u8 = 255;
/// A difference of the census that counts fully; those of −`FULL` to `FULL` − 1 fit a byte.
pub(crate) const FULL: f32 = 128.0;
/// Sums of eight differences, each at most twice [`FULL`], times this over [`PARTS`] are costs: [`COST_MAX`] for a mean of [`FULL`].
const SHARE: u16 = COST_MAX as u16 / 16;
const PARTS: u16 = 8 * FULL as u16 / 16;
/// Grey values are cut here: the cubic interpolation may overshoot by 1.25 in each direction before a 16-bit integer is full.
const GREY_MAX: f32 = 20_000.0;
/// A void says nothing of a height, so that two views suffice where a third has one; but a height that takes fewer views
/// into account must not win by having fewer that can disagree. Its weight is one part of these.
const VALID_WEIGHT: u16 = 4;

/// Turns grey values into integers around the mean, `scale` to one; NaN becomes 0 and is marked in `voids`, which stays empty
/// where there is none.
pub(crate) fn quantise(values: &[f32], scale: f32, out: &mut Vec<i16>, voids: &mut Vec<u8>) {
    let (sum, known) = sum_known(values);
    let mean = if known > 0.0 { sum / known } else { 0.0 };
    let mean = if mean.is_finite() { mean } else { 0.0 };
    out.resize(values.len(), 0);
    round(values, mean, scale, out);
    voids.clear();
    if (known as usize) < values.len() {
        voids.extend(values.iter().map(|v| if v.is_nan() { INVALID } else { 0 }));
    }
}

/// The sum of all values but NaN, and their number.
#[multiversion(targets("x86_64+avx2+fma"))]
fn sum_known(values: &[f32]) -> (f32, f32) {
    const LANES: usize = 16;
    let (mut sum, mut known) = ([0.0f32; LANES], [0.0f32; LANES]);
    let (whole, rest) = values.as_chunks::<LANES>();
    for values in whole {
        for i in 0..LANES {
            let is_known = !values[i].is_nan();
            sum[i] += if is_known { values[i] } else { 0.0 };
            known[i] += if is_known { 1.0 } else { 0.0 };
        }
    }
    let rest = rest.iter().filter(|v| !v.is_nan());
    (sum.iter().sum::<f32>() + rest.clone().sum::<f32>(), known.iter().sum::<f32>() + rest.count() as f32)
}

#[multiversion(targets("x86_64+avx2+fma"))]
fn round(values: &[f32], mean: f32, scale: f32, out: &mut [i16]) {
    // Adding 1.5 · 2²³ leaves the rounded integer in the lowest bits of the sum, which vectorises; a cast does not.
    const ROUND: f32 = 12_582_912.0;
    for (o, v) in out.iter_mut().zip(values) {
        // `clamp` passes a NaN on, whose lowest bits are 0: `View` keeps no others.
        *o = (((v - mean) * scale).clamp(-GREY_MAX, GREY_MAX) + ROUND).to_bits() as i16;
    }
}

/// A weight of an interpolation, in 2¹⁵ths.
pub(crate) fn fixed(weight: f32) -> i16 {
    (weight * 32_768.0).round().min(32_767.0) as i16
}

/// The graded census of a picture: every pixel's difference to the neighbours to the right, below, below on the right, and
/// of its right neighbour to the one below; the other four are those of neighbours.
#[derive(Default)]
pub(crate) struct Census {
    /// One byte per pixel of the padded tile each, [`FULL`] for no difference; the last column or row is not used.
    pub(crate) grades: [Vec<u8>; 4],
}

impl Census {
    /// Grades a tile of `width` columns.
    pub(crate) fn fill(&mut self, tile: &[i16], width: usize) {
        self.grades.iter_mut().for_each(|g| g.resize(tile.len(), 0));
        let [right, below, falling, rising] = &mut self.grades;
        grade(tile, width, right, below, falling, rising);
    }
}

#[multiversion(targets("x86_64+avx2"))]
fn grade(tile: &[i16], width: usize, right: &mut [u8], below: &mut [u8], falling: &mut [u8], rising: &mut [u8]) {
    // What the last columns and the last row get is not used.
    let n = tile.len();
    codes(&tile[1..], &tile[..n - 1], right);
    codes(&tile[width..], &tile[..n - width], below);
    codes(&tile[width + 1..], &tile[..n - width - 1], falling);
    codes(&tile[width..], &tile[1..n - width + 1], rising);
}

/// The grades of differences.
#[inline(always)]
fn codes(to: &[i16], from: &[i16], out: &mut [u8]) {
    for ((o, to), from) in out.iter_mut().zip(to).zip(from) {
        *o = (to.saturating_sub(*from).clamp(-128, 127) as i8 as u8) ^ 0x80;
    }
}

/// The cost of every pixel of two padded tiles of `width` columns: the mean absolute difference of their census in
/// [`FULL`]ths, cut at 1, which is what unrelated pictures differ by, as 0 to [`COST_MAX`].
pub(crate) fn census_cost(a: &Census, b: &Census, width: usize, apart: &mut [Vec<u8>; 4], out: &mut [u8]) {
    for ((a, b), d) in a.grades.iter().zip(&b.grades).zip(apart.iter_mut()) {
        d.resize(a.len(), 0);
        differ(a, b, d);
    }
    let [right, below, falling, rising] = apart;
    gather(right, below, falling, rising, width, out);
}

#[multiversion(targets("x86_64+avx2"))]
fn differ(a: &[u8], b: &[u8], out: &mut [u8]) {
    for ((o, a), b) in out.iter_mut().zip(a).zip(b) {
        *o = a.abs_diff(*b);
    }
}

/// The mean of the eight differences around every pixel of the core.
#[multiversion(targets("x86_64+avx2"))]
fn gather(right: &[u8], below: &[u8], falling: &[u8], rising: &[u8], width: usize, out: &mut [u8]) {
    let core = width - 2;
    for (y, o) in out.chunks_exact_mut(core).enumerate() {
        let (upper, own) = (y * width, (y + 1) * width);
        let (left, on) = (&right[own..own + core], &right[own + 1..own + 1 + core]);
        let (up, down) = (&below[upper + 1..upper + 1 + core], &below[own + 1..own + 1 + core]);
        let (up_left, down_right) = (&falling[upper..upper + core], &falling[own + 1..own + 1 + core]);
        let (up_right, down_left) = (&rising[upper + 1..upper + 1 + core], &rising[own..own + core]);
        for x in 0..core {
            let two = |a: u8, b: u8| u16::from(a) + u16::from(b);
            let beside = two(left[x], on[x]) + two(up[x], down[x]);
            let across = two(up_left[x], down_right[x]) + two(up_right[x], down_left[x]);
            o[x] = (((beside + across) * SHARE + PARTS / 2) / PARTS).min(u16::from(COST_MAX)) as u8;
        }
    }
}

/// Marks in `voids` (rows of `stride`) every place from which a square of `side` to the right and below holds a marked one.
#[multiversion(targets("x86_64+avx2"))]
pub(crate) fn spread(voids: &mut [u8], stride: usize, side: usize) {
    for row in voids.chunks_exact_mut(stride) {
        for _ in 1..side {
            (1..stride).for_each(|x| row[x - 1] |= row[x]);
        }
    }
    let mut rest = voids;
    while let Some((row, below)) = rest.split_at_mut_checked(stride) {
        for other in below.chunks(stride).take(side - 1) {
            row.iter_mut().zip(other).for_each(|(v, other)| *v |= other);
        }
        rest = below;
    }
}

/// Makes the costs of rows of `width` invalid where `voids` (rows of `stride`) are marked.
#[multiversion(targets("x86_64+avx2"))]
pub(crate) fn hide(costs: &mut [u8], width: usize, voids: &[u8], stride: usize) {
    for (costs, voids) in costs.chunks_exact_mut(width).zip(voids.chunks(stride)) {
        costs.iter_mut().zip(voids).for_each(|(c, v)| *c |= v);
    }
}

/// Keeps the smaller of two rows in `a` and the larger in `b`.
#[multiversion(targets("x86_64+avx2+fma"))]
pub(crate) fn sort_pair(a: &mut [u8], b: &mut [u8]) {
    for (p, q) in a.iter_mut().zip(b) {
        let (lo, hi) = ((*p).min(*q), (*p).max(*q));
        *p = lo;
        *q = hi;
    }
}

/// `out`: the weighted mean of each pixel's costs, in which an invalid one counts as chance does, [`COST_MAX`], and a
/// valid one [`VALID_WEIGHT`] times as much.
#[multiversion(targets("x86_64+avx2"))]
pub(crate) fn mean_cost(costs: &[Vec<u8>], sums: &mut [u16], weights: &mut [u16], out: &mut [u8]) {
    if let [only] = costs {
        out.iter_mut().zip(only).for_each(|(o, c)| *o = (*c).min(COST_MAX));
        return;
    }
    sums.fill(0);
    weights.fill(0);
    costs.iter().for_each(|pair| add_cost(pair, sums, weights));
    divide(sums, weights, out);
}

#[multiversion(targets("x86_64+avx2+fma"))]
fn add_cost(pair: &[u8], sums: &mut [u16], weights: &mut [u16]) {
    for ((s, n), c) in sums.iter_mut().zip(weights.iter_mut()).zip(pair) {
        let weight = if *c == INVALID { 1 } else { VALID_WEIGHT };
        *s += weight * u16::from((*c).min(COST_MAX));
        *n += weight;
    }
}

#[multiversion(targets("x86_64+avx2+fma"))]
fn divide(sums: &[u16], weights: &[u16], out: &mut [u8]) {
    /// As in [`round`], for what is not negative.
    const TWO_23: f32 = 8_388_608.0;
    for ((o, s), n) in out.iter_mut().zip(sums).zip(weights) {
        *o = (f32::from(*s) / f32::from(*n) + TWO_23).to_bits() as u8;
    }
}

#[cfg(test)]
mod tests {
    use super::*;
    use proptest::prelude::*;

    const SIDE: usize = 3;

    /// The least difference of two costs.
    const UNIT: f64 = 1.0 / COST_MAX as f64;

    /// The cost of two tiles of `side` columns each, as the sweep computes it.
    fn tile_cost(a: &[f32], b: &[f32], (scale_a, scale_b): (f32, f32), side: usize) -> Vec<u8> {
        let mut out = vec![0; (side - 2) * (side - 2)];
        let mut hidden = Vec::new();
        let mut graded = |tile: &[f32], scale: f32| {
            let (mut grey, mut voids, mut census) = (Vec::new(), Vec::new(), Census::default());
            quantise(tile, scale * FULL, &mut grey, &mut voids);
            census.fill(&grey, side);
            spread(&mut voids, side, 3);
            hidden.push(voids);
            census
        };
        census_cost(&graded(a, scale_a), &graded(b, scale_b), side, &mut Default::default(), &mut out);
        hidden.iter().for_each(|voids| hide(&mut out, side - 2, voids, side));
        out
    }

    /// The cost of two tiles of one patch.
    fn patch_cost(a: &[f32], b: &[f32], scales: (f32, f32)) -> u8 {
        tile_cost(a, b, scales, SIDE)[0]
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
            const HARD: f32 = 0.95;
            let n = patches.len() as f64;
            let centre = SIDE * SIDE / 2;
            let bits = (0..SIDE * SIDE).filter(|k| *k != centre);
            let share = |k: usize| patches.iter().filter(|p| p[k] > p[centre]).count() as f64 / n;
            prop_assume!(patches.iter().all(|p| bits.clone().all(|k| (p[k] - p[centre]).abs() > 1.1)));
            let variance = bits.clone().map(|k| share(k) * (1.0 - share(k))).sum::<f64>() / bits.count() as f64;
            let pairs = (0..patches.len()).flat_map(|i| (0..i).map(move |j| (i, j)));
            let costs: Vec<f64> = pairs
                .map(|(i, j)| UNIT * f64::from(patch_cost(&patches[i], &patches[j], (HARD, HARD))))
                .collect();
            // A pair that differs in more than half of its bits is cut at 1.
            prop_assume!(costs.iter().all(|c| *c < 1.0));
            let mean = costs.iter().sum::<f64>() / costs.len() as f64;
            prop_assert!((mean - 4.0 * n / (n - 1.0) * variance).abs() < UNIT, "{mean} {variance}");
        }

        #[test]
        fn gain_and_offset_do_not_change_the_cost(
            (a, b) in (patch(), patch()), gain in 0.2..20.0f32, offset in -500.0..500.0f32,
        ) {
            let changed: Vec<f32> = b.iter().map(|v| gain * v + offset).collect();
            let (before, after) = (patch_cost(&a, &b, (0.1, 0.1)), patch_cost(&a, &changed, (0.1, 0.1 / gain)));
            prop_assert!(before.abs_diff(after) <= 1, "{before} {after}");
            prop_assert!(patch_cost(&b, &changed, (0.1, 0.1 / gain)) <= 1);
        }

        #[test]
        fn whatever_a_pixel_holds_the_cost_lies_between_0_and_the_worst(
            a in prop::collection::vec(any_pixel(), SIDE * SIDE),
            b in prop::collection::vec(any_pixel(), SIDE * SIDE),
        ) {
            let cost = patch_cost(&a, &b, (0.1, 0.1));
            prop_assert!(cost <= COST_MAX || cost == INVALID, "{cost}");
            let mut out = [255];
            mean_cost(&[vec![cost], vec![INVALID]], &mut [0], &mut [0], &mut out);
            prop_assert!(out[0] >= cost.min(COST_MAX) && out[0] <= COST_MAX, "{out:?}");
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
        let out = tile_cost(&a, &a, (0.1, 0.1), 7);
        assert_eq!(out[0], INVALID);
        assert!(out[1..].iter().all(|&c| c == 0));
    }
}
