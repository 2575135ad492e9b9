//! The page of a batch: one row for each task of each scene.

use crate::page::page;
use crate::parts::{cards_of, table};

/// What became of a batch.
#[derive(Debug, Clone, PartialEq)]
pub struct BatchPage {
    /// Number of tasks that are complete.
    pub complete: usize,
    /// Number of tasks that are not.
    pub incomplete: usize,
    /// The tasks.
    pub rows: Vec<BatchRow>,
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
        let cards = [(self.complete.to_string(), "tasks complete"), (self.incomplete.to_string(), "tasks incomplete")];
        let rows = self.rows.iter().map(|row| {
            let seconds = format!("{:.1} s", row.seconds);
            vec![
                row.scene.clone(),
                row.task.clone(),
                row.state.clone(),
                seconds,
                row.reason.clone(),
                row.warnings.join("; "),
            ]
        });
        let tasks = table("Tasks", &["scene", "task", "state", "time", "reason", "warnings"], rows);
        page("Batch", &format!("<h1>Batch</h1>{}{tasks}", cards_of(&cards)))
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
        let html = BatchPage { complete: 0, incomplete: 1, rows: vec![row] }.html();
        assert!(
            html.contains("&lt;b&gt;")
                && html.contains("a &amp; b")
                && html.contains("1.2 s")
                && html.contains("&lt;i&gt;; c"),
            "{html}"
        );
    }
}
