//! The report of a batch: what became of every task of every scene.

use std::path::PathBuf;

use report::{BatchPage, BatchRow};
use serde::Serialize;

use crate::batch::scene_summary;
use crate::batch::task::TaskKind;

/// What became of a batch.
#[derive(Debug, Clone, PartialEq, Serialize)]
#[non_exhaustive]
pub struct BatchReport {
    /// Version of the program.
    pub version: String,
    /// Number of tasks that are complete, now or before.
    pub complete: usize,
    /// Number of tasks that are not.
    pub incomplete: usize,
    /// The scenes in the order of the file.
    pub scenes: Vec<SceneReport>,
}

/// What became of a scene.
#[derive(Debug, Clone, PartialEq, Serialize)]
#[non_exhaustive]
pub struct SceneReport {
    /// Name.
    pub name: String,
    /// Folder.
    pub folder: PathBuf,
    /// Its tasks in the order in which they are done.
    pub tasks: Vec<TaskReport>,
    /// Whether it was left out of this run. Its tasks are told as they stand, and do not count.
    #[serde(skip_serializing_if = "std::ops::Not::not")]
    pub left_out: bool,
}

/// What became of a task.
#[derive(Debug, Clone, PartialEq, Serialize)]
#[non_exhaustive]
pub struct TaskReport {
    /// The task.
    pub task: TaskKind,
    /// How it ended.
    pub state: TaskState,
    /// Why it is not done.
    #[serde(skip_serializing_if = "Option::is_none")]
    pub reason: Option<String>,
    /// Times that it was tried in the run that did it.
    pub attempts: usize,
    /// Wall time of the run that did it, seconds.
    pub seconds: f64,
    /// Warnings of the run that did it.
    #[serde(skip_serializing_if = "Vec::is_empty")]
    pub warnings: Vec<String>,
}

/// How a task ended.
#[derive(Debug, Clone, Copy, PartialEq, Eq, Serialize)]
#[serde(rename_all = "snake_case")]
#[non_exhaustive]
pub enum TaskState {
    /// It was done.
    Done,
    /// It was done before, and nothing has changed since.
    DoneBefore,
    /// There is a result with missing parts, or below what was required.
    Partial,
    /// There is no result.
    Failed,
    /// It was not begun, because the task before it has no result, or because its scene was left
    /// out.
    NotBegun,
    /// It would be done by a run.
    ToDo,
}

impl TaskState {
    /// Whether the result is whole.
    pub const fn is_complete(self) -> bool {
        matches!(self, Self::Done | Self::DoneBefore)
    }

    const fn words(self) -> &'static str {
        match self {
            Self::Done => "done",
            Self::DoneBefore => "done before",
            Self::Partial => "partial",
            Self::Failed => "failed",
            Self::NotBegun => "not begun",
            Self::ToDo => "to do",
        }
    }
}

impl TaskReport {
    pub(super) fn not_begun(task: TaskKind, reason: impl Into<String>) -> Self {
        let reason = Some(reason.into());
        Self { task, state: TaskState::NotBegun, reason, attempts: 0, seconds: 0.0, warnings: Vec::new() }
    }
}

impl BatchReport {
    /// Makes the report of scenes.
    pub(super) fn new(scenes: Vec<SceneReport>) -> Self {
        let tasks = || scenes.iter().filter(|scene| !scene.left_out).flat_map(|scene| &scene.tasks);
        let complete = tasks().filter(|task| task.state.is_complete()).count();
        let incomplete = tasks().count() - complete;
        Self { version: env!("CARGO_PKG_VERSION").to_owned(), complete, incomplete, scenes }
    }

    /// Whether a task failed, or would fail.
    pub fn has_failed(&self) -> bool {
        let mut tasks = self.scenes.iter().filter(|scene| !scene.left_out).flat_map(|scene| &scene.tasks);
        tasks.any(|task| task.state == TaskState::Failed)
    }

    /// Returns the report as text: a line for each task.
    pub fn text(&self) -> String {
        let mut text = String::new();
        for scene in &self.scenes {
            for task in &scene.tasks {
                let reason = task.reason.as_ref().map_or_else(String::new, |reason| format!(": {reason}"));
                let (name, words) = (task.task.name(), task.state.words());
                text += &format!("{:<20} {name:<10} {words:<12} {:>8.1} s{reason}\n", scene.name, task.seconds);
                for warning in &task.warnings {
                    text += &format!("{:<20} {name:<10} warning: {warning}\n", scene.name);
                }
            }
        }
        text + &format!("{} tasks are complete, {} are not\n", self.complete, self.incomplete)
    }

    /// Returns the report as a page.
    pub(super) fn page(&self) -> String {
        let rows = self.scenes.iter().flat_map(|scene| {
            scene.tasks.iter().map(|task| BatchRow {
                scene: scene.name.clone(),
                task: task.task.name().to_owned(),
                state: task.state.words().to_owned(),
                seconds: task.seconds,
                reason: task.reason.clone().unwrap_or_default(),
                warnings: task.warnings.clone(),
            })
        });
        let row = |scene: &SceneReport| {
            let is_complete = scene.tasks.iter().all(|task| task.state.is_complete());
            let seconds = scene.tasks.iter().map(|task| task.seconds).sum();
            scene_summary::of(&scene.name, &scene.folder, is_complete, seconds)
        };
        let scenes = self.scenes.iter().map(row).collect();
        BatchPage { complete: self.complete, incomplete: self.incomplete, scenes, rows: rows.collect() }.html()
    }
}
