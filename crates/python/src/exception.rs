//! Errors as exceptions of Python.

use pyo3::exceptions::PyRuntimeError;
use pyo3::prelude::*;

use crate::fault::Fault;

/// Makes the exception of an error.
pub(crate) fn raise(py: Python<'_>, fault: &Fault) -> PyErr {
    let class =
        || py.import("skysweep._errors")?.getattr(format!("{:?}Error", fault.kind))?.call1((fault.text.as_str(),));
    match class() {
        Ok(exception) => PyErr::from_value(exception),
        Err(_) => PyRuntimeError::new_err(fault.text.clone()),
    }
}
