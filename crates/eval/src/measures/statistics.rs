//! Statistics of a set of height errors, in metres.
//!
//! Percentiles are NumPy's `linear` ones ([`numeric::percentile`]). The standard deviation is that
//! of the population (divided by n). NMAD = 1.4826 · median of |e − median(e)| (Höhle and Höhle
//! 2009, ISPRS J. 64, 398-406) equals the standard deviation for normal errors. LE*p* is the p-th
//! percentile of |e|, without any assumption about the distribution.
//!
//! The robust statistics leave out errors farther than [`OUTLIER_NMADS`] NMADs from the median.
//! This is the three-sigma rule of Höhle and Höhle with robust estimates of both parameters.

use numeric::{NMAD_FACTOR, percentile};
use serde::Serialize;

/// Distance from the median, in NMADs, beyond which an error is an outlier.
pub const OUTLIER_NMADS: f64 = 3.0;

/// Summary of errors (test − reference), in metres.
#[derive(Debug, Clone, Copy, PartialEq, Serialize)]
pub struct ErrorStatistics {
    /// Mean error, the bias.
    pub mean: f64,
    /// Median error.
    pub median: f64,
    /// Mean absolute error.
    pub mae: f64,
    /// Root mean square error.
    pub rmse: f64,
    /// Standard deviation of the population.
    pub std: f64,
    /// Normalised median absolute deviation: 1.4826 times the median of |e − median|.
    pub nmad: f64,
    /// 68th percentile of |e|.
    pub le68: f64,
    /// 90th percentile of |e|.
    pub le90: f64,
    /// 95th percentile of |e|.
    pub le95: f64,
    /// Lowest error.
    pub min: f64,
    /// Highest error.
    pub max: f64,
}

impl ErrorStatistics {
    /// Computes the summary of finite errors, or `None` if there are none. The order of the errors
    /// is lost.
    ///
    /// ```
    /// let found = eval::ErrorStatistics::of(&mut [0.5, -0.5, 1.5]).unwrap();
    /// assert_eq!((found.mean, found.median, found.max), (0.5, 0.5, 1.5));
    /// ```
    pub fn of(errors: &mut [f64]) -> Option<Self> {
        if errors.is_empty() {
            return None;
        }
        let n = errors.len() as f64;
        let mean = errors.iter().sum::<f64>() / n;
        let mae = errors.iter().map(|e| e.abs()).sum::<f64>() / n;
        let rmse = (errors.iter().map(|e| e * e).sum::<f64>() / n).sqrt();
        let std = (errors.iter().map(|e| (e - mean).powi(2)).sum::<f64>() / n).sqrt();
        let (min, max) = errors.iter().fold((f64::INFINITY, f64::NEG_INFINITY), |(lo, hi), &e| (lo.min(e), hi.max(e)));
        let median = percentile(errors, 50.0)?;
        let mut absolute: Vec<f64> = errors.iter().map(|e| (e - median).abs()).collect();
        let nmad = NMAD_FACTOR * percentile(&mut absolute, 50.0)?;
        absolute.iter_mut().zip(errors.iter()).for_each(|(a, e)| *a = e.abs());
        let mut le = |p| percentile(&mut absolute, p);
        Some(Self { mean, median, mae, rmse, std, nmad, le68: le(68.0)?, le90: le(90.0)?, le95: le(95.0)?, min, max })
    }

