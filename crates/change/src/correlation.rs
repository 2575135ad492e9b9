//! Calibration of standardised differences, and the correlation of the errors of cells.
//!
//! The correlation is measured along rows and columns at distances that double, on standardised
//! differences cut at three deviations, so that the changes do not count as correlated errors. In
//! between it is linear in the distance; beyond the largest distance it is 0.

use numeric::{order_statistic, upper_nmad};
use raster::Grid;
use serde::Serialize;

/// Deviations at which a standardised difference is cut.
const CUT: f32 = 3.0;
/// Largest distance over which a correlation is measured, as a share of the shorter side. Beyond a
/// quarter, the mean of the scene itself has been taken from the errors.
const REACH_SHARE: f64 = 0.25;
/// Share of the differences within the quantile that calibrates. The tenth beyond it may be
/// changes.
const QUANTILE: f64 = 0.9;
/// Deviations of a normal distribution within which that share lies.
const NORMAL: f64 = 1.644_854;
/// Intervals of the numerical integral over pairs of cells.
const INTERVALS: usize = 400;

/// How alike the errors of two cells are, by their distance.
#[derive(Debug, Clone, PartialEq, Serialize)]
#[non_exhaustive]
pub struct ErrorCorrelation {
    /// Distances, metres, from 0 upwards.
    pub distance_m: Vec<f64>,
    /// Correlation at each distance, 0 to 1.
    pub correlation: Vec<f64>,
    /// Area of a cell, square metres.
    pub cell_area_m2: f64,
}

/// Returns the factor on the standard deviations that gives the standardised differences a spread
/// of 1. The larger of two estimates counts: from the median, and from the quantile within which
/// nine tenths of a normal distribution lie, so that heavy tails are not taken for change.
pub(crate) fn spread(standardised: &Grid<f32>) -> f64 {
    let values: Vec<f32> = standardised.data().iter().copied().filter(|z| z.is_finite()).collect();
    let by_median = upper_nmad(&mut values.clone()).unwrap_or(1.0);
    let mut sizes: Vec<f32> = values.iter().map(|z| z.abs()).collect();
    let rank = (QUANTILE * sizes.len().saturating_sub(1) as f64) as usize;
    let by_quantile = order_statistic(&mut sizes, rank).map_or(1.0, |size| f64::from(size) / NORMAL);
    by_median.max(by_quantile)
}

impl ErrorCorrelation {
    /// Measures the correlation of standardised differences with a spread of 1; NaN cells do not
    /// count.
    pub(crate) fn measure(standardised: &Grid<f32>, cell_m: f64) -> Self {
        let cut = standardised.map(|z| z.clamp(-CUT, CUT));
        let (width, height) = (cut.width(), cut.height());
        let known: Vec<f64> = cut.data().iter().filter(|z| z.is_finite()).map(|z| f64::from(*z)).collect();
        let count = known.len().max(1) as f64;
        let mean = known.iter().sum::<f64>() / count;
        let variance = known.iter().map(|z| (z - mean).powi(2)).sum::<f64>() / count;
        let furthest = ((width.min(height) as f64 * REACH_SHARE) as usize).max(1);
        let (mut distance_m, mut correlation) = (vec![0.0], vec![1.0]);
        let mut lag = 1;
        while lag <= furthest && variance > 0.0 {
            let (mut sum, mut pairs) = (0.0, 0usize);
            let mut add = |a: f32, b: f32| {
                if a.is_finite() && b.is_finite() {
                    sum += (f64::from(a) - mean) * (f64::from(b) - mean);
                    pairs += 1;
                }
            };
            for row in 0..height {
                let here = cut.row(row);
                here.iter().zip(here.iter().skip(lag)).for_each(|(a, b)| add(*a, *b));
                if row + lag < height {
                    here.iter().zip(cut.row(row + lag)).for_each(|(a, b)| add(*a, *b));
                }
            }
            distance_m.push(lag as f64 * cell_m);
            correlation.push((sum / pairs.max(1) as f64 / variance).clamp(0.0, 1.0));
            lag *= 2;
        }
        distance_m.push(lag as f64 * cell_m);
        correlation.push(0.0);
        Self { distance_m, correlation, cell_area_m2: cell_m * cell_m }
    }

