//! The reasons that can end every job, and how the error of a job takes in the errors of its steps.

use std::error::Error;
use std::fmt;
use std::path::{Path, PathBuf};

use crs::{CrsError, MapProjection};
use formats::FormatError;
use formats::raster::RasterError;
use formats::rpc::RpcReadError;
use numeric::{Cancelled, Failure, Kind, failures};

use crate::files::FileError;

/// Implements `From` of the errors of steps for the error of a job. The variant that holds them
/// takes them through their own `From`: into [`JobError`], or into a box because they are several
/// times larger than the other variants.
#[macro_export]
macro_rules! from_steps {
    ($error:ident: $($variant:ident($($step:ty),+)),+ $(,)?) => {$($(
        impl From<$step> for $error {
            fn from(error: $step) -> Self {
                Self::$variant(error.into())
            }
        }
    )+)+};
}

pub use crate::from_steps;

/// Makes the error that the steps of a job pass to each other into the [`JobError`] that the job
/// returns. Variants that are about a setting or an input can name it.
#[macro_export]
macro_rules! job_errors {
    ($($error:ident $({ $($variant:pat => $setting:expr),+ $(,)? })?),+ $(,)?) => {$(
        impl From<$error> for $crate::error::JobError {
            fn from(error: $error) -> Self {
                let setting = error.setting();
                Self::new(error).about(setting)
            }
        }

        impl $error {
            /// Returns the setting or the input that the error is about, in words.
            pub(crate) fn setting(&self) -> Option<&'static str> {
                match self {
                    Self::Job(error) => error.setting(),
                    $($($variant => $setting,)+)?
                    _ => None,
                }
            }
        }
    )+};
}

pub use crate::job_errors;

/// Why a job ended without a result.
///
/// Its text and its causes are those of the step that failed. Callers that react to it match the
/// [`kind`](Failure::kind) and the [`setting`](Self::setting).
#[derive(Debug)]
pub struct JobError {
    kind: Kind,
    setting: Option<&'static str>,
    step: Box<dyn Error + Send + Sync>,
}

impl JobError {
    /// Makes the error of a job of the error of a step.
    pub fn new(step: impl Failure + Send + Sync + 'static) -> Self {
        Self { kind: step.kind(), setting: None, step: step.into() }
    }

    /// Names the setting or the input that the error is about, in words.
    #[must_use]
    pub fn about(self, setting: Option<&'static str>) -> Self {
        Self { setting, ..self }
    }

    /// Returns the setting or the input that the error is about, in words, such as "the cell size";
    /// `None` where it is about none, or where no caller has asked for it yet.
    pub fn setting(&self) -> Option<&'static str> {
        self.setting
    }

    /// Returns the error of the step that failed.
    pub fn step(&self) -> &(dyn Error + Send + Sync + 'static) {
        &*self.step
    }
}

impl fmt::Display for JobError {
    fn fmt(&self, f: &mut fmt::Formatter<'_>) -> fmt::Result {
        self.step.fmt(f)
    }
}

impl Error for JobError {
    fn source(&self) -> Option<&(dyn Error + 'static)> {
        self.step.source()
    }
}

impl Failure for JobError {
    fn kind(&self) -> Kind {
        self.kind
    }
}

impl From<SettingError> for JobError {
    fn from(error: SettingError) -> Self {
        let name = error.name;
        Self::new(error).about(Some(name))
    }
}

/// Takes in the errors of steps that are alike in every job.
macro_rules! from_failures {
    ($($error:ty),+ $(,)?) => {$(
        impl From<$error> for $crate::error::JobError {
            fn from(error: $error) -> Self {
                Self::new(error)
            }
        }
    )+};
}

pub(crate) use from_failures;

from_failures!(FileError, Cancelled, RasterError, RpcReadError, FormatError, CrsError);

/// A setting outside of its range.
#[derive(Debug, thiserror::Error)]
#[error("{name} is {found}, expected {expected}")]
#[non_exhaustive]
pub struct SettingError {
    /// Name of the setting in words.
    pub name: &'static str,
    /// Value that was given.
    pub found: String,
    /// Values that are accepted.
    pub expected: String,
}

failures!(SettingError: Input);

impl SettingError {
    /// Makes the error of a setting with the value `found`.
    pub fn new(name: &'static str, found: impl ToString, expected: impl Into<String>) -> Self {
        Self { name, found: found.to_string(), expected: expected.into() }
    }
}

/// The coordinate reference system of a file cannot be used.
#[derive(Debug, thiserror::Error)]
#[error("cannot use the coordinate reference system of the file: {}", path.display())]
#[non_exhaustive]
pub struct FileCrsError {
    /// The file.
    pub path: PathBuf,
    /// What is wrong with the coordinate reference system.
    pub source: CrsError,
}

failures!(FileCrsError: Crs { Self { source, .. } => source.kind() });

impl FileCrsError {
    /// Reads a definition that the file at `path` states.
    pub fn projection(path: &Path, definition: &str) -> Result<MapProjection, Self> {
        MapProjection::from_definition(definition).map_err(|source| Self { path: path.to_owned(), source })
    }
}