    /// Names of the statistics, in the order of [`values`](Self::values).
    pub const NAMES: [&'static str; 11] =
        ["mean", "median", "mae", "rmse", "std", "nmad", "le68", "le90", "le95", "min", "max"];

    /// Returns the statistics in the order of [`NAMES`](Self::NAMES).
    pub fn values(&self) -> [f64; 11] {
        let s = self;
        [s.mean, s.median, s.mae, s.rmse, s.std, s.nmad, s.le68, s.le90, s.le95, s.min, s.max]
    }
}

/// Summary of errors without the outliers, in metres.
#[derive(Debug, Clone, Copy, PartialEq, Serialize)]
pub struct RobustStatistics {
    /// Number of errors farther than [`OUTLIER_NMADS`] NMADs from the median.
    pub outliers: usize,
    /// Mean of the other errors.
    pub mean: f64,
    /// Mean absolute error of the others.
    pub mae: f64,
    /// Root mean square of the others.
    pub rmse: f64,
    /// Standard deviation of the others, as a population.
    pub std: f64,
}

impl RobustStatistics {
    /// Computes the summary of `errors` without their outliers. `all` holds the statistics of the
    /// same errors.
    pub fn of(errors: &[f64], all: &ErrorStatistics) -> Self {
        let kept = || errors.iter().filter(|&e| (e - all.median).abs() <= OUTLIER_NMADS * all.nmad);
        let (mut count, mut sum, mut absolute, mut square) = (0usize, 0.0, 0.0, 0.0);
        for e in kept() {
            count += 1;
            sum += e;
            absolute += e.abs();
            square += e * e;
        }
        // At least half of the errors lie within one MAD of the median, so some are kept.
        let n = count.max(1) as f64;
        let mean = sum / n;
        let std = (kept().map(|e| (e - mean).powi(2)).sum::<f64>() / n).sqrt();
        Self { outliers: errors.len() - count, mean, mae: absolute / n, rmse: (square / n).sqrt(), std }
    }

    /// Names of the statistics, in the order of [`values`](Self::values).
    pub const NAMES: [&'static str; 5] = ["outliers", "robust_mean", "robust_mae", "robust_rmse", "robust_std"];

    /// Returns the statistics in the order of [`NAMES`](Self::NAMES).
    pub fn values(&self) -> [f64; 5] {
        [self.outliers as f64, self.mean, self.mae, self.rmse, self.std]
    }
}

#[cfg(test)]
mod tests {
    use super::*;
    use numeric::upper_nmad;
    use proptest::prelude::*;

    #[test]
    fn nothing_has_no_statistics() {
        assert_eq!(ErrorStatistics::of(&mut []), None);
    }

    #[test]
    fn outliers_are_left_out_of_the_robust_statistics_and_only_there() {
        let mut errors = vec![-0.2, -0.1, 0.0, 0.1, 0.2, 40.0];
        let all = ErrorStatistics::of(&mut errors).unwrap();
        let robust = RobustStatistics::of(&errors, &all);
        assert_eq!(robust.outliers, 1);
        assert!(robust.mean.abs() < 1e-12 && (robust.mae - 0.12).abs() < 1e-12, "{robust:?}");
        assert!(all.mae > 6.0);
        let mut equal = vec![0.5; 9];
        let all = ErrorStatistics::of(&mut equal).unwrap();
        assert_eq!(RobustStatistics::of(&equal, &all).outliers, 0);
    }

    proptest! {
        #[test]
        fn a_constant_moves_the_bias_and_leaves_the_spread(
            mut errors in prop::collection::vec(-50.0..50.0f64, 1..200), constant in -20.0..20.0f64,
        ) {
            let mut moved: Vec<f64> = errors.iter().map(|e| e + constant).collect();
            let (a, b) = (ErrorStatistics::of(&mut errors).unwrap(), ErrorStatistics::of(&mut moved).unwrap());
            prop_assert!((b.mean - a.mean - constant).abs() < 1e-9);
            prop_assert!((b.median - a.median - constant).abs() < 1e-9);
            prop_assert!((b.std - a.std).abs() < 1e-6);
            prop_assert!((b.nmad - a.nmad).abs() < 1e-9);
        }

        #[test]
        fn the_statistics_are_ordered(mut errors in prop::collection::vec(-50.0..50.0f64, 1..200)) {
            let s = ErrorStatistics::of(&mut errors).unwrap();
            prop_assert!(s.min <= s.median && s.median <= s.max);
            prop_assert!(s.mae <= s.rmse + 1e-12 && s.std <= s.rmse + 1e-12);
            prop_assert!(s.le68 <= s.le90 && s.le90 <= s.le95 && s.le95 <= s.max.abs().max(s.min.abs()));
        }

        #[test]
        fn the_upper_nmad_is_the_nmad_for_odd_counts(
            half in prop::collection::vec(-50.0..50.0f32, 0..100), one in -1.0..1.0f32,
        ) {
            let mut values: Vec<f32> = half.iter().chain(&half).copied().chain([one]).collect();
            let mut wide: Vec<f64> = values.iter().map(|&v| f64::from(v)).collect();
            let expected = ErrorStatistics::of(&mut wide).unwrap().nmad;
            prop_assert!((upper_nmad(&mut values).unwrap() - expected).abs() < 1e-4);
        }
    }
}
