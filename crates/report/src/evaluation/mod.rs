//! One evaluation, told as text, as JSON and as a page.

mod figures;
mod html;
mod json;
mod numbers;
mod tables;
mod text;

use eval::{Evaluation, Metrics, round_up};
use numeric::percentile;
use raster::Grid;

use crate::class::class_title;
use crate::protocol::Protocol;

/// An evaluation with its protocol and the surface that it was measured at.
#[derive(Debug, Clone, Copy)]
pub struct EvaluationReport<'a> {
    /// What was compared, and how.
    pub protocol: &'a Protocol,
    /// What was found.
    pub found: &'a Evaluation,
    /// The reference's heights.
    pub reference: &'a Grid<f32>,
}

impl EvaluationReport<'_> {
    /// The range of the error map's colours: the LE90, rounded up to 1, 2 or 5 times a power of ten.
    pub fn error_range_m(&self) -> f64 {
        round_up(self.found.overall.errors.map_or(1.0, |errors| errors.le90))
    }

    /// The range of the plots of the distribution.
    fn plot_range_m(&self) -> f64 {
        round_up(self.found.overall.errors.map_or(1.0, |errors| errors.le95))
    }

    /// The sets of cells with their titles: all, near edges, the rest, classes.
    fn sets(&self) -> Vec<(String, &Metrics)> {
        let edges = &self.found.edges;
        let mut sets = vec![
            ("all".to_owned(), &self.found.overall),
            ("edges".into(), &edges.edge),
            ("no edges".into(), &edges.rest),
        ];
        sets.extend(self.found.classes.iter().map(|c| (class_title(c.class), &c.metrics)));
        sets
    }

    /// The lowest and highest heights for the colours of a relief: the extreme hundredths are left out.
    fn height_range(&self) -> (f32, f32) {
        let mut heights: Vec<f64> =
            self.reference.data().iter().filter(|h| h.is_finite()).map(|&h| f64::from(h)).collect();
        let mut at = |p| percentile(&mut heights, p).unwrap_or(0.0) as f32;
        (at(1.0), at(99.0))
    }
}
