//! The progress of a job as lines of JSON, for programs that follow it and for logs.
//!
//! Each line is one event: `stage` (with its `steps`), `step` (steps `done`, `seconds` since the
//! stage began), `choice`, `warning`, and at the end `done` or `error`.

use std::path::Path;
use std::sync::Mutex;
use std::time::Instant;

use numeric::{Choice, Progress};
use serde_json::{Value, json};

/// Hands the progress of a job as lines of JSON to a function.
pub struct EventLines<W> {
    say: W,
    stage: Mutex<Stage>,
}

struct Stage {
    name: String,
    done: usize,
    since: Instant,
}

impl<W: Fn(&str) + Sync> EventLines<W> {
    /// Makes a watcher that gives each line, without its end, to `say`.
    pub fn new(say: W) -> Self {
        Self { say, stage: Mutex::new(Stage { name: String::new(), done: 0, since: Instant::now() }) }
    }

    /// Tells how the job ended that wrote, or was to write, `output`.
    pub fn finish(&self, output: &Path, error: Option<&dyn std::error::Error>) {
        let output = output.to_string_lossy();
        self.line(&match error {
            None => json!({ "event": "done", "output": output }),
            Some(error) => {
                let causes = std::iter::successors(error.source(), |cause| cause.source()).map(ToString::to_string);
                let causes = causes.collect::<Vec<_>>();
                json!({ "event": "error", "text": error.to_string(), "causes": causes, "output": output })
            }
        });
    }

    fn line(&self, event: &Value) {
        (self.say)(&event.to_string());
    }
}

impl<W: Fn(&str) + Sync> Progress for EventLines<W> {
    fn begin(&self, stage: &str, steps: usize) {
        if let Ok(mut current) = self.stage.lock() {
            *current = Stage { name: stage.to_owned(), done: 0, since: Instant::now() };
        }
        self.line(&json!({ "event": "stage", "stage": stage, "steps": steps }));
    }

    fn step(&self) {
        if let Ok(mut stage) = self.stage.lock() {
            stage.done += 1;
            let seconds = stage.since.elapsed().as_secs_f64();
            self.line(&json!({ "event": "step", "stage": stage.name, "done": stage.done, "seconds": seconds }));
        }
    }

    fn choice(&self, choice: &Choice) {
        self.line(&json!({ "event": "choice", "name": choice.name, "value": choice.value, "reason": choice.reason }));
    }

    fn warn(&self, text: &str) {
        self.line(&json!({ "event": "warning", "text": text }));
    }
}
