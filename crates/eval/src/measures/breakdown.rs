//! The metrics for parts of the reference's cells: classes, slopes, edges and the most confident
//! cells.

use crate::measures::metrics::Metrics;
use raster::Grid;
use std::collections::BTreeMap;

/// Bounds of the slope bins, degrees. A bin includes its lower bound.
pub const SLOPE_BOUNDS_DEG: [f64; 8] = [0.0, 5.0, 10.0, 20.0, 30.0, 45.0, 60.0, 90.0];

/// Metrics of one class.
#[derive(Debug, Clone, PartialEq)]
pub struct ClassMetrics {
    /// Class number.
    pub class: i32,
    /// Metrics over its cells.
    pub metrics: Metrics,
}

/// Metrics of the cells whose slope in the reference is between two bounds.
#[derive(Debug, Clone, PartialEq)]
pub struct SlopeMetrics {
    /// Lower bound, degrees, inclusive.
    pub from_deg: f64,
    /// Upper bound, degrees, exclusive except for the last bin.
    pub to_deg: f64,
    /// Metrics over the cells.
    pub metrics: Metrics,
}

/// Metrics near and away from height jumps.
#[derive(Debug, Clone, PartialEq)]
pub struct EdgeMetrics {
    /// Metrics within the edge zone.
    pub edge: Metrics,
    /// Metrics everywhere else.
    pub rest: Metrics,
}

/// Shares of the reference's cells for which the most confident cells of the test are kept.
pub const COVERAGES: [f64; 10] = [0.95, 0.9, 0.85, 0.8, 0.75, 0.7, 0.65, 0.6, 0.55, 0.5];

/// Metrics of the most confident cells of the test.
#[derive(Debug, Clone, PartialEq)]
pub struct CoverageMetrics {
    /// Share of the reference's valid cells that is kept.
    pub coverage: f64,
    /// Lowest confidence among the kept cells.
    pub confidence: f64,
    /// Metrics over the kept cells. The other cells count as voids.
    pub metrics: Metrics,
}

/// Reference, errors on the same grid, and the thresholds for counting errors.
#[derive(Clone, Copy)]
pub(crate) struct Cells<'a> {
    pub(crate) reference: &'a Grid<f32>,
    pub(crate) errors: &'a Grid<f64>,
    pub(crate) thresholds_m: &'a [f64],
}

