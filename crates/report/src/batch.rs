//! The page of a batch: a row with picture, accuracy and links for each scene, and one for each
//! task.

use crate::base64;
use crate::escape::escape;
use crate::links::{PageLink, anchor};
use crate::page::page;
use crate::parts::{cards_of, notes, table};
use crate::words::{grouped, sensible, typeset};

/// What became of a batch.
#[derive(Debug, Clone, Default, PartialEq)]
pub struct BatchPage {
    /// Number of tasks that are complete.
    pub complete: usize,
    /// Number of tasks that are not.
    pub incomplete: usize,
    /// The scenes.
    pub scenes: Vec<BatchSceneRow>,
    /// The tasks.
    pub rows: Vec<BatchRow>,
}

/// A scene of a batch.
#[derive(Debug, Clone, Default, PartialEq)]
pub struct BatchSceneRow {
    /// Name.
    pub name: String,
    /// Its surface as a small picture in PNG.
    pub thumbnail: Option<Vec<u8>>,
    /// Whether all of its tasks are complete.
    pub is_complete: bool,
    /// Number of images; `None` without a surface model.
    pub images: Option<usize>,
    /// Number of cells of the surface model, and the shares that were observed and filled.
    pub cells: Option<(usize, f64, f64)>,
    /// Residual of the tie points, pixels.
    pub residual_px: Option<f64>,
    /// Errors against a reference.
    pub accuracy: Option<BatchAccuracy>,
    /// Time of all tasks in the runs that did them, seconds.
    pub seconds: f64,
    /// Results, relative to the folder of the page.
    pub links: Vec<PageLink>,
}

/// Errors of a surface model against a reference.
#[derive(Debug, Clone, Copy, Default, PartialEq)]
pub struct BatchAccuracy {
    /// Mean absolute error, metres.
    pub mae_m: Option<f64>,
    /// Robust spread of the errors, metres.
    pub nmad_m: Option<f64>,
    /// Share of the cells within a metre; cells without a height count as failures.
    pub within_1_m: Option<f64>,
}

/// What became of a task of a scene.
#[derive(Debug, Clone, PartialEq)]
pub struct BatchRow {
    /// Name of the scene.
    pub scene: String,
    /// Name of the task.
    pub task: String,
    /// How it ended, in a word or two.
    pub state: String,
    /// Wall time, seconds.
    pub seconds: f64,
    /// Why it is not complete; empty when it is.
    pub reason: String,
    /// Warnings that it gave.
    pub warnings: Vec<String>,
}

impl BatchPage {
    /// Returns the page.
    pub fn html(&self) -> String {
        let seconds: f64 = self.rows.iter().map(|row| row.seconds).sum();
        let whole = self.scenes.iter().filter(|scene| scene.is_complete).count();
        let cards = [
            (format!("{whole} <small>of {}</small>", self.scenes.len()), "scenes complete"),
            (self.complete.to_string(), "tasks complete"),
            (self.incomplete.to_string(), "tasks incomplete"),
            (duration(seconds), "time of all tasks"),
        ];
        let failed = self.rows.iter().filter(|row| !row.reason.is_empty());
        let failed: Vec<String> =
            failed.map(|row| format!("{}, {} {}: {}", row.scene, row.task, row.state, row.reason)).collect();
        let rows = self.rows.iter().map(|row| {
            vec![
                row.scene.clone(),
                row.task.clone(),
                row.state.clone(),
                duration(row.seconds),
                row.reason.clone(),
                row.warnings.join("; "),
            ]
        });
        let tasks = table("Tasks", &["scene", "task", "state", "time", "reason", "warnings"], rows);
        page("Batch", &format!("<h1>Batch</h1>{}{}{}{tasks}", cards_of(&cards), notes(&failed), self.scene_table()))
    }

    fn scene_table(&self) -> String {
        let heads = ["images", "cells", "observed", "filled", "ties", "MAE", "NMAD", "within 1 m", "time"];
        let heads: String = heads.iter().map(|head| format!("<th scope=\"col\">{head}</th>")).collect();
        let rows: String = self.scenes.iter().map(BatchSceneRow::html).collect();
        format!(
            "<h2>Scenes</h2><div class=\"wide\"><table><thead><tr><th scope=\"col\"></th><th scope=\"col\" \
             class=\"words\">scene and results</th>{heads}</tr></thead><tbody>{rows}</tbody></table></div>\
             <p>Ties: robust residual of the tie points after the correction of the pointing. MAE, NMAD and the share \
             within a metre: against the reference of the scene's evaluation; cells without a height count as \
             failures in the share. Times are those of the runs that did the tasks.</p>"
        )
    }
}

