//! Tables of what a single error figure hides: observed and filled cells apart, edges, buildings,
//! trees, and whether the stated uncertainty is true.

use std::fmt::Write;

use crate::matrix::{DEFAULT, Row};
use crate::run::of_tenth;

/// Least share of a scene's cells that a tenth of the confidence must hold to be shown.
const LEAST_SHARE: f64 = 0.002;

/// Returns the table of observed and filled cells, edges, buildings and trees, one row per scene
/// and preset.
pub(crate) fn quality_table(rows: &[Row]) -> String {
    let mut text = String::from(
        "\nObserved and filled cells apart. Shares of observed and filled cells are of the reference; \
         \"< 1 m\" is the share of these cells that is right to a metre. Edges are the cells within two cells of a \
         jump of 2 m in the reference, voids included. Outlines: how far roofs reach beyond the true outlines of \
         buildings, median, in cells. Lost: fewer than half of the inner cells of a building are right; damaged: fewer \
         than 90 % (lost ones included). σ: share of the observed errors below one and two stated standard \
         deviations (expected: 68 and 95). Gap: the largest difference between the promise of a tenth of the \
         confidence and the share that is right, in points.\n\n\
         | scene | preset | observed % | MAE | < 1 m % | filled % | MAE | < 1 m % | edges < 1 m % | outlines | \
         lost | damaged | of | trees % | < 1 σ % | < 2 σ % | gap |\n\
         |---|---|---|---|---|---|---|---|---|---|---|---|---|---|---|---|---|\n",
    );
    for row in rows.iter().filter(|row| row.has_truth()) {
        let percent = |name: &str| shown(100.0 * row.metric(name), 1);
        let metres = |name: &str| shown(row.metric(name), 3);
        let count = |name: &str| shown(row.metric(name), 0);
        let cells = [
            percent("observed_ratio"),
            metres("observed_mae"),
            percent("observed_pag_1"),
            percent("filled_ratio"),
            metres("filled_mae"),
            percent("filled_pag_1"),
            percent("edge_completeness_1"),
            shown(row.metric("outline_cells"), 2),
            count("buildings_lost"),
            count("buildings_damaged"),
            count("buildings"),
            percent("trees_right"),
            percent("below_1_sigma"),
            percent("below_2_sigma"),
            percent("reliability_gap"),
        ];
        // Writing to a string cannot fail.
        let _ = writeln!(text, "| {} | {} | {} |", row.scene, row.preset, cells.join(" | "));
    }
    text
}

/// Returns the reliability table of the default preset, one row per scene and one column per tenth.
pub(crate) fn reliability_table(rows: &[Row]) -> String {
    let heads: Vec<String> =
        (0..10).map(|k| format!("{:.1} to {:.1}", 0.1 * f64::from(k), 0.1 * f64::from(k + 1))).collect();
    let mut text = format!(
        "\nReliability of `dsm/confidence.tif`, preset {DEFAULT}: for the cells of each tenth the promised and the \
         measured share that is right (error below 1 m or two cells), in percent, and the share of all compared \
         cells in brackets.\n\n| scene | {} |\n|---{}|\n",
        heads.join(" | "),
        "|---".repeat(heads.len())
    );
    for row in rows.iter().filter(|row| row.has_truth() && row.preset == DEFAULT) {
        let total: f64 = (0..10).map(|k| row.metric(&of_tenth("confidence_n", k))).filter(|n| n.is_finite()).sum();
        let cells = (0..10).map(|k| {
            let share = row.metric(&of_tenth("confidence_n", k)) / total;
            // A scene without a confidence has no share.
            if share.is_nan() || share < LEAST_SHARE {
                return "–".to_owned();
            }
            let of = |name: &str| 100.0 * row.metric(&of_tenth(name, k));
            format!("{:.0} → {:.0} ({:.0})", of("promised"), of("right"), 100.0 * share)
        });
        let _ = writeln!(text, "| {} | {} |", row.scene, cells.collect::<Vec<_>>().join(" | "));
    }
    text
}

fn shown(value: f64, digits: usize) -> String {
    if value.is_nan() { "–".to_owned() } else { format!("{value:.digits$}") }
}
