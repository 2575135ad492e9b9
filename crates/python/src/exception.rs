//! Errors as exceptions of Python.

use std::path::Path;

use numeric::Kind;
use pyo3::exceptions::PyRuntimeError;
use pyo3::prelude::*;

use crate::fault::Fault;

/// Makes the exception of an error.
pub(crate) fn raise(py: Python<'_>, fault: &Fault) -> PyErr {
    raise_about(py, fault, &[])
}

/// Makes the exception of an error that may be about one of some paths, as they were given.
///
/// Errors of files have `errno` and `filename`, as those of Python's own functions. The file is the
/// longest path that the text names; it is missing when it does not exist now.
pub(crate) fn raise_about(py: Python<'_>, fault: &Fault, paths: &[&Path]) -> PyErr {
    match exception(py, fault, paths) {
        Ok(exception) => PyErr::from_value(exception),
        Err(_) => PyRuntimeError::new_err(fault.text.clone()),
    }
}

fn exception<'py>(py: Python<'py>, fault: &Fault, paths: &[&Path]) -> PyResult<Bound<'py, PyAny>> {
    let errors = py.import("skysweep._errors")?;
    let text = fault.text.as_str();
    let plain = match fault.kind {
        Kind::Input => Some("InputError"),
        Kind::Crs | Kind::GridMissing => Some("CrsError"),
        Kind::Cancelled => Some("CancelledError"),
        Kind::File | Kind::RemoteRefused | Kind::OutputExists | Kind::InUse => None,
        _ => Some("SkysweepError"),
    };
    if let Some(class) = plain {
        return errors.getattr(class)?.call1((text,));
    }
    let named = paths.iter().filter(|path| path.to_str().is_some_and(|path| names(text, path)));
    let path = named.max_by_key(|path| path.as_os_str().len());
    let is_missing = |path: &&&Path| path.symlink_metadata().is_err_and(|e| e.kind() == std::io::ErrorKind::NotFound);
    let code = |name: &str| py.import("errno")?.getattr(name)?.extract::<i32>();
    let (class, code) = match fault.kind {
        Kind::OutputExists => ("OutputExistsError", Some(code("EEXIST")?)),
        Kind::InUse => ("InUseError", Some(code("EBUSY")?)),
        _ if path.as_ref().is_some_and(is_missing) => ("FileMissingError", Some(code("ENOENT")?)),
        _ => ("FileError", fault.system_code),
    };
    let class = errors.getattr(class)?;
    match (code, path) {
        (Some(code), Some(path)) => class.call1((code, text, path.as_os_str())),
        (Some(code), None) => class.call1((code, text)),
        // Errors of formats are not errors of the system, and have no number.
        (None, path) => {
            let error = class.call1((text,))?;
            if let Some(path) = path {
                error.setattr("filename", path.as_os_str())?;
            }
            Ok(error)
        }
    }
}

/// Returns whether a text of an error names a path: after a colon or a word that leads to a name,
/// and up to the end of the name. A path such as `a` occurs in every text otherwise.
fn names(text: &str, path: &str) -> bool {
    const BEFORE: [&str; 6] = [": ", "read ", "open ", "of ", "'", "\""];
    const AFTER: [char; 6] = [':', '/', '\'', '"', ' ', ')'];
    !path.is_empty()
        && text.match_indices(path).any(|(at, found)| {
            let (before, after) = (&text[..at], &text[at + found.len()..]);
            BEFORE.iter().any(|lead| before.ends_with(lead)) && (after.is_empty() || after.starts_with(AFTER))
        })
}
