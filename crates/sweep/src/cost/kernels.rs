//! Inner loops of the costs: integer arithmetic on rows, compiled for several instruction sets, of
//! which the best is chosen at run time.
//!
//! Grey values are 16-bit integers in which [`FULL`] is the difference that counts fully. Voids are
//! marked elsewhere ([`super::voids::Voids`]).

use multiversion::multiversion;

use super::config::COST_MAX;

/// Cost of a pair that cannot be compared. It exceeds every other cost, so that it is sorted last.
pub(crate) const INVALID: u8 = 255;
/// Difference that counts fully in the census. Differences from −`FULL` to `FULL` − 1 fit a byte.
pub(crate) const FULL: f32 = 128.0;
/// Grey values are cut at ± this value. The cubic interpolation may then overshoot by a factor of
/// 1.25 in each direction before a 16-bit integer overflows.
const GREY_MAX: f32 = 20_000.0;
/// 1.5 · 2²³. Added to a value it leaves the rounded integer in the lowest bits of the sum. Unlike
/// a cast, this is vectorised.
const ROUND: f32 = 12_582_912.0;
/// One in this many runs of values is enough to find the mean around which the integers lie.
const MEAN_STEP: usize = 4;
/// Weight of a valid cost, against 1 for an invalid one.
///
/// A void tells nothing about a height, so that two views suffice where the third has one. But a
/// height that fewer views see must not win because fewer can disagree, so an invalid cost counts a
/// little.
const VALID_WEIGHT: u16 = 4;

/// Converts grey values to integers around their mean, `scale` integers per grey value, with room
/// for `behind` more. NaN becomes 0. Returns whether there is a NaN.
pub(crate) fn quantise(values: &[f32], scale: f32, behind: usize, out: &mut Vec<i16>) -> bool {
    let mean = rough_mean(values);
    out.resize(values.len() + behind, 0);
    round(values, mean, scale, out)
}

/// Returns the mean of a sample of the values, or of all of them if the sample has no valid value.
/// NaN is left out; the result is 0 if all are NaN.
fn rough_mean(values: &[f32]) -> f32 {
    [MEAN_STEP, 1].into_iter().map(|step| mean_of(values, step)).find(|mean| mean.is_finite()).unwrap_or(0.0)
}

/// Returns the mean of every `step`th run of sixteen values, NaN left out.
#[multiversion(targets("x86_64+avx2+fma"))]
fn mean_of(values: &[f32], step: usize) -> f32 {
    const LANES: usize = 16;
    let (mut sum, mut known) = ([0.0f32; LANES], [0.0f32; LANES]);
    let (whole, rest) = values.as_chunks::<LANES>();
    for values in whole.iter().step_by(step) {
        for i in 0..LANES {
            let is_known = !values[i].is_nan();
            sum[i] += if is_known { values[i] } else { 0.0 };
            known[i] += if is_known { 1.0 } else { 0.0 };
        }
    }
    let rest = rest.iter().filter(|v| !v.is_nan());
    (sum.iter().sum::<f32>() + rest.clone().sum::<f32>()) / (known.iter().sum::<f32>() + rest.count() as f32)
}

/// Rounds the scaled differences to the mean. Returns whether a value is NaN.
#[multiversion(targets("x86_64+avx2+fma"))]
fn round(values: &[f32], mean: f32, scale: f32, out: &mut [i16]) -> bool {
    let mut has_nan = 0;
    for (o, v) in out.iter_mut().zip(values) {
        // `clamp` passes a NaN on, and its lowest 16 bits are 0: `SweepView` keeps only such NaNs.
        *o = (((v - mean) * scale).clamp(-GREY_MAX, GREY_MAX) + ROUND).to_bits() as i16;
        has_nan |= i32::from(v.is_nan());
    }
    has_nan != 0
}

/// Converts the weight of an interpolation to 2¹⁵ths.
pub(crate) fn fixed(weight: f32) -> i16 {
    ((weight * 32_768.0).min(32_767.0) + ROUND).to_bits() as i16
}

/// Moves the smaller of each two values to `a` and the larger to `b`.
#[multiversion(targets("x86_64+avx2+fma"))]
pub(crate) fn sort_pair(a: &mut [u8], b: &mut [u8]) {
    for (p, q) in a.iter_mut().zip(b) {
        let (lo, hi) = ((*p).min(*q), (*p).max(*q));
        *p = lo;
        *q = hi;
    }
}

