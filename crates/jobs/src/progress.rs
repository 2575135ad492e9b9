//! What a long job tells whoever watches it.

/// Receives the progress of a job; implemented by the command line and by tests.
pub trait Progress: Sync {
    /// A stage of `steps` steps begins.
    fn begin(&self, stage: &str, steps: usize);
    /// One step of the current stage is done.
    fn step(&self);
    /// A choice was made, with its reason.
    fn choice(&self, choice: &Choice);
    /// Something the user should know, though the job goes on.
    fn warn(&self, text: &str);
    /// Whether the job is to stop at its next step.
    fn is_cancelled(&self) -> bool {
        false
    }
}

/// An automatic or given choice and why it was made.
#[derive(Debug, Clone, PartialEq, serde::Serialize)]
pub struct Choice {
    /// What was chosen: `gsd`, `crs`, `height range`, …
    pub name: String,
    /// The value.
    pub value: String,
    /// The reason.
    pub reason: String,
}

/// Nobody watches.
#[derive(Debug, Clone, Copy, Default)]
pub struct Silent;

impl Progress for Silent {
    fn begin(&self, _: &str, _: usize) {}
    fn step(&self) {}
    fn choice(&self, _: &Choice) {}
    fn warn(&self, _: &str) {}
}