impl Cells<'_> {
    /// Returns the metrics of the cells of each key. Cells without a key are left out.
    fn by<K: Ord>(&self, key: impl Fn(usize) -> Option<K>) -> BTreeMap<K, Metrics> {
        let mut cells: BTreeMap<K, (usize, Vec<f64>)> = BTreeMap::new();
        for (i, (height, error)) in self.reference.data().iter().zip(self.errors.data()).enumerate() {
            if let (true, Some(key)) = (height.is_finite(), key(i)) {
                let (count, errors) = cells.entry(key).or_default();
                *count += 1;
                errors.extend(error.is_finite().then_some(error));
            }
        }
        let metrics = |(key, (count, mut errors)): (K, (usize, Vec<f64>))| {
            (key, Metrics::of(&mut errors, count, self.thresholds_m))
        };
        cells.into_iter().map(metrics).collect()
    }

    /// Returns the metrics of all cells.
    pub(crate) fn overall(&self) -> Metrics {
        self.by(|_| Some(())).remove(&()).unwrap_or_else(|| Metrics::of(&mut [], 0, self.thresholds_m))
    }

    pub(crate) fn per_class(&self, classes: Option<&Grid<Option<i32>>>) -> Vec<ClassMetrics> {
        let by_class = self.by(|i| classes.and_then(|classes| *classes.data().get(i)?));
        by_class.into_iter().map(|(class, metrics)| ClassMetrics { class, metrics }).collect()
    }

    /// Returns one entry for each of [`COVERAGES`] that the test reaches.
    pub(crate) fn per_coverage(&self, confidence: &Grid<f32>) -> Vec<CoverageMetrics> {
        let reference_cells = self.reference.data().iter().filter(|h| h.is_finite()).count();
        let cells = self.errors.data().iter().zip(confidence.data());
        let mut known: Vec<(f32, f64)> = cells
            .filter(|(error, _)| error.is_finite())
            .map(|(error, confidence)| (if confidence.is_nan() { f32::NEG_INFINITY } else { *confidence }, *error))
            .collect();
        // The sort is stable: cells of equal confidence keep the order of the rows, whatever their
        // errors.
        known.sort_by(|a, b| b.0.total_cmp(&a.0));
        let of = |coverage: f64| {
            let count = (coverage * reference_cells as f64).round() as usize;
            let kept = known.get(..count).filter(|kept| !kept.is_empty())?;
            let confidence = f64::from(kept.last()?.0);
            let mut errors: Vec<f64> = kept.iter().map(|(_, error)| *error).collect();
            let metrics = Metrics::of(&mut errors, reference_cells, self.thresholds_m);
            Some(CoverageMetrics { coverage, confidence, metrics })
        };
        COVERAGES.into_iter().filter_map(of).collect()
    }

    /// Returns one entry per bin. Empty bins are included, so that tables of different scenes have
    /// the same rows.
    pub(crate) fn per_slope(&self, slopes_deg: &Grid<f32>) -> Vec<SlopeMetrics> {
        let bins = SLOPE_BOUNDS_DEG.len() - 1;
        let bin = |i: usize| {
            let slope = f64::from(*slopes_deg.data().get(i)?);
            slope.is_finite().then(|| SLOPE_BOUNDS_DEG.partition_point(|&bound| bound <= slope).clamp(1, bins) - 1)
        };
        let mut by_bin = self.by(bin);
        let metrics = |i: usize| by_bin.remove(&i).unwrap_or_else(|| Metrics::of(&mut [], 0, self.thresholds_m));
        let bounds = SLOPE_BOUNDS_DEG.windows(2).map(|pair| (pair[0], pair[1]));
        let all: Vec<Metrics> = (0..bins).map(metrics).collect();
        bounds.zip(all).map(|((from_deg, to_deg), metrics)| SlopeMetrics { from_deg, to_deg, metrics }).collect()
    }

    pub(crate) fn at_edges(&self, zone: &Grid<bool>) -> EdgeMetrics {
        let mut both = self.by(|i| zone.data().get(i).copied());
        let mut metrics = |edge| both.remove(&edge).unwrap_or_else(|| Metrics::of(&mut [], 0, self.thresholds_m));
        EdgeMetrics { edge: metrics(true), rest: metrics(false) }
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn every_cell_falls_into_the_bin_that_holds_its_slope() {
        let reference = Grid::filled(5, 1, 1.0f32);
        let errors = Grid::from_vec(5, 1, vec![0.1, 0.2, 0.3, f64::NAN, 0.5]).unwrap();
        let slopes = Grid::from_vec(5, 1, vec![0.0, 4.99, 5.0, 90.0, f32::NAN]).unwrap();
        let cells = Cells { reference: &reference, errors: &errors, thresholds_m: &[1.0] };
        let found: Vec<(usize, usize)> =
            cells.per_slope(&slopes).iter().map(|bin| (bin.metrics.reference_cells, bin.metrics.n)).collect();
        assert_eq!(found, [(2, 2), (1, 1), (0, 0), (0, 0), (0, 0), (0, 0), (1, 0)]);
    }

    #[test]
    fn edge_and_rest_make_the_whole() {
        let reference = Grid::from_vec(4, 1, vec![1.0, 2.0, f32::NAN, 3.0]).unwrap();
        let errors = Grid::from_vec(4, 1, vec![0.5, f64::NAN, f64::NAN, 4.0]).unwrap();
        let zone = Grid::from_vec(4, 1, vec![true, false, true, false]).unwrap();
        let found = Cells { reference: &reference, errors: &errors, thresholds_m: &[1.0] }.at_edges(&zone);
        assert_eq!((found.edge.reference_cells, found.edge.n), (1, 1));
        assert_eq!((found.rest.reference_cells, found.rest.n), (2, 1));
        assert_eq!(found.rest.completeness(1.0), Some(0.0));
    }
}