/// Averages every cost with those of its eight neighbours: four parts of its own and one of each.
///
/// `costs` are rows of `width` without gaps. Those in the first and last rows and columns become
/// meaningless. An invalid cost stays invalid, and counts as the worst in its neighbours' averages;
/// `is_hidden` tells whether there is one. `sums` is a scratch buffer as long as the costs.
pub(crate) fn blend(costs: &mut [u8], width: usize, is_hidden: bool, sums: &mut [u16]) {
    if is_hidden {
        blend_rows(costs, width, sums, |cost| cost.min(COST_MAX), |own, mean| if own == INVALID { own } else { mean });
    } else {
        blend_rows(costs, width, sums, |cost| cost, |_, mean| mean);
    }
}

#[multiversion(targets("x86_64+avx2"))]
fn blend_rows(costs: &mut [u8], width: usize, sums: &mut [u16], cut: impl Fn(u8) -> u8, pick: impl Fn(u8, u8) -> u8) {
    let n = costs.len();
    if n < 2 * width + 2 {
        return;
    }
    // Sums along the rows may run across their ends, where the result does not count.
    for (i, sum) in sums[1..n - 1].iter_mut().enumerate() {
        *sum = u16::from(cut(costs[i])) + u16::from(cut(costs[i + 1])) + u16::from(cut(costs[i + 2]));
    }
    let (above, own, below) = (&sums[1..], &sums[width + 1..], &sums[2 * width + 1..]);
    let inner = n - 2 * width - 2;
    let costs = &mut costs[width + 1..][..inner];
    for (i, cost) in costs.iter_mut().enumerate() {
        let all = above[i] + own[i] + below[i] + 3 * u16::from(cut(*cost));
        // 5,462 is a twelfth of 2¹⁶.
        *cost = pick(*cost, ((u32::from(all + 6) * 5_462) >> 16) as u8);
    }
}

/// Writes the weighted mean of each pixel's costs. An invalid cost counts as [`COST_MAX`], the cost
/// of unrelated images, with weight 1; a valid one has weight [`VALID_WEIGHT`].
///
/// `is_hidden` tells whether any cost is invalid. `sums` and `weights` are scratch buffers.
pub(crate) fn mean_cost(costs: &[Vec<u8>], is_hidden: bool, sums: &mut [u16], weights: &mut [u16], out: &mut [u8]) {
    match costs {
        [a] if !is_hidden => out.copy_from_slice(a),
        [a, b] if !is_hidden => mean_of_two(a, b, out),
        [a, b, c] if !is_hidden => mean_of_three([a, b, c], out),
        _ => {
            sums.fill(0);
            weights.fill(0);
            costs.iter().for_each(|pair| add_cost(pair, sums, weights));
            divide(sums, weights, out);
        }
    }
}

#[multiversion(targets("x86_64+avx2"))]
fn mean_of_two(a: &[u8], b: &[u8], out: &mut [u8]) {
    for ((o, a), b) in out.iter_mut().zip(a).zip(b) {
        *o = (u16::from(*a) + u16::from(*b)).div_ceil(2) as u8;
    }
}

#[multiversion(targets("x86_64+avx2"))]
fn mean_of_three([a, b, c]: [&[u8]; 3], out: &mut [u8]) {
    for (((o, a), b), c) in out.iter_mut().zip(a).zip(b).zip(c) {
        // The third is rounded; 21,846 is a third of 2¹⁶.
        let sum = u16::from(*a) + u16::from(*b) + u16::from(*c) + 1;
        *o = ((u32::from(sum) * 21_846) >> 16) as u8;
    }
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
    /// 2²³, which does for non-negative values what [`ROUND`] does for all.
    const TWO_23: f32 = 8_388_608.0;
    for ((o, s), n) in out.iter_mut().zip(sums).zip(weights) {
        *o = (f32::from(*s) / f32::from(*n) + TWO_23).to_bits() as u8;
    }
}

#[cfg(test)]
mod tests {
    use super::super::census::{CHUNK, Census, CensusScratch, census_cost, overhang};
    use super::super::part::{MARGIN, Part};
    use super::super::voids::Voids;
    use super::*;
    use proptest::prelude::*;

    const SIDE: usize = 3;

    /// Smallest difference of two costs.
    const UNIT: f64 = 1.0 / COST_MAX as f64;

    /// Repeats the border of a tile of `side` columns once around it.
    fn bordered(tile: &[f32], side: usize) -> Vec<f32> {
        let inside = |i: usize| i.clamp(1, side) - 1;
        (0..(side + 2) * (side + 2)).map(|i| tile[inside(i / (side + 2)) * side + inside(i % (side + 2))]).collect()
    }

