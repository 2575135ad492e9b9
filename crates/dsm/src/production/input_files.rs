//! The files that a plan rests on, known by the hash of their content.
//!
//! A file with the size and the times that it had when it was planned is taken as unchanged. The
//! time of change is the system's own, and no program sets it. Only a file whose times differ, such
//! as a copy on another machine, is read again.

use std::collections::BTreeSet;
use std::fs::Metadata;
use std::path::{Path, PathBuf};

use rayon::prelude::*;
use serde::{Deserialize, Serialize};

use crate::production::content_hash;
use crate::production::error::ProductionError;
use crate::{DsmConfig, files_of};
use job::error::JobError;
use job::files::FileError;

/// A file that a plan rests on.
#[derive(Debug, Clone, PartialEq, Eq, Serialize, Deserialize)]
#[serde(deny_unknown_fields)]
#[non_exhaustive]
pub struct InputFile {
    /// The file.
    pub path: PathBuf,
    /// Size, bytes.
    pub bytes: u64,
    /// SHA-256 of the content.
    pub sha256: String,
    /// Times of modification and of change when it was planned, nanoseconds since 1970.
    pub times_ns: [i128; 2],
}

impl InputFile {
    /// Reads a file for its hash.
    ///
    /// # Errors
    /// [`FileError::Read`].
    pub fn of(path: &Path) -> Result<Self, FileError> {
        let failed = |source| FileError::Read { path: path.to_owned(), source };
        let found = path.metadata().map_err(failed)?;
        let sha256 = content_hash::of_file(path).map_err(failed)?;
        Ok(Self { path: path.to_owned(), bytes: found.len(), sha256, times_ns: times_ns(&found) })
    }

    fn is_unchanged(&self) -> Result<bool, FileError> {
        let failed = |source| FileError::Read { path: self.path.clone(), source };
        let found = self.path.metadata().map_err(failed)?;
        if found.len() != self.bytes {
            return Ok(false);
        }
        Ok(times_ns(&found) == self.times_ns || content_hash::of_file(&self.path).map_err(failed)? == self.sha256)
    }
}

/// Returns the files of a configuration: images with the files that belong to them, elevation and
/// city model, ground points, corrections. Addresses are not among them.
///
/// # Errors
/// [`JobError`] for a file that cannot be read.
pub fn inputs_of(config: &DsmConfig) -> Result<Vec<InputFile>, JobError> {
    Ok(stamped(config)?)
}

fn stamped(config: &DsmConfig) -> Result<Vec<InputFile>, ProductionError> {
    let files: Vec<PathBuf> = files_of(config)?.into_iter().collect();
    Ok(files.par_iter().map(|path| InputFile::of(path)).collect::<Result<_, _>>()?)
}

/// Returns a file that is not among the inputs, if there is one.
pub fn added<'a>(files: &'a BTreeSet<PathBuf>, inputs: &[InputFile]) -> Option<&'a PathBuf> {
    let is_same = |input: &InputFile, path: &Path| {
        input.path == path || input.path.canonicalize().ok().zip(path.canonicalize().ok()).is_some_and(|(a, b)| a == b)
    };
    files.iter().find(|path| !inputs.iter().any(|input| is_same(input, path)))
}

/// Compares files with what they were when they were planned.
///
/// # Errors
/// [`JobError`] for an input that was changed or is gone.
pub fn check_inputs(inputs: &[InputFile]) -> Result<(), JobError> {
    Ok(check(inputs)?)
}

/// Checks inputs as [`check_inputs`] does.
pub(super) fn check(inputs: &[InputFile]) -> Result<(), ProductionError> {
    inputs.par_iter().try_for_each(|input| {
        let changed = || ProductionError::InputChanged { path: input.path.clone() };
        if input.is_unchanged()? { Ok(()) } else { Err(changed()) }
    })
}

#[cfg(unix)]
fn times_ns(found: &Metadata) -> [i128; 2] {
    use std::os::unix::fs::MetadataExt;
    let ns = |seconds: i64, rest: i64| i128::from(seconds) * 1_000_000_000 + i128::from(rest);
    [ns(found.mtime(), found.mtime_nsec()), ns(found.ctime(), found.ctime_nsec())]
}

/// Without a time of change every file is read again.
#[cfg(not(unix))]
fn times_ns(_: &Metadata) -> [i128; 2] {
    [-1, -1]
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn content_counts_and_times_do_not() {
        let folder = tempfile::tempdir().unwrap();
        let path = folder.path().join("a");
        std::fs::write(&path, "old").unwrap();
        let input = InputFile::of(&path).unwrap();
        check(std::slice::from_ref(&input)).unwrap();
        std::fs::write(&path, "old").unwrap();
        check(std::slice::from_ref(&input)).unwrap();
        std::fs::write(&path, "new").unwrap();
        let changed = check(std::slice::from_ref(&input)).unwrap_err();
        assert!(matches!(changed, ProductionError::InputChanged { .. }), "{changed}");
        std::fs::remove_file(&path).unwrap();
        assert!(matches!(check(&[input]), Err(ProductionError::File(_))));
    }
}
