//! An evaluation with its protocol: ranges and sets of cells that all forms of the report share.

use eval::{Evaluation, Metrics, round_up};
use numeric::percentile;
use raster::Grid;

use crate::class::class_title;
use crate::protocol::Protocol;

/// Evaluation with its protocol and the surface at which it was measured.
#[derive(Debug, Clone, Copy)]
pub struct EvaluationReport<'a> {
    /// Protocol of the evaluation.
    pub protocol: &'a Protocol,
    /// Result of the evaluation.
    pub found: &'a Evaluation,
    /// Heights of the reference.
    pub reference: &'a Grid<f32>,
}

impl EvaluationReport<'_> {
    /// Returns the range of the error map's colours: the LE90, rounded up to 1, 2 or 5 times a
    /// power of ten.
    pub fn error_range_m(&self) -> f64 {
        round_up(self.found.overall.errors.map_or(1.0, |errors| errors.le90))
    }

    /// Returns the range of the plots of the distribution.
    pub(super) fn plot_range_m(&self) -> f64 {
        round_up(self.found.overall.errors.map_or(1.0, |errors| errors.le95))
    }

    /// Returns the sets of cells with their titles: all, near edges, the rest, classes.
    pub(super) fn sets(&self) -> Vec<(String, &Metrics)> {
        let edges = &self.found.edges;
        let mut sets = vec![
            ("all".to_owned(), &self.found.overall),
            ("edges".into(), &edges.edge),
            ("no edges".into(), &edges.rest),
        ];
        sets.extend(self.found.classes.iter().map(|c| (class_title(c.class), &c.metrics)));
        sets
    }

    /// Returns the heights between which a relief is coloured: the 1st and the 99th percentile.
    pub(super) fn height_range(&self) -> (f32, f32) {
        let mut heights: Vec<f64> =
            self.reference.data().iter().filter(|h| h.is_finite()).map(|&h| f64::from(h)).collect();
        let mut at = |p| percentile(&mut heights, p).unwrap_or(0.0) as f32;
        (at(1.0), at(99.0))
    }
}
