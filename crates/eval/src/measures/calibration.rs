//! Whether the stated uncertainty of a surface is true: its standard deviation and its confidence.
//!
//! For normal errors, 68.3 % of the absolute errors are below the stated standard deviation σ and
//! 95.4 % below 2 σ. A confidence promises the probability that a height is right, which means an
//! absolute error below a stated threshold. The reliability table puts the cells of each tenth of
//! the confidence beside the share of them that is right.

use numeric::percentile;
use raster::Grid;
use serde::Serialize;

use crate::measures::origin::CellOrigin;

/// Number of bins of the reliability table.
const TENTHS: usize = 10;

/// Stated standard deviations against errors, over one set of cells.
#[derive(Debug, Clone, Copy, PartialEq, Serialize)]
pub struct SigmaCalibration {
    /// Number of cells with an error and a positive standard deviation.
    pub n: usize,
    /// Share of the absolute errors below one standard deviation, 0 to 1.
    pub below_1_sigma: f64,
    /// Share of the absolute errors below two standard deviations, 0 to 1.
    pub below_2_sigma: f64,
    /// Median of |error| / σ. It is 0.674 for normal errors with the stated σ.
    pub median_ratio: f64,
    /// Median of the stated standard deviations, metres.
    pub median_sigma_m: f64,
}

/// Calibration of the standard deviation of observed and of filled cells. All cells count as
/// observed if the origin of the heights is not known.
#[derive(Debug, Clone, Copy, PartialEq, Serialize)]
pub struct SigmaReport {
    /// The observed cells. `None` if none has a standard deviation.
    pub observed: Option<SigmaCalibration>,
    /// The filled cells. `None` if none has a standard deviation.
    pub filled: Option<SigmaCalibration>,
}

/// One row of the reliability table: cells with a confidence between two bounds.
#[derive(Debug, Clone, Copy, PartialEq, Serialize)]
pub struct ReliabilityRow {
    /// Lower bound of the confidence, inclusive.
    pub from: f64,
    /// Upper bound of the confidence, exclusive except for the last row.
    pub to: f64,
    /// Number of cells.
    pub n: usize,
    /// Mean confidence of the cells: the promised share. `None` without cells.
    pub promised: Option<f64>,
    /// Share of the cells that is right. `None` without cells.
    pub right: Option<f64>,
}

/// Reliability of the confidence.
#[derive(Debug, Clone, PartialEq, Serialize)]
pub struct Reliability {
    /// Absolute error below which a height is right, metres.
    pub right_below_m: f64,
    /// One row per tenth of the confidence, from 0 to 1.
    pub tenths: Vec<ReliabilityRow>,
    /// Number of compared cells whose confidence is not a number from 0 to 1.
    pub outside: usize,
}

/// Compares standard deviations with errors. All grids are on the reference grid.
pub(crate) fn sigma_report(errors: &Grid<f64>, sigma_m: &Grid<f32>, origins: Option<&Grid<CellOrigin>>) -> SigmaReport {
    let of = |origin: CellOrigin| {
        let cells = errors.data().iter().zip(sigma_m.data()).enumerate();
        let cells = cells.filter(|(i, _)| {
            origins.map_or(CellOrigin::Observed, |o| o.data().get(*i).copied().unwrap_or(CellOrigin::Void)) == origin
        });
        let cells = cells.map(|(_, (error, sigma))| (error.abs(), f64::from(*sigma)));
        calibration(cells.filter(|(error, sigma)| error.is_finite() && sigma.is_finite() && *sigma > 0.0).collect())
    };
    SigmaReport { observed: of(CellOrigin::Observed), filled: of(CellOrigin::Filled) }
}

/// Computes the calibration of pairs of an absolute error and a positive standard deviation.
fn calibration(cells: Vec<(f64, f64)>) -> Option<SigmaCalibration> {
    let n = cells.len();
    let below = |times: f64| cells.iter().filter(|(error, sigma)| *error < times * sigma).count() as f64 / n as f64;
    let (below_1_sigma, below_2_sigma) = (below(1.0), below(2.0));
    let mut ratios: Vec<f64> = cells.iter().map(|(error, sigma)| error / sigma).collect();
    let mut sigmas: Vec<f64> = cells.iter().map(|(_, sigma)| *sigma).collect();
    let (median_ratio, median_sigma_m) = (percentile(&mut ratios, 50.0)?, percentile(&mut sigmas, 50.0)?);
    Some(SigmaCalibration { n, below_1_sigma, below_2_sigma, median_ratio, median_sigma_m })
}

