//! Table for the terminal: the protocol, then one row per metric with one column per set of cells.

use std::fmt::Write;

use super::judged::JudgedTable;
use super::numbers::{cell, label, percent};
use super::report::EvaluationReport;

impl EvaluationReport<'_> {
    /// Returns the report as text that ends in a line break.
    pub fn table(&self) -> String {
        let mut lines: Vec<String> =
            self.protocol.lines(self.found).iter().map(|(name, text)| format!("{name:<10} {text}")).collect();
        lines.push(String::new());
        lines.extend(self.metric_lines());
        lines.push(String::new());
        lines.extend(self.slope_lines());
        lines.extend(self.coverage_lines());
        lines.push(String::new());
        lines.extend(self.building_lines());
        lines.extend(self.judged_lines());
        lines.extend(self.protocol.notes.iter().map(|note| format!("note: {note}")));
        lines.join("\n") + "\n"
    }

    fn metric_lines(&self) -> Vec<String> {
        let columns: Vec<_> = self.sets().into_iter().map(|(title, metrics)| (title, metrics.named())).collect();
        let mut lines = vec![row("metric", columns.iter().map(|(title, _)| title.clone()))];
        for (i, (name, _)) in self.found.overall.named().iter().enumerate() {
            let value = |(_, metrics): &(String, Vec<(String, Option<f64>)>)| {
                metrics.get(i).map_or_else(String::new, |(name, value)| cell(name, *value))
            };
            lines.push(row(&label(name), columns.iter().map(value)));
        }
        lines
    }

    fn slope_lines(&self) -> Vec<String> {
        let heads = ["n", "median m", "mae m", "nmad m", "le90 m"];
        let mut lines = vec![row("slope of ref.", heads.iter().map(|head| (*head).to_owned()))];
        for bin in self.found.slopes.iter().filter(|bin| bin.metrics.n > 0) {
            let Some(e) = bin.metrics.errors else { continue };
            let metres = [e.median, e.mae, e.nmad, e.le90].map(|value| cell("mae", Some(value)));
            let cells = std::iter::once(bin.metrics.n.to_string()).chain(metres);
            lines.push(row(&format!("{:.0} to {:.0} deg", bin.from_deg, bin.to_deg), cells));
        }
        lines
    }

    fn coverage_lines(&self) -> Vec<String> {
        let heads = ["confidence", "mae m", "nmad m", "le90 m", "< 1 m %"];
        let mut lines = vec![row("most believed", heads.iter().map(|head| (*head).to_owned()))];
        for kept in &self.found.coverages {
            let Some(e) = kept.metrics.errors else { continue };
            let metres = [e.mae, e.nmad, e.le90].map(|value| cell("mae", Some(value)));
            let first = std::iter::once(format!("{:.2}", kept.confidence));
            let cells = first.chain(metres).chain(std::iter::once(percent(kept.metrics.completeness(1.0))));
            lines.push(row(&format!("{:.0} % of ref.", 100.0 * kept.coverage), cells));
        }
        if self.found.coverages.is_empty() { Vec::new() } else { lines }
    }

    fn judged_lines(&self) -> Vec<String> {
        let of = |table: JudgedTable| {
            let head = row(table.corner, table.heads.iter().map(|head| (*head).to_owned()));
            let rows = table.rows.into_iter().map(|(label, cells)| row(&label, cells.into_iter()));
            [String::new(), head].into_iter().chain(rows).collect::<Vec<_>>()
        };
        self.judged_tables().into_iter().flat_map(of).collect()
    }

    fn building_lines(&self) -> Vec<String> {
        let (standing, sharpness) = (&self.found.standing, &self.found.sharpness);
        let mut lines = vec![row("standing", ["recall %", "precision %", "IoU %"].iter().map(|s| (*s).to_owned()))];
        for (name, overlap) in [("footprint", standing.footprint), ("volume", standing.volume)] {
            lines.push(row(name, [overlap.recall(), overlap.precision(), overlap.iou()].into_iter().map(percent)));
        }
        let overreach = sharpness.overreach_m.map_or("none measured".to_owned(), |e| {
            format!("median {:+.3} m, NMAD {:.3} m, LE90 {:.3} m", e.median, e.nmad, e.le90)
        });
        lines.push(format!(
            "overreach at roof edges  {overreach} ({} of {} places)",
            sharpness.measured, sharpness.edges
        ));
        lines
    }
}

fn row(label: &str, cells: impl Iterator<Item = String>) -> String {
    let mut line = format!("{label:<18}");
    for cell in cells {
        // Writing to a string cannot fail.
        let _ = write!(line, " {cell:>13}");
    }
    line
}
