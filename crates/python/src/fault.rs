//! Errors of jobs as Python sees them: a text with all causes, and the class of the exception.

use std::error::Error;

use jobs::error_text::with_causes;
use numeric::{Failure, Kind};

/// An error on its way to Python.
#[derive(Debug)]
pub(crate) struct Fault {
    /// What kind of failure it is, which gives the class of the exception.
    pub(crate) kind: Kind,
    /// What happened, with all causes.
    pub(crate) text: String,
    /// Number of the system's error among the causes, if there is one.
    pub(crate) system_code: Option<i32>,
}

impl Fault {
    /// A setting that serde does not take.
    pub(crate) fn setting(text: String) -> Self {
        Self { kind: Kind::Input, text, system_code: None }
    }

    /// A defect of the program or of the system.
    pub(crate) fn internal(text: &str) -> Self {
        Self { kind: Kind::Other, text: text.to_owned(), system_code: None }
    }

    /// A value that cannot be used.
    pub(crate) fn input(error: &dyn Error) -> Self {
        Self::setting(with_causes(error))
    }
}

impl<E: Failure + 'static> From<E> for Fault {
    fn from(error: E) -> Self {
        Self { kind: error.kind(), text: with_causes(&error), system_code: system_code(&error) }
    }
}

/// Looks for the number of an error of the system among the causes.
fn system_code(error: &(dyn Error + 'static)) -> Option<i32> {
    let own = error.downcast_ref::<std::io::Error>().and_then(std::io::Error::raw_os_error);
    own.or_else(|| system_code(error.source()?))
}