/// Compares confidences with the share of right heights. Both grids are on the reference grid.
pub(crate) fn reliability(errors: &Grid<f64>, confidence: &Grid<f32>, right_below_m: f64) -> Reliability {
    let mut bins = [(0usize, 0.0f64, 0usize); TENTHS];
    let mut outside = 0;
    for (error, confidence) in errors.data().iter().zip(confidence.data()).filter(|(error, _)| error.is_finite()) {
        if !(0.0..=1.0).contains(confidence) {
            outside += 1;
            continue;
        }
        // The product is rounded to single precision, so that 0.3 falls into the bin from 0.3 on.
        let bin = &mut bins[((confidence * TENTHS as f32) as usize).min(TENTHS - 1)];
        *bin = (bin.0 + 1, bin.1 + f64::from(*confidence), bin.2 + usize::from(error.abs() < right_below_m));
    }
    let row = |(k, (n, sum, right)): (usize, (usize, f64, usize))| ReliabilityRow {
        from: k as f64 / TENTHS as f64,
        to: (k + 1) as f64 / TENTHS as f64,
        n,
        promised: (n > 0).then(|| sum / n as f64),
        right: (n > 0).then(|| right as f64 / n as f64),
    };
    Reliability { right_below_m, tenths: bins.into_iter().enumerate().map(row).collect(), outside }
}

#[cfg(test)]
mod tests {
    use super::*;
    use numeric::SplitMix64;

    #[test]
    fn normal_errors_with_their_own_sigma_are_calibrated() {
        let mut stream = SplitMix64::new(5);
        let sigmas: Vec<f32> = (0..40_000).map(|i| 0.1 + 0.01 * (i % 50) as f32).collect();
        let errors: Vec<f64> = sigmas.iter().map(|sigma| f64::from(*sigma) * stream.normal()).collect();
        let (errors, sigma) = (Grid::from_vec(200, 200, errors).unwrap(), Grid::from_vec(200, 200, sigmas).unwrap());
        let report = sigma_report(&errors, &sigma, None);
        let found = report.observed.unwrap();
        assert!((found.below_1_sigma - 0.683).abs() < 0.01 && (found.below_2_sigma - 0.954).abs() < 0.01, "{found:?}");
        assert!((found.median_ratio - 0.674).abs() < 0.02 && found.n == 40_000 && report.filled.is_none());
        // A σ of a third of the truth.
        let small = sigma_report(&errors, &sigma.map(|s| s / 3.0), None).observed.unwrap();
        assert!((small.below_1_sigma - 0.261).abs() < 0.01, "{small:?}");
    }

    #[test]
    fn sigma_is_judged_by_origin_and_only_where_it_is_positive() {
        use CellOrigin::{Filled, Observed, Void};
        let errors = Grid::from_vec(6, 1, vec![0.5, 0.5, 9.0, 1.5, f64::NAN, 0.1]).unwrap();
        let sigma = Grid::from_vec(6, 1, vec![1.0, 0.0, 1.0, 1.0, 1.0, f32::NAN]).unwrap();
        let origins = Grid::from_vec(6, 1, vec![Observed, Observed, Filled, Filled, Observed, Void]).unwrap();
        let found = sigma_report(&errors, &sigma, Some(&origins));
        let (observed, filled) = (found.observed.unwrap(), found.filled.unwrap());
        assert_eq!((observed.n, observed.below_1_sigma), (1, 1.0));
        assert_eq!((filled.n, filled.below_1_sigma, filled.below_2_sigma), (2, 0.0, 0.5));
    }

    #[test]
    fn a_confidence_is_held_against_the_share_that_is_right() {
        let errors = Grid::from_vec(7, 1, vec![0.5, 1.5, 0.2, 0.3, f64::NAN, 0.1, 2.0]).unwrap();
        let confidence = Grid::from_vec(7, 1, vec![0.05, 0.08, 1.0, 0.9, 0.5, f32::NAN, 1.2]).unwrap();
        let found = reliability(&errors, &confidence, 1.0);
        assert_eq!((found.tenths.len(), found.outside), (10, 2));
        let (first, last) = (found.tenths[0], found.tenths[9]);
        assert_eq!((first.n, first.right, last.n, last.right), (2, Some(0.5), 2, Some(1.0)));
        assert!((first.promised.unwrap() - 0.065).abs() < 1e-6 && (last.promised.unwrap() - 0.95).abs() < 1e-6);
        assert_eq!((found.tenths[5].n, found.tenths[5].right, found.tenths[5].promised), (0, None, None));
    }
}
