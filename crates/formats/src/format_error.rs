//! The one error of the readers and writers whose callers need no more than its kind.

use std::error::Error;
use std::fmt;
use std::path::{Path, PathBuf};

use numeric::{Failure, Kind};

use crate::atomic::SaveError;

/// A file that was not read, or not written.
///
/// Its text says what was found and what was expected, and ends with the path. Callers that react
/// to it match the [`kind`](Failure::kind).
#[derive(Debug)]
pub struct FormatError {
    kind: Kind,
    path: PathBuf,
    step: Box<dyn Error + Send + Sync>,
}

/// What is wrong with a file.
#[derive(Debug, thiserror::Error)]
#[error("{what}: {}", path.display())]
struct Defect {
    what: String,
    path: PathBuf,
    source: Option<Box<dyn Error + Send + Sync>>,
}

impl FormatError {
    /// Makes the error of a file at `path` of what was found and expected in it.
    pub fn new(path: &Path, what: impl fmt::Display) -> Self {
        Self::with_source(path, what, None)
    }

    /// Makes the error of a file at `path` that the system cannot read; `what` names its content.
    pub fn unreadable(path: &Path, what: &str, source: std::io::Error) -> Self {
        Self::because(path, format!("cannot read {what} ({source})"), source)
    }

    /// Makes the error of a file at `path` that has a cause.
    pub fn because(path: &Path, what: impl fmt::Display, source: impl Error + Send + Sync + 'static) -> Self {
        Self::with_source(path, what, Some(Box::new(source)))
    }

    /// Makes the error of a file at `path` of another one, whose text, causes and kind it takes.
    pub fn of(path: &Path, error: impl Failure + Send + Sync + 'static) -> Self {
        Self { kind: error.kind(), path: path.to_owned(), step: Box::new(error) }
    }

    /// Says that the error is of another kind than that of files that cannot be read or written.
    #[must_use]
    pub fn of_kind(self, kind: Kind) -> Self {
        Self { kind, ..self }
    }

    /// Returns the path of the file.
    pub fn path(&self) -> &Path {
        &self.path
    }

    fn with_source(path: &Path, what: impl fmt::Display, source: Option<Box<dyn Error + Send + Sync>>) -> Self {
        let defect = Defect { what: what.to_string(), path: path.to_owned(), source };
        Self { kind: Kind::File, path: path.to_owned(), step: Box::new(defect) }
    }
}

impl fmt::Display for FormatError {
    fn fmt(&self, f: &mut fmt::Formatter<'_>) -> fmt::Result {
        self.step.fmt(f)
    }
}

impl Error for FormatError {
    fn source(&self) -> Option<&(dyn Error + 'static)> {
        self.step.source()
    }
}

impl Failure for FormatError {
    fn kind(&self) -> Kind {
        self.kind
    }
}

impl From<SaveError> for FormatError {
    fn from(error: SaveError) -> Self {
        let path = error.path().to_owned();
        Self::of(&path, error)
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn an_error_has_the_text_the_causes_and_the_kind_of_its_step() {
        let path = Path::new("a.npy");
        let system = || std::io::Error::other("no disk");
        let error = FormatError::unreadable(path, "the file", system());
        assert_eq!((error.kind(), error.path()), (Kind::File, path));
        assert_eq!(error.to_string(), "cannot read the file (no disk): a.npy");
        assert_eq!(error.source().unwrap().to_string(), "no disk");
        let error = FormatError::new(path, format_args!("{} axes", 40));
        assert!(error.to_string() == "40 axes: a.npy" && error.source().is_none());
        let saved = || SaveError::Exists { path: path.to_owned() };
        let error = FormatError::from(saved());
        assert_eq!((error.kind(), error.path()), (Kind::OutputExists, path));
        assert!(error.to_string() == saved().to_string() && error.source().is_none());
    }
}
