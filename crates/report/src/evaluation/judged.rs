//! Tables of what the product says about itself and of single objects: observed and filled cells,
//! stated uncertainty, buildings and trees. The terminal and the page show the same rows.

use eval::{Metrics, OriginMetrics, SigmaCalibration};

use super::numbers::percent;
use super::report::EvaluationReport;
use crate::class::class_title;

/// Most buildings that are listed.
const LISTED: usize = 20;

/// One table.
pub(super) struct JudgedTable {
    /// Title of the first column.
    pub(super) corner: &'static str,
    /// Titles of the other columns.
    pub(super) heads: Vec<&'static str>,
    /// Label and values of each row.
    pub(super) rows: Vec<(String, Vec<String>)>,
}

impl EvaluationReport<'_> {
    /// Returns the tables for which the evaluation has an input.
    pub(super) fn judged_tables(&self) -> Vec<JudgedTable> {
        [self.origin_table(), self.sigma_table(), self.reliability_table(), self.object_table(), self.lost_table()]
            .into_iter()
            .flatten()
            .collect()
    }

    /// Returns one row per set of cells. Shares of right cells are shares of the cells of their own
    /// origin.
    fn origin_table(&self) -> Option<JudgedTable> {
        let split = self.found.origins.as_ref()?;
        let (observed, filled) = (sets(&split.observed), sets(&split.filled));
        let rows = observed.into_iter().map(|(title, metrics)| {
            let filled = filled.iter().find(|(other, _)| *other == title).map(|(_, metrics)| *metrics);
            let cells = of_origin(Some(metrics)).into_iter().chain(of_origin(filled)).collect();
            (title, cells)
        });
        Some(JudgedTable {
            corner: "origin",
            heads: vec!["observed %", "mae m", "< 1 m %", "filled %", "mae m", "< 1 m %"],
            rows: rows.collect(),
        })
    }

    fn sigma_table(&self) -> Option<JudgedTable> {
        let sigma = self.found.sigma?;
        let row = |name: &str, found: Option<SigmaCalibration>| {
            let found = found?;
            let shares = [found.below_1_sigma, found.below_2_sigma].map(|share| percent(Some(share)));
            let cells = [found.n.to_string()].into_iter().chain(shares);
            let metres = [format!("{:.3}", found.median_ratio), format!("{:.3}", found.median_sigma_m)];
            Some((name.to_owned(), cells.chain(metres).collect()))
        };
        Some(JudgedTable {
            corner: "sigma",
            heads: vec!["n", "< 1 sigma %", "< 2 sigma %", "|e|/sigma", "sigma m"],
            rows: [row("observed", sigma.observed), row("filled", sigma.filled)].into_iter().flatten().collect(),
        })
    }

    fn reliability_table(&self) -> Option<JudgedTable> {
        let reliability = self.found.reliability.as_ref()?;
        let rows = reliability.tenths.iter().filter(|row| row.n > 0).map(|row| {
            let cells = vec![row.n.to_string(), percent(row.promised), percent(row.right)];
            (format!("{:.1} to {:.1}", row.from, row.to), cells)
        });
        Some(JudgedTable { corner: "confidence", heads: vec!["n", "promised %", "right %"], rows: rows.collect() })
    }

    fn object_table(&self) -> Option<JudgedTable> {
        let objects = self.found.objects.as_ref()?;
        let outlines = self.found.outlines.as_ref();
        let overreach = outlines.and_then(|outlines| outlines.median_cells);
        let places = outlines.map_or_else(String::new, |o| format!("{}/{}", o.measured, o.edges));
        let counts = [objects.buildings, objects.lost, objects.damaged].map(|count| count.to_string());
        let overreach = overreach.map_or("-".to_owned(), |cells| format!("{cells:+.2}"));
        Some(JudgedTable {
            corner: "objects",
            heads: vec!["buildings", "lost", "damaged", "trees right %", "outlines cells", "places"],
            rows: vec![(
                "found".to_owned(),
                counts.into_iter().chain([percent(objects.trees_right), overreach, places]).collect(),
            )],
        })
    }

    fn lost_table(&self) -> Option<JudgedTable> {
        let worst = &self.found.objects.as_ref()?.worst;
        let rows = worst.iter().take(LISTED).map(|building| {
            let cells = vec![
                percent(Some(building.right)),
                format!("{:.1}", building.height_m),
                format!("{:.0}", building.area_m2),
            ];
            (format!("building {}", building.number), cells)
        });
        (!worst.is_empty()).then(|| JudgedTable {
            corner: "worst buildings",
            heads: vec!["right %", "height m", "area m2"],
            rows: rows.collect(),
        })
    }
}

/// Returns the sets of cells of one origin with their titles.
fn sets(origin: &OriginMetrics) -> Vec<(String, &Metrics)> {
    let mut sets = vec![
        ("all".to_owned(), &origin.overall),
        ("edges".into(), &origin.edges.edge),
        ("no edges".into(), &origin.edges.rest),
    ];
    sets.extend(origin.classes.iter().map(|c| (class_title(c.class), &c.metrics)));
    sets
}

/// Returns the share of the reference, the MAE and the share within a metre.
fn of_origin(metrics: Option<&Metrics>) -> [String; 3] {
    let mae = metrics.and_then(|metrics| metrics.errors).map_or("-".to_owned(), |errors| format!("{:.3}", errors.mae));
    [percent(metrics.and_then(Metrics::valid_ratio)), mae, percent(metrics.and_then(|metrics| metrics.pag(1.0)))]
}
