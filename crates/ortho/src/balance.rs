//! Brings the grey values of several images together by a gain and an offset for each.
//!
//! Where two images see the same cells, their values are related by v_j = g v_i + o, up to what
//! moved, shadows and glare. Per pair, median and spread of either side are taken over the cells
//! that fit, which are found by a fit and a cut at three robust deviations, a few times over. The
//! spreads give log gains, the medians offsets; over all pairs they are solved for in the sense of
//! least squares, weighted by count and correlation. The image that covers most keeps its values.
//! Moments treat both images alike, where a regression would draw every gain towards zero by the
//! noise of one of them.

use nalgebra::{DMatrix, DVector};
use numeric::upper_median;

/// Rounds of fitting and removing outliers.
const ROUNDS: usize = 4;
/// Robust deviations beyond which a cell does not count.
const CUT: f64 = 3.0;
/// Least number of cells of a pair.
const LEAST: usize = 50;
/// Least correlation of a pair that counts for the gains.
const ALIKE: f64 = 0.3;
/// Weight that keeps an image without pairs at its own values.
const RIDGE: f64 = 1e-9;
/// Standard deviation of a normal distribution in terms of the median absolute deviation.
const SIGMA_PER_MAD: f64 = 1.482_602_218_505_602;

/// Gain and offset that turn the values of an image into values of the mosaic.
#[derive(Debug, Clone, Copy, PartialEq, serde::Serialize)]
pub struct Balance {
    /// Gain.
    pub gain: f64,
    /// Offset, added after the gain.
    pub offset: f64,
}

impl Balance {
    /// Leaves the values as they are.
    pub const NONE: Self = Self { gain: 1.0, offset: 0.0 };

    /// Returns the balanced value.
    #[inline]
    pub fn apply(&self, value: f32) -> f32 {
        (self.gain * f64::from(value) + self.offset) as f32
    }
}

/// Values of the same cells in two images.
#[derive(Debug, Clone, PartialEq)]
pub struct Pair {
    /// The two images.
    pub images: (usize, usize),
    /// Values of the same cell in both.
    pub values: Vec<(f32, f32)>,
}

