//! Batches: many scenes, each with its tasks, in one run that survives the night.
//!
//! A batch file names scenes (images, area, settings) and what is to be made of each. A scene that
//! cannot be computed does not stop the others. A batch that is killed goes on where it was: a task
//! whose settings, inputs and product are as they were is left alone.

mod batch_file;
mod batch_report;
mod error;
mod record;
mod run;
mod scene_summary;
mod task;
mod task_log;
mod tasks_of_scene;

pub use batch_file::{BatchConfig, BatchDefaults, BatchLimits, BatchScene, read_batch};
pub use batch_report::{BatchReport, SceneReport, TaskReport, TaskState};
pub use run::{look, run};
pub use task::{TaskKind, TaskSettings};

/// A commented batch file with every key.
pub const BATCH_TEMPLATE: &str = include_str!("batch.toml");

/// A commented batch file that computes one patch with several settings.
pub const STUDY_TEMPLATE: &str = include_str!("study.toml");
