//! The inner loops: plain arithmetic on rows, compiled for several instruction sets and chosen at run time.
//!
//! NaN marks invalid pixels and spreads to every patch that touches one.

use multiversion::multiversion;

use super::COST_MAX;

/// The cost of a pair that cannot be compared: more than any that can, so that it comes last.
pub(crate) const INVALID: u8 = 255;
/// A difference of the census that counts fully, as its grade.
pub(crate) const FULL: f32 = COST_MAX as f32;
/// The grade of no difference; those of −[`FULL`] to [`FULL`] lie around it.
const EQUAL: f32 = 128.0;
/// Adding 2²³ leaves the rounded integer in the lowest bits of the sum, which vectorises; a cast does not.
const TWO_23: f32 = 8_388_608.0;
/// A void says nothing of a height, so that two views suffice where a third has one; but a height that takes fewer views
/// into account must not win by having fewer that can disagree. Its weight is one part of these.
const VALID_WEIGHT: u16 = 4;

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

/// The graded census of a picture: every pixel's difference to the neighbours to the right, below, below on the right, and
/// of its right neighbour to the one below; the other four are those of neighbours. 0 marks a difference that is not
/// valid.
#[derive(Default)]
pub(crate) struct Census {
    /// One byte per pixel of the padded tile each; the last column or row is not used.
    pub(crate) grades: [Vec<u8>; 4],
}

impl Census {
    /// Grades a tile of `width` columns in which [`FULL`] is the difference that counts fully.
    pub(crate) fn fill(&mut self, tile: &[f32], width: usize) {
        self.grades.iter_mut().for_each(|g| g.resize(tile.len(), 0));
        let [right, below, falling, rising] = &mut self.grades;
        grade(tile, width, right, below, falling, rising);
    }
}

#[multiversion(targets("x86_64+avx2+fma"))]
fn grade(tile: &[f32], width: usize, right: &mut [u8], below: &mut [u8], falling: &mut [u8], rising: &mut [u8]) {
    let (rows, n) = (tile.len() / width, width - 1);
    for y in 0..rows {
        let own = &tile[y * width..(y + 1) * width];
        let (from, to) = (&own[..n], &own[1..]);
        let out = &mut right[y * width..y * width + n];
        for x in 0..n {
            out[x] = code(to[x] - from[x]);
        }
        if y + 1 == rows {
            break;
        }
        let next = &tile[(y + 1) * width..(y + 2) * width];
        let out = &mut below[y * width..(y + 1) * width];
        for x in 0..width {
            out[x] = code(next[x] - own[x]);
        }
        let out = &mut falling[y * width..y * width + n];
        for x in 0..n {
            out[x] = code(next[x + 1] - from[x]);
        }
        let out = &mut rising[y * width..y * width + n];
        for x in 0..n {
            out[x] = code(next[x] - to[x]);
        }
    }
}

/// The grade of a difference; 0 for NaN, whose lowest byte is 0 ([`crate::View`] keeps no others).
#[inline(always)]
fn code(difference: f32) -> u8 {
    // `clamp` passes a NaN on.
    (difference.clamp(-FULL, FULL) + (TWO_23 + EQUAL)).to_bits() as u8
}

/// The cost of every pixel of two padded tiles of `width` columns: the mean absolute difference of their census in
/// [`FULL`]ths, cut at 1, which is what unrelated pictures differ by; [`INVALID`] where a patch is.
pub(crate) fn census_cost(a: &Census, b: &Census, width: usize, apart: &mut [Vec<u8>; 4], out: &mut [u8]) {
    for ((a, b), d) in a.grades.iter().zip(&b.grades).zip(apart.iter_mut()) {
        d.resize(a.len(), 0);
        differ(a, b, d);
    }
    let [right, below, falling, rising] = apart;
    gather(right, below, falling, rising, width, out);
}

/// Absolute differences of grades, at most 254; 255 where one is not valid.
#[multiversion(targets("x86_64+avx2+fma"))]
fn differ(a: &[u8], b: &[u8], out: &mut [u8]) {
    for ((o, a), b) in out.iter_mut().zip(a).zip(b) {
        *o = if *a.min(b) == 0 { 255 } else { a.abs_diff(*b) };
    }
}

/// The mean of the eight differences around every pixel of the core.
#[multiversion(targets("x86_64+avx2+fma"))]
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
            let most = left[x].max(on[x]).max(up[x].max(down[x]));
            let most = most.max(up_left[x].max(down_right[x]).max(up_right[x].max(down_left[x])));
            o[x] = if most == 255 { INVALID } else { ((beside + across + 4) >> 3).min(FULL as u16) as u8 };
        }
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

/// `out`: the weighted mean of each pixel's costs, in which an invalid one counts as chance does, [`FULL`], and a valid
/// one [`VALID_WEIGHT`] times as much.
pub(crate) fn mean_cost(costs: &[Vec<u8>], sums: &mut [u16], weights: &mut [u16], out: &mut [u8]) {
    sums.fill(0);
    weights.fill(0);
    costs.iter().for_each(|pair| add_cost(pair, sums, weights));
    divide(sums, weights, out);
}

#[multiversion(targets("x86_64+avx2+fma"))]
fn add_cost(pair: &[u8], sums: &mut [u16], weights: &mut [u16]) {
    for ((s, n), c) in sums.iter_mut().zip(weights.iter_mut()).zip(pair) {
        let weight = if *c == INVALID { 1 } else { VALID_WEIGHT };
        *s += weight * u16::from((*c).min(FULL as u8));
        *n += weight;
    }
}

#[multiversion(targets("x86_64+avx2+fma"))]
fn divide(sums: &[u16], weights: &[u16], out: &mut [u8]) {
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
    const UNIT: f64 = 1.0 / FULL as f64;

    /// The cost of two tiles of one patch.
    fn patch_cost(a: &[f32], b: &[f32], (scale_a, scale_b): (f32, f32)) -> u8 {
        let graded = |tile: &[f32], scale: f32| {
            let mut census = Census::default();
            census.fill(&tile.iter().map(|v| v * scale * FULL).collect::<Vec<_>>(), SIDE);
            census
        };
        let mut out = [0];
        census_cost(&graded(a, scale_a), &graded(b, scale_b), SIDE, &mut Default::default(), &mut out);
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
        let (mut census, mut out) = (Census::default(), [1; 25]);
        census.fill(&a, 7);
        census_cost(&census, &census, 7, &mut Default::default(), &mut out);
        assert_eq!(out[0], INVALID);
        assert!(out[1..].iter().all(|&c| c == 0));
    }
}
