//! The errors of batches.

use std::path::PathBuf;

use job::error::{JobError, from_steps, job_errors};
use job::files::FileError;
use numeric::{Cancelled, failures};

/// The reason why a batch did not start, or stopped. A task that fails is no error.
#[derive(Debug, thiserror::Error)]
pub(crate) enum BatchError {
    /// The file names no scene.
    #[error("the batch has no scene; give at least one [[scene]] with a name and images: {}", path.display())]
    NoScene {
        /// The batch file.
        path: PathBuf,
    },
    /// The file names no output folder.
    #[error("the batch has no folder for its results; give the key `output`: {}", path.display())]
    NoOutput {
        /// The batch file.
        path: PathBuf,
    },
    /// A name that is no name of a folder.
    #[error("the scene name {name:?} cannot be the name of a folder; use letters, digits, - and _")]
    SceneName {
        /// The name.
        name: String,
    },
    /// Two scenes have one name.
    #[error("two scenes have the name {name:?}; each needs a folder of its own")]
    SameName {
        /// The name.
        name: String,
    },
    /// A scene has bounds and an area.
    #[error("the scene {name:?} has `bounds` and `area`, which both say where it is; give one of them")]
    TwoAreas {
        /// The name.
        name: String,
    },
    /// A scene that does not exist.
    #[error("the batch has no scene {name:?}; there are {known}")]
    UnknownScene {
        /// The name.
        name: String,
        /// Names of the scenes.
        known: String,
    },
    /// A task that does not exist.
    #[error("the scene {scene:?} asks for the task `{task}`, which is not known; known are {known}")]
    UnknownTask {
        /// Name of the scene.
        scene: String,
        /// The task.
        task: String,
        /// Known tasks.
        known: String,
    },
    /// Settings of a task that cannot be used.
    #[error("the task `{task}` of the scene {scene:?} has wrong settings: {what}")]
    Settings {
        /// Name of the scene.
        scene: String,
        /// The task.
        task: String,
        /// Text found and expected.
        what: String,
    },
    /// A limit that allows no work.
    #[error("the limit `{name}` is 0, expected 1 or more")]
    Limit {
        /// The limit.
        name: &'static str,
    },
    /// The batch file cannot be read, the output folder or a report cannot be written, or the batch
    /// was cancelled.
    #[error(transparent)]
    Job(#[from] JobError),
}

failures!(BatchError: Input { Self::Job(error) => error.kind() });

job_errors!(BatchError);

from_steps!(BatchError: Job(FileError, Cancelled));