impl BatchSceneRow {
    fn html(&self) -> String {
        let picture = self.thumbnail.as_ref().map_or_else(String::new, |bytes| {
            let (data, name) = (base64::encode(bytes), escape(&self.name));
            format!("<img class=\"thumb\" src=\"data:image/png;base64,{data}\" alt=\"relief of {name}\">")
        });
        let dash = || "–".to_owned();
        let share = |value: Option<f64>| value.map_or_else(dash, |share| format!("{:.1} %", 100.0 * share));
        let with = |value: Option<f64>, unit: &str| {
            value.map_or_else(dash, |value| typeset(&format!("{} {unit}", sensible(value, unit))))
        };
        let errors = self.accuracy.unwrap_or_default();
        let numbers = [
            self.images.map_or_else(dash, |count| count.to_string()),
            self.cells.map_or_else(dash, |(cells, ..)| grouped(cells)),
            share(self.cells.map(|(_, observed, _)| observed)),
            share(self.cells.map(|(.., filled)| filled)),
            with(self.residual_px, "px"),
            with(errors.mae_m, "m"),
            with(errors.nmad_m, "m"),
            share(errors.within_1_m),
            duration(self.seconds),
        ];
        let numbers: String = numbers.iter().map(|number| format!("<td>{number}</td>")).collect();
        let (class, state) = if self.is_complete { ("good", "complete") } else { ("bad", "incomplete") };
        let links: Vec<String> = self.links.iter().map(|link| anchor(&link.path, &link.title)).collect();
        format!(
            "<tr><td class=\"words\">{picture}</td><th scope=\"row\" class=\"words\"><b>{}</b> <small \
             class=\"{class}\">{state}</small><div class=\"links\">{}</div></th>{numbers}</tr>",
            escape(&self.name),
            links.join(" ")
        )
    }
}

/// Returns a time in the units in which it is said.
fn duration(seconds: f64) -> String {
    let whole = seconds.round().max(0.0) as u64;
    match whole {
        _ if seconds < 99.95 => format!("{seconds:.1} s"),
        0..3600 => format!("{} min {} s", whole / 60, whole % 60),
        _ => format!("{} h {} min", whole / 3600, whole % 3600 / 60),
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn names_and_reasons_cannot_leave_their_place() {
        let row = BatchRow {
            scene: "<b>".to_owned(),
            task: "dsm".to_owned(),
            state: "failed".to_owned(),
            seconds: 1.25,
            reason: "a & b".to_owned(),
            warnings: vec!["<i>".to_owned(), "c".to_owned()],
        };
        let scene = BatchSceneRow {
            name: "<b> c".to_owned(),
            links: vec![PageLink::new("<b> c/report/report.html", "report")],
            thumbnail: Some(vec![1, 2, 3]),
            cells: Some((12_345, 0.5, 0.25)),
            accuracy: Some(BatchAccuracy { mae_m: Some(0.4567), nmad_m: None, within_1_m: Some(0.9) }),
            ..BatchSceneRow::default()
        };
        let html = BatchPage { complete: 0, incomplete: 1, scenes: vec![scene], rows: vec![row] }.html();
        for words in [
            "&lt;b&gt;",
            "a &amp; b",
            "1.2 s",
            "&lt;i&gt;; c",
            "href=\"./%3Cb%3E%20c/report/report.html\">report</a>",
            "data:image/png;base64,AQID",
            "12\u{202f}345",
            "<td>0.457 m</td><td>–</td><td>90.0 %</td>",
            "incomplete",
        ] {
            assert!(html.contains(words), "{words} is not in {html}");
        }
        assert!(!html.contains("<b> c"));
    }

    #[test]
    fn times_are_said_in_their_units() {
        assert_eq!([0.04, 75.0, 754.0, 7_500.0].map(duration), ["0.0 s", "75.0 s", "12 min 34 s", "2 h 5 min"]);
    }
}
