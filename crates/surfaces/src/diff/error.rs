//! Reasons why a change cannot be measured.

use std::path::PathBuf;

use change::ChangeError;
use crs::CrsError;
use eval::EvalError;
use formats::areas::AreaError;
use numeric::{Cancelled, failures};

use crate::eval::EvalJobError;
use job::error::{JobError, from_steps, job_errors};
use job::files::FileError;

/// A change that cannot be measured.
#[derive(Debug, thiserror::Error)]
pub(crate) enum DiffError {
    /// The surfaces cannot be read or brought together.
    #[error("cannot compare the second surface (test) with the first (reference)")]
    Surfaces(#[source] Box<EvalJobError>),
    /// The second surface cannot be moved onto the first.
    #[error("cannot move the second surface onto the first; compare them without a shift if they are aligned")]
    Alignment(#[source] EvalError),
    /// The first surface's coordinate reference system has no EPSG code.
    #[error("the first surface's coordinate system has no EPSG code: {}", path.display())]
    NoEpsg {
        /// The surface model.
        path: PathBuf,
    },
    /// The search for change was given a value that it cannot use.
    #[error(transparent)]
    Change(#[from] ChangeError),
    /// The polygons cannot be read.
    #[error(transparent)]
    Areas(#[from] AreaError),
    /// A coordinate reference system cannot be used.
    #[error(transparent)]
    Crs(#[from] CrsError),
    /// A setting, a file or the threads cannot be used, or the job was cancelled.
    #[error(transparent)]
    Job(#[from] JobError),
}

failures!(DiffError: Other {
    Self::Surfaces(error) => error.kind(),
    Self::Areas(error) => error.kind(),
    Self::Crs(error) => error.kind(),
    Self::Job(error) => error.kind(),
});

job_errors!(DiffError);

from_steps!(DiffError: Surfaces(EvalJobError), Job(FileError, Cancelled));