    /// Returns the correlation of two cells at a distance.
    pub fn at(&self, distance_m: f64) -> f64 {
        let after = self.distance_m.partition_point(|d| *d <= distance_m);
        let (Some(&d0), Some(&c0)) = (self.distance_m.get(after.max(1) - 1), self.correlation.get(after.max(1) - 1))
        else {
            return 0.0;
        };
        match (self.distance_m.get(after), self.correlation.get(after)) {
            (Some(&d1), Some(&c1)) => c0 + (c1 - c0) * (distance_m - d0) / (d1 - d0),
            _ => 0.0,
        }
    }

    /// Returns the number of cells with independent errors whose mean is as certain as that of
    /// `area_m2`.
    ///
    /// The mean correlation of all pairs of cells is that of a disc of this area. No shape of the
    /// same area has its cells closer together, so the count is rather too low.
    pub fn effective_cells(&self, area_m2: f64) -> f64 {
        let cells = (area_m2 / self.cell_area_m2).max(1.0);
        let radius = (area_m2.max(self.cell_area_m2) / std::f64::consts::PI).sqrt();
        // Density of the distance of two random points of a disc.
        let density = |s: f64| {
            let u = (s / (2.0 * radius)).min(1.0);
            4.0 * s / (std::f64::consts::PI * radius * radius) * (u.acos() - u * (1.0 - u * u).sqrt())
        };
        let step = 2.0 * radius / INTERVALS as f64;
        let middle = |k: usize| (k as f64 + 0.5) * step;
        // Two cells are at least a cell apart; a cell with itself is the other term.
        let apart = |k: usize| middle(k).max(self.cell_area_m2.sqrt());
        let of_pairs: f64 = (0..INTERVALS).map(|k| density(middle(k)) * self.at(apart(k)) * step).sum();
        let mean = 1.0 / cells + (1.0 - 1.0 / cells) * of_pairs;
        (1.0 / mean).clamp(1.0, cells)
    }
}

#[cfg(test)]
mod tests {
    use super::*;
    use numeric::SplitMix64;

    /// White noise averaged over squares of `side` cells, with a spread of 1.
    fn noise(side: usize, seed: u64) -> Grid<f32> {
        let (size, wide) = (256, 256 + side);
        let mut stream = SplitMix64::new(seed);
        let white: Vec<f64> = (0..wide * wide).map(|_| stream.normal()).collect();
        let white = |x: usize, y: usize| white[y * wide + x];
        let cell = |i: usize| {
            let (x, y) = (i % size, i / size);
            let sum: f64 = (0..side * side).map(|k| white(x + k % side, y + k / side)).sum();
            (sum / side as f64) as f32
        };
        Grid::from_vec(size, size, (0..size * size).map(cell).collect()).unwrap()
    }

    #[test]
    fn the_deviation_of_means_is_that_of_many_means() {
        for side in [1, 4] {
            let field = noise(side, 3);
            assert!((spread(&field) - 1.0).abs() < 0.05, "{}", spread(&field));
            let found = ErrorCorrelation::measure(&field, 0.5);
            for block in [4, 16] {
                let mean = |x: usize, y: usize| {
                    let cells = (0..block * block).map(|k| f64::from(field[(x + k % block, y + k / block)]));
                    cells.sum::<f64>() / (block * block) as f64
                };
                let places = (0..256 / block).flat_map(|y| (0..256 / block).map(move |x| (x * block, y * block)));
                let squares: Vec<f64> = places.map(|(x, y)| mean(x, y).powi(2)).collect();
                let truth = (squares.iter().sum::<f64>() / squares.len() as f64).sqrt();
                let stated = 1.0 / found.effective_cells((block * block) as f64 * 0.25).sqrt();
                let ratio = stated / truth;
                assert!((0.85..1.45).contains(&ratio), "side {side}, block {block}: {stated} for {truth}");
            }
        }
    }
}
