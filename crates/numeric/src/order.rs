//! Order statistics: medians, quantiles and the normalised median absolute deviation (NMAD).
//!
//! Values are compared by `total_cmp`, so the results do not depend on their order. NaN sorts above
//! +∞ (below −∞ with a negative sign): remove it first. Functions that take `&mut [T]` work in
//! linear time and reorder the values.
//!
//! There are several definitions of a median and of a quantile for a finite sample. They differ
//! when the wanted place falls between two values, so each function here names its own:
//!
//! | function | quantile q of n sorted values |
//! |---|---|
//! | [`order_statistic`] | the value at a given rank |
//! | [`upper_median`] | the value at rank ⌊n/2⌋; the greater of the two middle values |
//! | [`middle_values`] | both middle values of sorted ones, for their mean |
//! | [`nearest_quantile`] | the value at the rank nearest to q·(n − 1) |
//! | [`percentile`] | linear interpolation at q·(n − 1), the default of NumPy |
//!
//! Ranks count from 0.

use std::cmp::Ordering;
use std::ops::Sub;

/// Factor that makes the median absolute deviation an estimate of the standard deviation of a
/// normal distribution (Höhle and Höhle 2009, ISPRS J. 64, 398-406): one over the 75th percentile
/// of the standard normal distribution.
pub const NMAD_FACTOR: f64 = 1.4826;

/// A floating-point number that order statistics can be taken of: `f32` or `f64`.
pub trait Float: Copy + Sub<Output = Self> + Into<f64> {
    /// Compares by the total order of IEEE 754.
    fn order(&self, other: &Self) -> Ordering;

    /// Returns the absolute value.
    fn magnitude(self) -> Self;
}

macro_rules! float {
    ($($number:ty),+) => {$(
        impl Float for $number {
            #[inline]
            fn order(&self, other: &Self) -> Ordering {
                self.total_cmp(other)
            }

            #[inline]
            fn magnitude(self) -> Self {
                self.abs()
            }
        }
    )+};
}

float!(f32, f64);

/// Returns the value that sorting would put at `rank`, or `None` if there are not that many values.
///
/// ```
/// assert_eq!(numeric::order_statistic(&mut [4.0, 1.0, 3.0], 1), Some(3.0));
/// ```
#[inline]
pub fn order_statistic<T: Float>(values: &mut [T], rank: usize) -> Option<T> {
    (rank < values.len()).then(|| *values.select_nth_unstable_by(rank, T::order).1)
}

/// Returns the median, for an even count the greater of the two middle values. Returns `None`
/// without values.
///
/// ```
/// assert_eq!(numeric::upper_median(&mut [4.0, 1.0, 3.0, 2.0]), Some(3.0));
/// ```
#[inline]
pub fn upper_median<T: Float>(values: &mut [T]) -> Option<T> {
    order_statistic(values, values.len() / 2)
}

/// Returns the two middle values of a sorted slice, for an odd count the same one twice. Returns
/// `None` without values.
///
/// ```
/// assert_eq!(numeric::middle_values(&[1.0, 2.0, 3.0, 4.0]), Some((&2.0, &3.0)));
/// ```
#[inline]
pub fn middle_values<T>(sorted: &[T]) -> Option<(&T, &T)> {
    let n = sorted.len();
    Some((sorted.get(n.saturating_sub(1) / 2)?, sorted.get(n / 2)?))
}

/// Returns the value whose rank is nearest to `share` · (n − 1), with `share` from 0 to 1. Returns
/// `None` without values.
///
/// ```
/// assert_eq!(numeric::nearest_quantile(&mut [10.0, 30.0, 20.0, 40.0], 0.6), Some(30.0));
/// ```
#[inline]
pub fn nearest_quantile<T: Float>(values: &mut [T], share: f64) -> Option<T> {
    let last = values.len().checked_sub(1)?;
    order_statistic(values, ((share * last as f64).round() as usize).min(last))
}

/// Returns the percentile `p` (0 to 100) by linear interpolation between two values, like
/// `numpy.percentile`. Returns `None` without values.
///
/// ```
/// assert_eq!(numeric::percentile(&mut [4.0, 1.0, 3.0, 2.0], 50.0), Some(2.5));
/// ```
pub fn percentile(values: &mut [f64], p: f64) -> Option<f64> {
    let last = values.len().checked_sub(1)?;
    let at = (p / 100.0).clamp(0.0, 1.0) * last as f64;
    let low = (at.floor() as usize).min(last);
    let (_, &mut below, above) = values.select_nth_unstable_by(low, f64::total_cmp);
    let next = above.iter().copied().min_by(f64::total_cmp).unwrap_or(below);
    Some(below + (at - low as f64) * (next - below))
}

