//! Job files: the configuration of a job as TOML.
//!
//! Keys have the names of the fields of the configuration. Paths are relative to the file. A key
//! that no job has is an error that names the nearest known one. The `used_config.toml` of a run is
//! a job file. `${NAME}` in a path stands for the environment variable.

use std::cell::RefCell;
use std::path::{Path, PathBuf};

use numeric::{failures, nearest_name};
use serde::de::DeserializeOwned;

use crate::error::{JobError, from_failures};
use crate::files::read_text;
use crate::job_paths::resolved;
use crate::path_variables::expanded;

/// A job file that cannot be used.
#[derive(Debug, thiserror::Error)]
enum JobFileError {
    /// A key that the job does not have.
    #[error(
        "unknown key `{key}` (line {line}); {}: {}",
        nearest.as_ref().map_or_else(|| format!("known are {}", known.join(", ")), |n| format!("did you mean `{n}`?")),
        path.display()
    )]
    UnknownKey {
        /// The file.
        path: PathBuf,
        /// Line of the key, from 1.
        line: usize,
        /// The key.
        key: String,
        /// Known key that is most like it, if any is.
        nearest: Option<String>,
        /// Keys that are known in this place.
        known: Vec<String>,
    },
    /// Text that is not TOML, a value of the wrong type, or a missing key.
    #[error("{what} (line {line}): {}", path.display())]
    Invalid {
        /// The file.
        path: PathBuf,
        /// Line of the defect, from 1.
        line: usize,
        /// The text found and the text expected.
        what: String,
    },
    /// A path with an environment variable that is not set.
    #[error("{what}: {}", path.display())]
    Variable {
        /// The file.
        path: PathBuf,
        /// The variable and the path that names it.
        what: String,
    },
}

failures!(JobFileError: Input);

from_failures!(JobFileError);

/// Reads a configuration from a job file. `map_paths` replaces each path of the configuration: by
/// the path with its variables expanded, seen from the folder of the file.
///
/// # Errors
/// [`JobError`] for a file that cannot be read, for those of [`parse`], and for a path with a
/// variable that is not set.
pub fn read_job<T: DeserializeOwned>(
    path: &Path,
    map_paths: impl FnOnce(&mut T, &dyn Fn(&Path) -> PathBuf),
) -> Result<T, JobError> {
    let mut config: T = parse(&read_text(path)?, path)?;
    let folder = path.parent().unwrap_or(Path::new(""));
    let unset = RefCell::new(None);
    map_paths(&mut config, &|path: &Path| match expanded(path) {
        Ok(path) => resolved(&path, folder),
        Err(what) => {
            unset.borrow_mut().get_or_insert(what);
            path.to_owned()
        }
    });
    match unset.into_inner() {
        Some(what) => Err(JobFileError::Variable { path: path.to_owned(), what }.into()),
        None => Ok(config),
    }
}

/// Returns a path of the job file at `file` with its variables expanded.
///
/// # Errors
/// [`JobError`] for a variable that is not set.
pub fn with_variables(named: &Path, file: &Path) -> Result<PathBuf, JobError> {
    Ok(expanded(named).map_err(|what| JobFileError::Variable { path: file.to_owned(), what })?)
}

/// Whether a path has the ending of job files.
pub fn is_job_file(path: &Path) -> bool {
    path.extension().is_some_and(|extension| extension.eq_ignore_ascii_case("toml"))
}

/// Parses a configuration. `path` is the file for errors.
///
/// # Errors
/// [`JobError`] for a key that the job does not have, text that is not TOML, a value of the wrong
/// type, and a missing key.
pub fn parse<T: DeserializeOwned>(text: &str, path: &Path) -> Result<T, JobError> {
    let parsed = toml::from_str(text).map_err(|error| {
        let start = error.span().map_or(0, |span| span.start.min(text.len()));
        let line = 1 + text.as_bytes()[..start].iter().filter(|byte| **byte == b'\n').count();
        defect(error.message(), line, path)
    });
    Ok(parsed?)
}

/// Returns a defect, which serde describes as `message`, in the words of job files.
pub fn in_words(message: &str) -> String {
    match defect(message, 0, Path::new("")) {
        JobFileError::UnknownKey { key, nearest: Some(nearest), .. } => {
            format!("unknown key `{key}`; did you mean `{nearest}`?")
        }
        JobFileError::UnknownKey { key, known, .. } => format!("unknown key `{key}`; known are {}", known.join(", ")),
        JobFileError::Invalid { what, .. } | JobFileError::Variable { what, .. } => what,
    }
}

/// Makes the error of a defect, which serde describes as `message`.
fn defect(message: &str, line: usize, path: &Path) -> JobFileError {
    let path = path.to_owned();
    let mut quoted = message.split('`').skip(1).step_by(2).map(str::to_owned);
    if message.starts_with("unknown field")
        && let Some(key) = quoted.next()
    {
        let known: Vec<String> = quoted.collect();
        let nearest = nearest_name(&key, known.iter().map(String::as_str)).map(str::to_owned);
        return JobFileError::UnknownKey { path, line, key, nearest, known };
    }
    let mut what = message.trim().replace('\n', " ");
    if what.starts_with("unknown variant")
        && let Some(value) = quoted.next()
    {
        let known: Vec<String> = quoted.collect();
        if let Some(nearest) = nearest_name(&value, known.iter().map(String::as_str)) {
            what += &format!("; did you mean `{nearest}`?");
        }
    }
    JobFileError::Invalid { path, line, what }
}