/// Pairs that cannot be solved.
#[derive(Debug, Clone, PartialEq, thiserror::Error)]
#[error(transparent)]
pub struct BalanceError(#[from] Reason);

/// Why pairs cannot be solved.
#[derive(Debug, Clone, PartialEq, thiserror::Error)]
enum Reason {
    /// A pair names an image that is not there.
    #[error("a pair names image {image} of {images}")]
    Image {
        /// The image.
        image: usize,
        /// How many there are.
        images: usize,
    },
    /// The equations have no solution.
    #[error("the grey values of {images} images cannot be brought together: use the images as they are")]
    Unsolvable {
        /// How many there are.
        images: usize,
    },
}

/// Statistics of the cells that two images share.
#[derive(Debug, Clone, Copy, PartialEq)]
struct Relation {
    images: (usize, usize),
    median: (f64, f64),
    spread: (f64, f64),
    weight: f64,
    /// Whether the spreads are similar enough to count for the gains.
    alike: bool,
}

/// Computes a gain and an offset for each of `images`; `reference` keeps its values.
///
/// # Errors
/// [`BalanceError`] for pairs of unknown images and for equations without a solution.
///
/// ```
/// use ortho::{Pair, balance};
///
/// let values = (0..2000).map(|i| (i as f32, 2.0 * i as f32)).collect();
/// let found = balance(2, 0, &[Pair { images: (0, 1), values }])?;
/// assert!((found[1].apply(100.0) - 50.0).abs() < 0.5);
/// # Ok::<(), ortho::BalanceError>(())
/// ```
pub fn balance(images: usize, reference: usize, pairs: &[Pair]) -> Result<Vec<Balance>, BalanceError> {
    let named = pairs.iter().flat_map(|p| [p.images.0, p.images.1]).chain([reference]);
    if let Some(image) = named.into_iter().find(|&image| image >= images) {
        return Err(Reason::Image { image, images }.into());
    }
    let relations: Vec<Relation> = pairs.iter().filter_map(Relation::of).collect();
    let gains = relations.iter().filter(|r| r.alike).map(|r| (r.images, (r.spread.1 / r.spread.0).ln(), r.weight));
    let gains: Vec<f64> = solve(images, reference, gains)?.iter().map(|g| g.exp()).collect();
    let offsets = relations.iter().map(|r| {
        let (i, j) = r.images;
        (r.images, gains[j] * r.median.1 - gains[i] * r.median.0, r.weight)
    });
    let offsets = solve(images, reference, offsets)?;
    Ok(gains.into_iter().zip(offsets).map(|(gain, offset)| Balance { gain, offset }).collect())
}

/// x with x_i − x_j = d for pairs (i, j) with weights, and x = 0 for the reference.
fn solve(
    images: usize,
    reference: usize,
    differences: impl Iterator<Item = ((usize, usize), f64, f64)>,
) -> Result<Vec<f64>, Reason> {
    let (mut normal, mut right) = (DMatrix::<f64>::zeros(images, images), DVector::<f64>::zeros(images));
    let mut total = 0.0;
    for ((i, j), d, weight) in differences {
        normal[(i, i)] += weight;
        normal[(j, j)] += weight;
        normal[(i, j)] -= weight;
        normal[(j, i)] -= weight;
        right[i] += weight * d;
        right[j] -= weight * d;
        total += weight;
    }
    let scale = if total > 0.0 { total } else { 1.0 };
    for k in 0..images {
        normal[(k, k)] += scale * if k == reference { 1e3 } else { RIDGE };
    }
    let solution = normal.cholesky().ok_or(Reason::Unsolvable { images })?.solve(&right);
    let shift = solution[reference];
    let isolated = |k: usize| right[k] == 0.0 && k != reference && solution[k].abs() < f64::MIN_POSITIVE;
    Ok((0..images).map(|k| if isolated(k) { 0.0 } else { solution[k] - shift }).collect())
}

impl Relation {
    fn of(pair: &Pair) -> Option<Self> {
        let finite = |v: &&(f32, f32)| v.0.is_finite() && v.1.is_finite();
        let mut kept: Vec<(f64, f64)> = pair.values.iter().filter(finite).map(|v| (v.0.into(), v.1.into())).collect();
        let mut found = moments(&kept)?;
        for _ in 0..ROUNDS {
            let (median, spread) = found;
            let gain = if spread.0 > 0.0 && spread.1 > 0.0 { spread.1 / spread.0 } else { 1.0 };
            let residual = |v: &(f64, f64)| (v.1 - median.1) - gain * (v.0 - median.0);
            let mut sizes: Vec<f64> = kept.iter().map(|v| residual(v).abs()).collect();
            let limit = CUT * SIGMA_PER_MAD * upper_median(&mut sizes).unwrap_or(f64::NAN);
            if limit > 0.0 {
                kept.retain(|v| residual(v).abs() <= limit);
            }
            found = moments(&kept)?;
        }
        let (median, spread) = found;
        let correlation = correlation(&kept);
        let alike = spread.0 > 0.0 && spread.1 > 0.0 && correlation >= ALIKE;
        let weight = kept.len() as f64 * correlation.max(0.1).powi(2);
        Some(Self { images: pair.images, median, spread, weight, alike })
    }
}

/// Medians and standard deviations of both sides; `None` for too few.
fn moments(values: &[(f64, f64)]) -> Option<((f64, f64), (f64, f64))> {
    if values.len() < LEAST {
        return None;
    }
    let side = |pick: fn(&(f64, f64)) -> f64| {
        let mut own: Vec<f64> = values.iter().map(pick).collect();
        let mean = own.iter().sum::<f64>() / own.len() as f64;
        let variance = own.iter().map(|v| (v - mean).powi(2)).sum::<f64>() / own.len() as f64;
        (upper_median(&mut own).unwrap_or(f64::NAN), variance.sqrt())
    };
    let ((a, s), (b, t)) = (side(|v| v.0), side(|v| v.1));
    Some(((a, b), (s, t)))
}

fn correlation(values: &[(f64, f64)]) -> f64 {
    let n = values.len() as f64;
    let (a, b) = values.iter().fold((0.0, 0.0), |(a, b), v| (a + v.0 / n, b + v.1 / n));
    let (mut ab, mut aa, mut bb) = (0.0, 0.0, 0.0);
    for v in values {
        let (x, y) = (v.0 - a, v.1 - b);
        (ab, aa, bb) = (ab + x * y, aa + x * x, bb + y * y);
    }
    if aa > 0.0 && bb > 0.0 { ab / (aa * bb).sqrt() } else { 0.0 }
}

#[cfg(test)]
mod tests {
    use super::*;

    /// A texture without a pattern that repeats.
    fn texture(k: usize) -> f32 {
        let x = k as f32;
        400.0 + 90.0 * (0.37 * x).sin() + 60.0 * (1.93 * x).cos() + 40.0 * (0.011 * x).sin()
    }

    #[test]
    fn planted_gains_and_offsets_are_found_under_outliers_and_over_chains() {
        let planted = [(1.0, 0.0), (0.8, 35.0), (1.3, -60.0), (1.1, 12.0)];
        let seen = |image: usize, k: usize| (texture(k) - planted[image].1) / planted[image].0;
        let pair = |i: usize, j: usize| {
            let values = (0..3000).map(|k| {
                // A third of the cells has something else in the second image.
                let other = if k % 3 == 0 { 900.0 - texture(7 * k + 3) } else { seen(j, k) };
                (seen(i, k), other)
            });
            Pair { images: (i, j), values: values.collect() }
        };
        // Image 3 meets the reference only through 2.
        let found = balance(5, 0, &[pair(0, 1), pair(1, 2), pair(0, 2), pair(2, 3)]).unwrap();
        for (k, (gain, offset)) in planted.iter().enumerate() {
            for v in [250.0_f32, 400.0, 550.0] {
                let expected = gain * v + offset;
                assert!((found[k].apply(v) - expected).abs() < 4.0, "{k}: {:?}, planted {gain} {offset}", found[k]);
            }
        }
        assert_eq!((found[0], found[4]), (Balance::NONE, Balance::NONE));
    }

    #[test]
    fn what_says_nothing_changes_nothing() {
        let few = Pair { images: (0, 1), values: vec![(1.0, 2.0); 10] };
        assert_eq!(balance(2, 0, &[few]).unwrap(), [Balance::NONE; 2]);
        let flat = Pair { images: (0, 1), values: vec![(100.0, 120.0); 100] };
        let found = balance(2, 0, &[flat]).unwrap()[1];
        assert!(found.gain == 1.0 && (found.offset + 20.0).abs() < 1e-6, "{found:?}");
        assert!(balance(1, 0, &[Pair { images: (0, 1), values: Vec::new() }]).is_err());
    }
}
