//! Observed and filled cells apart: the same metrics over the heights that matching found and over
//! those that a rule filled in.
//!
//! Both sets are measured against *all* valid cells of the reference. So `valid_ratio` is the share
//! of the reference that was observed (or filled), `completeness_<t>` the share that was observed
//! and right, and `pag_<t>` the share of the observed cells that is right.

use raster::Grid;
use serde::Serialize;

use crate::measures::breakdown::{Cells, ClassMetrics, EdgeMetrics};
use crate::measures::metrics::Metrics;

/// How the height of a cell of the test came about.
#[derive(Debug, Clone, Copy, PartialEq, Eq, Serialize)]
#[serde(rename_all = "snake_case")]
pub enum CellOrigin {
    /// Matching found the height.
    Observed,
    /// A rule filled the height in.
    Filled,
    /// The cell has no height, or nothing says where its height comes from.
    Void,
}

impl CellOrigin {
    /// Returns the origin that a code of `dsm/source.tif` stands for: 1 is observed, 2 to 9 are
    /// rules that filled the cell, all others are reasons for a void.
    pub const fn from_source_code(code: i32) -> Self {
        match code {
            1 => Self::Observed,
            2..=9 => Self::Filled,
            _ => Self::Void,
        }
    }

    /// Returns the origin that a value of `dsm/filled.tif` stands for: 0 is observed, 1 is filled,
    /// all others are void.
    pub const fn from_filled_flag(flag: i32) -> Self {
        match flag {
            0 => Self::Observed,
            1 => Self::Filled,
            _ => Self::Void,
        }
    }
}

/// Metrics of the cells of one origin.
#[derive(Debug, Clone, PartialEq)]
pub struct OriginMetrics {
    /// Metrics over all cells.
    pub overall: Metrics,
    /// Metrics near and away from height jumps.
    pub edges: EdgeMetrics,
    /// Metrics per class, in rising order. Empty without classes.
    pub classes: Vec<ClassMetrics>,
}

/// Observed and filled cells apart.
#[derive(Debug, Clone, PartialEq)]
pub struct OriginSplit {
    /// The cells that matching found.
    pub observed: OriginMetrics,
    /// The cells that a rule filled in.
    pub filled: OriginMetrics,
    /// Number of compared cells whose origin is neither. They are in neither set.
    pub unknown_cells: usize,
}

/// Computes the metrics of each origin. `origins`, `zone` and `classes` are on the reference grid.
pub(crate) fn split(
    part: Cells<'_>,
    origins: &Grid<CellOrigin>,
    zone: &Grid<bool>,
    classes: Option<&Grid<Option<i32>>>,
) -> OriginSplit {
    let of = |origin: CellOrigin| {
        let errors = only(part.errors, |i| origins.data().get(i) == Some(&origin));
        let part = Cells { errors: &errors, ..part };
        OriginMetrics { overall: part.overall(), edges: part.at_edges(zone), classes: part.per_class(classes) }
    };
    let unknown = part.errors.data().iter().zip(origins.data());
    OriginSplit {
        observed: of(CellOrigin::Observed),
        filled: of(CellOrigin::Filled),
        unknown_cells: unknown.filter(|(error, origin)| error.is_finite() && **origin == CellOrigin::Void).count(),
    }
}

/// Returns the errors of the cells for which `keeps` is true, NaN elsewhere.
fn only(errors: &Grid<f64>, keeps: impl Fn(usize) -> bool) -> Grid<f64> {
    let mut kept = errors.clone();
    kept.data_mut().iter_mut().enumerate().filter(|(i, _)| !keeps(*i)).for_each(|(_, error)| *error = f64::NAN);
    kept
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn the_codes_of_both_files_are_understood() {
        let source = [0, 1, 2, 9, 10, 255].map(CellOrigin::from_source_code);
        use CellOrigin::{Filled, Observed, Void};
        assert_eq!(source, [Void, Observed, Filled, Filled, Void, Void]);
        assert_eq!([0, 1, 255].map(CellOrigin::from_filled_flag), [Observed, Filled, Void]);
    }

    #[test]
    fn both_sets_are_shares_of_the_whole_reference() {
        let reference = Grid::filled(8, 1, 3.0f32);
        let errors = Grid::from_vec(8, 1, vec![0.1, 0.2, 3.0, 0.3, 5.0, f64::NAN, 0.1, f64::NAN]).unwrap();
        use CellOrigin::{Filled, Observed, Void};
        let origins = vec![Observed, Observed, Observed, Filled, Filled, Void, Void, Observed];
        let origins = Grid::from_vec(8, 1, origins).unwrap();
        let zone = Grid::from_vec(8, 1, vec![false, true, true, false, true, false, false, false]).unwrap();
        let classes =
            Grid::from_vec(8, 1, vec![Some(2), Some(6), Some(6), Some(2), Some(2), None, None, None]).unwrap();
        let part = Cells { reference: &reference, errors: &errors, thresholds_m: &[1.0] };
        let found = split(part, &origins, &zone, Some(&classes));
        let (observed, filled) = (&found.observed, &found.filled);
        assert_eq!((observed.overall.n, filled.overall.n, found.unknown_cells), (3, 2, 1));
        assert_eq!((observed.overall.valid_ratio(), observed.overall.completeness(1.0)), (Some(0.375), Some(0.25)));
        assert_eq!(filled.overall.pag(1.0), Some(0.5));
        assert_eq!((observed.edges.edge.n, observed.edges.rest.n, filled.edges.edge.n), (2, 1, 1));
        assert_eq!((filled.classes[0].class, filled.classes[0].metrics.n), (2, 2));
        assert_eq!((observed.classes[1].metrics.reference_cells, observed.classes[1].metrics.n), (2, 2));
    }
}
