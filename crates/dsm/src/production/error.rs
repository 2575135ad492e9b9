//! The errors of planned runs.

use std::path::PathBuf;

use crate::DsmError;
use job::error::{JobError, job_errors};
use job::files::FileError;
use numeric::{Kind, failures};

/// The reason why a planned run ended without a result.
#[derive(Debug, thiserror::Error)]
pub(crate) enum ProductionError {
    /// A stage of the surface model failed.
    #[error(transparent)]
    Dsm(#[from] DsmError),
    /// A file of the run folder cannot be read or written.
    #[error(transparent)]
    File(#[from] FileError),
    /// The configuration in the run folder cannot be read, the worker threads cannot be started, or
    /// a step that is a job of its own ended without a result.
    #[error(transparent)]
    Job(#[from] JobError),
    /// The folder has no plan.
    #[error("the folder has no plan; plan the run first: {}", path.display())]
    NoPlan {
        /// Place of the plan.
        path: PathBuf,
    },
    /// The plan cannot be read, or is not as it was written.
    #[error("cannot use the plan ({reason}); plan the run again: {}", path.display())]
    Plan {
        /// The plan.
        path: PathBuf,
        /// Cause.
        reason: String,
    },
    /// The plan was made by another version of the program, whose results may differ.
    #[error("the plan was made by version {planned} and this is {here}; plan again or use that version: {}", path.display())]
    OtherVersion {
        /// The plan.
        path: PathBuf,
        /// Version that made the plan.
        planned: String,
        /// Version of this program.
        here: String,
    },
    /// The plan is another one than the caller knows.
    #[error("the plan was replaced during the run; run again: {}", path.display())]
    OtherPlan {
        /// The plan.
        path: PathBuf,
    },
    /// The configuration has changed since the plan was made.
    #[error("the configuration was changed after the plan was made; resume the run to plan again: {}", path.display())]
    ConfigChanged {
        /// The configuration.
        path: PathBuf,
    },
    /// An input has changed since the plan was made.
    #[error(
        "an input has another content than when the plan was made; bring the old file back, or resume the run to plan \
         and compute again: {}", path.display()
    )]
    InputChanged {
        /// The input.
        path: PathBuf,
    },
    /// A file has appeared beside an image since the plan was made.
    #[error(
        "a file that belongs to an image was not there when the plan was made; remove it, or resume the run to plan \
         and compute again: {}", path.display()
    )]
    InputAdded {
        /// The file.
        path: PathBuf,
    },
    /// Chunks have no result yet.
    #[error(
        "{} of {count} chunks have no result ({}); compute them, or allow a partial result, which is void there",
        missing.len(), numbers(missing)
    )]
    ChunksMissing {
        /// Numbers of the chunks, from 0.
        missing: Vec<usize>,
        /// Number of chunks in the plan.
        count: usize,
    },
    /// The result of a chunk is not as it was written.
    #[error(
        "the result of chunk {chunk} was damaged after it was computed: {what}; run the plan again, which computes \
         the chunk again, or allow a partial result, which is void there"
    )]
    ChunkDamaged {
        /// Number of the chunk, from 0.
        chunk: usize,
        /// The file, what it is and what was expected.
        what: String,
    },
    /// No chunk has a surface.
    #[error("no chunk has a surface; the first failed: {reason}")]
    NothingDone {
        /// Cause of the first failure.
        reason: String,
    },
}

failures!(ProductionError: Other {
    Self::Dsm(error) => error.kind(),
    Self::File(error) => error.kind(),
    Self::Job(error) => error.kind(),
    Self::OtherPlan { .. } => Kind::Input,
    Self::NoPlan { .. } | Self::Plan { .. } => Kind::File,
});

job_errors!(ProductionError {
    Self::Dsm(error) => error.setting(),
    Self::NoPlan { .. } => Some("the plan"),
    Self::OtherVersion { .. }
    | Self::ConfigChanged { .. }
    | Self::InputChanged { .. }
    | Self::InputAdded { .. } => Some("what the plan rests on"),
    Self::ChunksMissing { .. } => Some("the chunks"),
});

impl ProductionError {
    /// Returns whether another process has the folder for itself.
    pub(super) fn is_in_use(&self) -> bool {
        matches!(self, Self::File(FileError::InUse { .. }) | Self::Dsm(DsmError::InUse { .. }))
    }

    /// Returns whether a part of what the plan rests on has changed, so that it must be made again.
    pub(crate) fn is_change(&self) -> bool {
        matches!(
            self,
            Self::OtherVersion { .. }
                | Self::ConfigChanged { .. }
                | Self::InputChanged { .. }
                | Self::InputAdded { .. }
        )
    }
}

/// Returns numbers as text, the first few of many.
pub(crate) fn numbers(all: &[usize]) -> String {
    const SHOWN: usize = 12;
    let mut text = all.iter().take(SHOWN).map(usize::to_string).collect::<Vec<_>>().join(", ");
    if all.len() > SHOWN {
        text += ", …";
    }
    text
}
