//! The log of a task: its progress as lines of JSON in a file of its own.

use std::fs::File;
use std::io::Write;
use std::path::Path;

use numeric::{Choice, Progress};

use crate::event_lines::EventLines;

/// Writes the progress of a task to its log, and passes on the wish to stop.
pub(super) struct TaskLog<'a, W> {
    lines: EventLines<W>,
    batch: &'a dyn Progress,
}

/// Opens the log of a task, to whose end lines are added.
///
/// # Errors
/// Those of the system.
pub(super) fn open<'a>(
    path: &Path,
    batch: &'a dyn Progress,
) -> std::io::Result<TaskLog<'a, impl Fn(&str) + Sync + use<>>> {
    let file = File::options().create(true).append(true).open(path)?;
    // A log that cannot be written is no reason to lose the result.
    let lines = EventLines::new(move |line: &str| drop((&file).write_all(format!("{line}\n").as_bytes())));
    Ok(TaskLog { lines, batch })
}

impl<W: Fn(&str) + Sync> TaskLog<'_, W> {
    /// Writes how the task ended.
    pub(super) fn finish(&self, output: &Path, reason: Option<&str>) {
        let error = reason.map(|reason| std::io::Error::other(reason.to_owned()));
        self.lines.finish(output, error.as_ref().map(|error| error as _));
    }
}

impl<W: Fn(&str) + Sync> Progress for TaskLog<'_, W> {
    fn begin(&self, stage: &str, steps: usize) {
        self.lines.begin(stage, steps);
    }

    fn step(&self) {
        self.lines.step();
    }

    fn choice(&self, choice: &Choice) {
        self.lines.choice(choice);
    }

    fn warn(&self, text: &str) {
        self.lines.warn(text);
    }

    fn is_cancelled(&self) -> bool {
        self.batch.is_cancelled()
    }
}
