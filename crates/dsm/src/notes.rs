//! The choices and warnings of a run: shown as they come, and kept for the report.

use numeric::{Choice, Progress};

/// What concerns more images than this is counted, not listed.
pub(crate) const LISTED_MAX: usize = 12;

/// Choices and warnings made so far, with the watcher that is told of each.
pub(crate) struct Notes<'a> {
    pub(crate) choices: Vec<Choice>,
    pub(crate) warnings: Vec<String>,
    progress: &'a dyn Progress,
}

impl<'a> Notes<'a> {
    /// Makes an empty collection.
    pub(crate) fn new(progress: &'a dyn Progress) -> Self {
        Self::resume(&[], &[], progress)
    }

    /// Goes on with the choices and warnings of an earlier stage, which are not reported again.
    pub(crate) fn resume(choices: &[Choice], warnings: &[String], progress: &'a dyn Progress) -> Self {
        Self { choices: choices.to_vec(), warnings: warnings.to_vec(), progress }
    }

    /// Reports a choice and keeps it.
    pub(crate) fn choose(&mut self, name: &str, value: String, reason: impl Into<String>) {
        let choice = Choice { name: name.to_owned(), value, reason: reason.into() };
        self.progress.choice(&choice);
        self.choices.push(choice);
    }

    /// Reports a warning and keeps it.
    pub(crate) fn warn(&mut self, text: String) {
        self.progress.warn(&text);
        self.warnings.push(text);
    }
}
