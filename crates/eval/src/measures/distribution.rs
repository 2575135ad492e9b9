//! Distribution of errors, for plots: a histogram around zero, and the number of cells within an
//! error.

use raster::Grid;
use serde::Serialize;

/// Number of bins of a histogram. It is odd, so that one bin is centred on zero.
const BINS: usize = 81;
/// Number of steps of the cumulative curve.
const STEPS: usize = 100;

/// Counts of errors in bins of equal width from −range to +range.
#[derive(Debug, Clone, PartialEq, Serialize)]
pub struct Histogram {
    /// Half of the range that the bins cover, metres.
    pub range_m: f64,
    /// Number of errors per bin, from the most negative.
    pub counts: Vec<usize>,
    /// Number of errors below −range.
    pub below: usize,
    /// Number of errors above +range.
    pub above: usize,
}

/// Number of cells with at most a given error.
#[derive(Debug, Clone, PartialEq, Serialize)]
pub struct Cumulative {
    /// Absolute error, metres, rising from 0.
    pub error_m: Vec<f64>,
    /// Number of cells with at most that error.
    pub cells: Vec<usize>,
}

/// Returns the smallest of 1, 2 and 5 times a power of ten that is not below `value`. Returns 1 for
/// values that are not positive.
///
/// ```
/// assert_eq!(eval::round_up(1.2), 2.0);
/// ```
pub fn round_up(value: f64) -> f64 {
    if !(value.is_finite() && value > 0.0) {
        return 1.0;
    }
    let decade = 10f64.powf(value.log10().floor());
    [1.0, 2.0, 5.0]
        .map(|step| step * decade)
        .into_iter()
        .find(|&step| step >= value * (1.0 - 1e-9))
        .unwrap_or(10.0 * decade)
}

/// Counts the finite errors in bins from −`range_m` to +`range_m`.
pub fn histogram(errors: &Grid<f32>, range_m: f64) -> Histogram {
    let mut found = Histogram { range_m, counts: vec![0; BINS], below: 0, above: 0 };
    let width = 2.0 * range_m / BINS as f64;
    for error in errors.data().iter().map(|&e| f64::from(e)).filter(|e| e.is_finite()) {
        if error < -range_m {
            found.below += 1;
        } else if error > range_m {
            found.above += 1;
        } else if let Some(count) = found.counts.get_mut((((error + range_m) / width) as usize).min(BINS - 1)) {
            *count += 1;
        }
    }
    found
}

/// Counts the finite errors of at most 0 … `range_m` metres, in equal steps.
pub fn cumulative(errors: &Grid<f32>, range_m: f64) -> Cumulative {
    let step = range_m / STEPS as f64;
    let mut cells = vec![0usize; STEPS + 1];
    for error in errors.data().iter().map(|&e| f64::from(e).abs()).filter(|e| e.is_finite()) {
        if let Some(count) = cells.get_mut((error / step).ceil() as usize) {
            *count += 1;
        }
    }
    (1..cells.len()).for_each(|i| cells[i] += cells[i - 1]);
    Cumulative { error_m: (0..=STEPS).map(|i| i as f64 * step).collect(), cells }
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn every_error_is_counted_once() {
        let errors = Grid::from_vec(4, 2, vec![-9.0, -2.0, 0.0, 0.01, 1.99, 2.0, 7.0, f32::NAN]).unwrap();
        let found = histogram(&errors, 2.0);
        assert_eq!((found.below, found.above), (1, 1));
        assert_eq!(found.counts.iter().sum::<usize>(), 5);
        assert_eq!((found.counts[0], found.counts[40], found.counts[80]), (1, 2, 2));
    }

    #[test]
    fn the_cumulative_curve_rises_to_what_is_within_its_range() {
        let errors = Grid::from_vec(3, 2, vec![0.0, -0.5, 0.5, 2.0, 5.0, f32::NAN]).unwrap();
        let found = cumulative(&errors, 2.0);
        assert_eq!((found.cells[0], found.cells[24], found.cells[25], found.cells[100]), (1, 1, 3, 4));
        assert!(found.cells.windows(2).all(|pair| pair[0] <= pair[1]));
    }

    #[test]
    fn ranges_are_round() {
        for (value, expected) in [(0.013, 0.02), (1.0, 1.0), (1.2, 2.0), (2.2, 5.0), (7.0, 10.0), (0.0, 1.0)] {
            assert!((round_up(value) - expected).abs() < 1e-12, "{value}: {}", round_up(value));
        }
        assert_eq!(round_up(f64::NAN), 1.0);
    }
}