/// Returns [`NMAD_FACTOR`] times the median distance from the median, both by [`upper_median`].
/// Returns `None` without values. The values are replaced by their distances from the median.
///
/// ```
/// let nmad = numeric::upper_nmad(&mut [1.0, 2.0, 3.0, 4.0, 100.0]).unwrap();
/// assert_eq!(nmad, 1.4826);
/// ```
pub fn upper_nmad<T: Float>(values: &mut [T]) -> Option<f64> {
    let median = upper_median(values)?;
    values.iter_mut().for_each(|value| *value = (*value - median).magnitude());
    Some(NMAD_FACTOR * upper_median(values)?.into())
}

#[cfg(test)]
mod tests {
    use super::*;
    use proptest::prelude::*;

    #[test]
    fn percentiles_are_those_of_numpy() {
        // numpy.percentile([4, 1, 3, 2], p)
        for (p, expected) in [(0.0, 1.0), (25.0, 1.75), (50.0, 2.5), (90.0, 3.7), (100.0, 4.0)] {
            let found = percentile(&mut [4.0, 1.0, 3.0, 2.0], p).unwrap();
            assert!((found - expected).abs() < 1e-12, "{p}: {found}");
        }
        // numpy.percentile([3.5, -1.25, 8, 0, 2.75, 8, -4], p)
        for (p, expected) in [(10.0, -2.35), (33.0, -0.025), (68.0, 3.86), (95.0, 8.0)] {
            let found = percentile(&mut [3.5, -1.25, 8.0, 0.0, 2.75, 8.0, -4.0], p).unwrap();
            assert!((found - expected).abs() < 1e-12, "{p}: {found}");
        }
        assert_eq!(percentile(&mut [], 50.0), None);
        assert_eq!(percentile(&mut [5.0], 90.0), Some(5.0));
        assert_eq!(percentile(&mut [1.0, 2.0], 150.0), Some(2.0));
    }

    #[test]
    fn no_values_have_no_statistics() {
        assert_eq!(order_statistic::<f64>(&mut [], 0), None);
        assert_eq!(upper_median::<f32>(&mut []), None);
        assert_eq!(middle_values::<f32>(&[]), None);
        assert_eq!(nearest_quantile::<f32>(&mut [], 0.5), None);
        assert_eq!(upper_nmad::<f64>(&mut []), None);
    }

    #[test]
    fn the_nearest_quantile_rounds_the_rank() {
        let at = |share| nearest_quantile(&mut [3.0f32, 1.0, 2.0, 5.0, 4.0], share).unwrap();
        assert_eq!([0.0, 0.1, 0.125, 0.5, 0.9, 1.0].map(at), [1.0, 1.0, 2.0, 3.0, 5.0, 5.0]);
    }

    proptest! {
        #[test]
        fn order_statistics_are_those_of_sorting(values in prop::collection::vec(-50.0..50.0f64, 1..60)) {
            let (mut own, mut sorted) = (values.clone(), values);
            sorted.sort_by(f64::total_cmp);
            let n = sorted.len();
            for (rank, &expected) in sorted.iter().enumerate() {
                prop_assert_eq!(order_statistic(&mut own, rank), Some(expected));
            }
            prop_assert_eq!(order_statistic(&mut own, n), None);
            prop_assert_eq!(upper_median(&mut own), Some(sorted[n / 2]));
            let (low, high) = middle_values(&sorted).unwrap();
            prop_assert_eq!(percentile(&mut own, 50.0), Some(low + 0.5 * (high - low)));
        }

        #[test]
        fn the_nmad_of_normal_numbers_is_near_their_deviation(seed in 0..50u64) {
            let mut random = crate::SplitMix64::new(seed);
            let mut values: Vec<f64> = (0..20_000).map(|_| 3.0 + 2.0 * random.normal()).collect();
            // The relative standard error of the NMAD is 1.17 / √n, here 0.008.
            prop_assert!((upper_nmad(&mut values).unwrap() - 2.0).abs() < 0.1);
        }
    }
}
