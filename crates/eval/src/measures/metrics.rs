//! Accuracy and completeness over a set of reference cells.
//!
//! The field uses the word completeness for four measures. Three of them are here, with t in
//! metres; [`crate::Standing`] is the fourth:
//! - `completeness_<t>`: share of the reference's valid cells with |error| < t. Voids count as
//!   failures.
//! - `pag_<t>`: share of the cells valid in both with |error| < t.
//! - `valid_ratio`: share of the reference's valid cells with any value.

use crate::measures::statistics::{ErrorStatistics, RobustStatistics};

/// Metrics over one set of cells.
#[derive(Debug, Clone, PartialEq)]
pub struct Metrics {
    /// Number of valid cells of the reference.
    pub reference_cells: usize,
    /// Number of cells valid in both.
    pub n: usize,
    /// Errors over the cells valid in both. `None` if there are no such cells.
    pub errors: Option<ErrorStatistics>,
    /// Errors without the outliers.
    pub robust: Option<RobustStatistics>,
    /// For each threshold in metres, the number of cells with |error| below it.
    pub below: Vec<(f64, usize)>,
}

impl Metrics {
    /// Computes the metrics of finite `errors` (metres) on `reference_cells` valid cells of the
    /// reference. The order of the errors is lost.
    pub fn of(errors: &mut [f64], reference_cells: usize, thresholds_m: &[f64]) -> Self {
        let below = thresholds_m.iter().map(|&t| (t, errors.iter().filter(|e| e.abs() < t).count())).collect();
        let all = ErrorStatistics::of(errors);
        let robust = all.map(|all| RobustStatistics::of(errors, &all));
        Self { reference_cells, n: errors.len(), errors: all, robust, below }
    }

    /// Returns the share of the reference's valid cells with any value, 0 to 1, or `None` without
    /// reference cells.
    pub fn valid_ratio(&self) -> Option<f64> {
        share(self.n, self.reference_cells)
    }

    /// Returns the share of the reference's valid cells with an error below `threshold_m`, or
    /// `None` if it is not one of the thresholds.
    pub fn completeness(&self, threshold_m: f64) -> Option<f64> {
        share(self.count_below(threshold_m)?, self.reference_cells)
    }

    /// Returns the share of the cells valid in both with an error below `threshold_m`, or `None` if
    /// it is not one of the thresholds.
    pub fn pag(&self, threshold_m: f64) -> Option<f64> {
        share(self.count_below(threshold_m)?, self.n)
    }

    /// Returns every metric with its name, in a fixed order. Metrics that cannot be computed are
    /// `None`.
    pub fn named(&self) -> Vec<(String, Option<f64>)> {
        let mut all = vec![
            ("reference_cells".to_owned(), Some(self.reference_cells as f64)),
            ("n".to_owned(), Some(self.n as f64)),
            ("valid_ratio".to_owned(), self.valid_ratio()),
        ];
        let values = self.errors.map(|errors| errors.values());
        let named = ErrorStatistics::NAMES.iter().enumerate();
        all.extend(named.map(|(i, name)| ((*name).to_owned(), values.map(|values| values[i]))));
        let values = self.robust.map(|robust| robust.values());
        let named = RobustStatistics::NAMES.iter().enumerate();
        all.extend(named.map(|(i, name)| ((*name).to_owned(), values.map(|values| values[i]))));
        all.extend(
            self.below.iter().map(|&(t, count)| (format!("completeness_{t}"), share(count, self.reference_cells))),
        );
        all.extend(self.below.iter().map(|&(t, count)| (format!("pag_{t}"), share(count, self.n))));
        all
    }

    fn count_below(&self, threshold_m: f64) -> Option<usize> {
        self.below.iter().find(|(t, _)| *t == threshold_m).map(|&(_, count)| count)
    }
}

fn share(part: usize, whole: usize) -> Option<f64> {
    (whole > 0).then(|| part as f64 / whole as f64)
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn voids_are_failures_of_completeness_and_not_of_pag() {
        let metrics = Metrics::of(&mut [0.5, -0.9, 1.0, -3.0], 8, &[1.0, 2.5]);
        assert_eq!(metrics.completeness(1.0), Some(0.25));
        assert_eq!(metrics.pag(1.0), Some(0.5));
        assert_eq!(metrics.pag(2.5), Some(0.75));
        assert_eq!(metrics.valid_ratio(), Some(0.5));
        assert_eq!(metrics.completeness(7.5), None);
    }

    #[test]
    fn names_are_the_same_with_and_without_cells() {
        let names = |m: &Metrics| m.named().into_iter().map(|(name, _)| name).collect::<Vec<_>>();
        let (full, empty) = (Metrics::of(&mut [1.0], 1, &[0.5, 1.0]), Metrics::of(&mut [], 0, &[0.5, 1.0]));
        assert_eq!(names(&full), names(&empty));
        assert!(names(&full).ends_with(&[
            "completeness_0.5".into(),
            "completeness_1".into(),
            "pag_0.5".into(),
            "pag_1".into()
        ]));
        assert!(empty.named().iter().skip(2).all(|(_, value)| value.is_none()));
    }
}
