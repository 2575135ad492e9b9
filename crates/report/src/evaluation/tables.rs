//! Tables of a page.

use super::judged::JudgedTable;
use super::numbers::{cell, grouped, is_count, label, percent};
use super::report::EvaluationReport;
use crate::escape::escape;
use crate::words::typeset;

impl EvaluationReport<'_> {
    /// Returns a table of every metric for every set of cells.
    pub(super) fn metric_table(&self) -> String {
        let columns: Vec<_> = self.sets().into_iter().map(|(title, metrics)| (title, metrics.named())).collect();
        let rows = self.found.overall.named().into_iter().enumerate().map(|(i, (name, _))| {
            let values =
                columns.iter().map(|(_, metrics)| metrics.get(i).map_or_else(String::new, |(n, v)| pretty(n, *v)));
            (label(&name), values.collect())
        });
        table("metric", columns.iter().map(|(title, _)| title.as_str()), rows)
    }

    /// Returns a table with one row per slope.
    pub(super) fn slope_table(&self) -> String {
        let heads = ["cells", "bias m", "median m", "MAE m", "RMSE m", "NMAD m", "LE90 m"];
        let rows = self.found.slopes.iter().filter(|bin| bin.metrics.reference_cells > 0).map(|bin| {
            let values = bin.metrics.errors.map(|e| [e.mean, e.median, e.mae, e.rmse, e.nmad, e.le90]);
            let metres = (0..6).map(|i| cell("mae", values.map(|values| values[i])));
            let values = std::iter::once(grouped(bin.metrics.n)).chain(metres).collect();
            (format!("{:.0}° to {:.0}°", bin.from_deg, bin.to_deg), values)
        });
        table("slope of the reference", heads.into_iter(), rows)
    }

    /// Returns a table of the most confident cells, one row per coverage, or an empty text without
    /// a confidence.
    pub(super) fn coverage_table(&self) -> String {
        if self.found.coverages.is_empty() {
            return String::new();
        }
        let heads = ["confidence", "MAE m", "RMSE m", "NMAD m", "LE90 m", "< 1 m %"];
        let rows = self.found.coverages.iter().map(|kept| {
            let values = kept.metrics.errors.map(|e| [e.mae, e.rmse, e.nmad, e.le90]);
            let metres = (0..4).map(|i| cell("mae", values.map(|values| values[i])));
            let first = std::iter::once(format!("{:.2}", kept.confidence));
            let right = std::iter::once(percent(kept.metrics.completeness(1.0)));
            (format!("{:.0} %", 100.0 * kept.coverage), first.chain(metres).chain(right).collect())
        });
        table("most believed cells", heads.into_iter(), rows)
    }

    /// Returns the tables of origins, uncertainty and objects, each for which there is an input.
    pub(super) fn judged_html(&self) -> String {
        let of = |judged: JudgedTable| table(judged.corner, judged.heads.into_iter(), judged.rows.into_iter());
        self.judged_tables().into_iter().map(of).collect::<Vec<_>>().join("\n")
    }

    /// Returns a table of the objects above the terrain.
    pub(super) fn standing_table(&self) -> String {
        let standing = &self.found.standing;
        let rows = [("footprint", "m²", standing.footprint), ("volume", "m³", standing.volume)];
        let heads = ["recall %", "precision %", "IoU %", "reference", "evaluated", "shared"];
        let rows = rows.into_iter().map(|(name, unit, overlap)| {
            let shares = [overlap.recall(), overlap.precision(), overlap.iou()].map(percent);
            let sizes = [overlap.reference, overlap.test, overlap.shared]
                .map(|size| format!("{} {unit}", grouped(size.round() as usize)));
            (name.to_owned(), shares.into_iter().chain(sizes).collect())
        });
        table("above the terrain", heads.into_iter(), rows)
    }
}

/// Formats a value like [`cell`], with counts in groups of three digits.
fn pretty(name: &str, value: Option<f64>) -> String {
    match value {
        Some(count) if is_count(name) => grouped(count as usize),
        value => cell(name, value),
    }
}

fn table<'a>(
    corner: &str,
    heads: impl Iterator<Item = &'a str>,
    rows: impl Iterator<Item = (String, Vec<String>)>,
) -> String {
    let heads: String = heads.map(|head| format!("<th scope=\"col\">{}</th>", escape(head))).collect();
    let rows: String = rows
        .map(|(name, values)| {
            let cells: String = values.iter().map(|value| format!("<td>{}</td>", escape(&typeset(value)))).collect();
            format!("<tr><th scope=\"row\">{}</th>{cells}</tr>", escape(&name))
        })
        .collect();
    format!(
        "<div class=\"wide\"><table><thead><tr><th scope=\"col\">{}</th>{heads}</tr></thead><tbody>\
          {rows}</tbody></table></div>",
        escape(corner)
    )
}
