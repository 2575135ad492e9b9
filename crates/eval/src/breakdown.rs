//! The same metrics for parts of the reference's cells: classes, slopes, edges.

use crate::metrics::Metrics;
use raster::Grid;
use std::collections::BTreeMap;

/// Bounds of the slope bins, degrees; a bin holds its lower bound.
pub const SLOPE_BOUNDS_DEG: [f64; 8] = [0.0, 5.0, 10.0, 20.0, 30.0, 45.0, 60.0, 90.0];

/// The metrics of one class.
#[derive(Debug, Clone, PartialEq)]
pub struct ClassMetrics {
    /// The class.
    pub class: i32,
    /// What was measured on its cells.
    pub metrics: Metrics,
}

/// The metrics of the cells whose slope in the reference is between two bounds.
#[derive(Debug, Clone, PartialEq)]
pub struct SlopeMetrics {
    /// Lower bound, degrees, included.
    pub from_deg: f64,
    /// Upper bound, degrees, not included but for the last.
    pub to_deg: f64,
    /// What was measured on the cells.
    pub metrics: Metrics,
}

/// The metrics near and away from height jumps.
#[derive(Debug, Clone, PartialEq)]
pub struct EdgeMetrics {
    /// Within the edge zone.
    pub edge: Metrics,
    /// Everywhere else.
    pub rest: Metrics,
}

/// Shares of the reference's cells that are kept of a surface, the most believed first.
pub const COVERAGES: [f64; 10] = [0.95, 0.9, 0.85, 0.8, 0.75, 0.7, 0.65, 0.6, 0.55, 0.5];

/// The metrics of the most believed cells.
#[derive(Debug, Clone, PartialEq)]
pub struct CoverageMetrics {
    /// Their share of the reference's valid cells.
    pub coverage: f64,
    /// The least confidence among them.
    pub confidence: f64,
    /// What was measured on them; the others are voids.
    pub metrics: Metrics,
}

/// The reference's valid cells with their errors, and how finely errors are counted.
#[derive(Clone, Copy)]
pub(crate) struct Cells<'a> {
    pub(crate) reference: &'a Grid<f32>,
    pub(crate) errors: &'a Grid<f64>,
    pub(crate) thresholds_m: &'a [f64],
}

impl Cells<'_> {
    /// The metrics of the cells of each key; cells without a key are in none.
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

    pub(crate) fn per_class(&self, classes: Option<&Grid<Option<i32>>>) -> Vec<ClassMetrics> {
        let by_class = self.by(|i| classes.and_then(|classes| *classes.data().get(i)?));
        by_class.into_iter().map(|(class, metrics)| ClassMetrics { class, metrics }).collect()
    }

    /// One entry for each of [`COVERAGES`] that the surface reaches.
    pub(crate) fn per_coverage(&self, confidence: &Grid<f32>) -> Vec<CoverageMetrics> {
        let reference_cells = self.reference.data().iter().filter(|h| h.is_finite()).count();
        let cells = self.errors.data().iter().zip(confidence.data());
        let mut known: Vec<(f32, f64)> = cells
            .filter(|(error, _)| error.is_finite())
            .map(|(error, confidence)| (if confidence.is_nan() { f32::NEG_INFINITY } else { *confidence }, *error))
            .collect();
        // Stable: cells of one confidence stay in the order of the rows, whatever their errors.
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

    /// One entry per bin, the empty ones too, so that tables of different scenes have the same rows.
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