    /// Returns the costs of the inner pixels of two tiles of `side` columns each, as the sweep
    /// computes them before costs are blended. The margin of a part is a pixel wider than the
    /// census.
    fn tile_cost(a: &[f32], b: &[f32], (scale_a, scale_b): (f32, f32), side: usize) -> Vec<u8> {
        let (a, b) = (&bordered(a, side)[..], &bordered(b, side)[..]);
        let side = side + 2;
        let part = Part { within: [0; 2], width: side, height: side };
        let mut hidden = Vec::new();
        let mut graded = |tile: &[f32], scale: f32| {
            let (mut grey, mut voids, mut census) = (Vec::new(), Voids::default(), Census::default());
            let has_voids = quantise(tile, scale * FULL, overhang(side), &mut grey);
            census.fill(&grey, side, tile.len());
            voids.mark(tile, side, 2 * MARGIN + 1, has_voids);
            hidden.push(voids);
            census
        };
        let (a, b) = (graded(a, scale_a), graded(b, scale_b));
        let mut costs = vec![0; part.area().next_multiple_of(CHUNK)];
        census_cost(&a, &b, side, &mut CensusScratch::default(), &mut costs);
        for voids in hidden {
            voids.hide((0, 0), part, INVALID, &mut costs);
        }
        (MARGIN..side - MARGIN).flat_map(|y| costs[y * side + MARGIN..(y + 1) * side - MARGIN].to_vec()).collect()
    }

    /// Returns the cost of two tiles of one patch each.
    fn patch_cost(a: &[f32], b: &[f32], scales: (f32, f32)) -> u8 {
        tile_cost(a, b, scales, SIDE)[0]
    }

    fn patch() -> impl Strategy<Value = Vec<f32>> {
        prop::collection::vec(-60.0..60.0f32, SIDE * SIDE)
    }

    /// Patches that share most of their image, so that no cost is cut.
    fn alike(n: usize) -> impl Strategy<Value = Vec<Vec<f32>>> {
        let own = prop::collection::vec(-20.0..20.0f32, SIDE * SIDE);
        (patch(), prop::collection::vec(own, n)).prop_map(|(common, own)| {
            let add = |o: Vec<f32>| o.iter().zip(&common).map(|(a, b)| a + b).collect();
            own.into_iter().map(add).collect()
        })
    }

    proptest! {
        /// For bits the mean over pairs of `|s − t|` is `4 N / (N − 1) · mean p (1 − p)`, where p
        /// is the share of views that have the bit.
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
            mean_cost(&[vec![cost], vec![INVALID]], true, &mut [0], &mut [0], &mut out);
            prop_assert!(out[0] >= cost.min(COST_MAX) && out[0] <= COST_MAX, "{out:?}");
            prop_assert!(!a.iter().chain(&b).any(|v| v.is_nan()) || cost == INVALID, "{cost} of an invalid patch");
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
    fn costs_are_averaged_over_nine_pixels_and_invalid_ones_stay_invalid() {
        let (width, height) = (7, 6);
        let own: Vec<u8> = (0..width * height).map(|i| (i * 29 % 113) as u8).collect();
        let blended = |costs: &[u8], is_hidden| {
            let mut out = costs.to_vec();
            blend(&mut out, width, is_hidden, &mut vec![0; width * height]);
            out
        };
        let expected = |costs: &[u8], x: usize, y: usize| {
            let at = |u: usize, v: usize| f64::from(costs[v * width + u].min(COST_MAX));
            let around = (y - 1..=y + 1).flat_map(|v| (x - 1..=x + 1).map(move |u| (u, v)));
            (around.map(|(u, v)| at(u, v)).sum::<f64>() + 3.0 * at(x, y)) / 12.0
        };
        let mut holed = own.clone();
        holed[2 * width + 3] = INVALID;
        for (costs, is_hidden) in [(&own, false), (&own, true), (&holed, true)] {
            let out = blended(costs, is_hidden);
            for (x, y) in (1..height - 1).flat_map(|y| (1..width - 1).map(move |x| (x, y))) {
                let (found, own) = (out[y * width + x], costs[y * width + x]);
                assert!(own != INVALID || found == INVALID);
                assert!(own == INVALID || (f64::from(found) - expected(costs, x, y)).abs() <= 0.51, "at ({x}, {y})");
            }
        }
    }

    #[test]
    fn an_invalid_pixel_makes_every_patch_invalid_that_holds_it() {
        let mut a: Vec<f32> = (0..49).map(|i| ((i * 37) % 23) as f32).collect();
        a[0] = f32::NAN;
        let out = tile_cost(&a, &a, (0.1, 0.1), 7);
        // The inner pixels are 5 × 5; a pixel's patch reaches two pixels, its neighbours' averages
        // included.
        for (i, cost) in out.into_iter().enumerate() {
            assert_eq!(cost, if i % 5 < 2 && i / 5 < 2 { INVALID } else { 0 }, "at {i}");
        }
    }
}
