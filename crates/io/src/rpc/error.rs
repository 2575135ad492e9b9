//! Why no RPC came out of a file, or none went into one.

use std::fmt;
use std::path::{Path, PathBuf};

use super::RpcFormat;
use crate::atomic::SaveError;

/// What is wrong with the content of a file, with the key and the line it was found on (text formats, from 1).
#[derive(Debug, Clone, PartialEq, thiserror::Error)]
#[non_exhaustive]
pub enum Fault {
    /// A required entry is not there.
    #[error("{key} is missing")]
    Missing {
        /// The entry, as this format names it.
        key: String,
    },
    /// An entry occurs twice.
    #[error("{key} occurs a second time{}", At(.line))]
    Duplicate {
        /// The entry.
        key: String,
        /// Where.
        line: Option<usize>,
    },
    /// An entry that an RPC does not have, such as a 21st coefficient.
    #[error("{key} is no entry of an RPC{}: a polynomial has the coefficients 1 to 20", At(.line))]
    Extra {
        /// The entry.
        key: String,
        /// Where.
        line: Option<usize>,
    },
    /// Not a number.
    #[error("{key} is {text:?}{}, expected a number", At(.line))]
    NotANumber {
        /// The entry.
        key: String,
        /// Where.
        line: Option<usize>,
        /// What stands there (its beginning).
        text: String,
    },
    /// A comma where the decimal point belongs.
    #[error("{key} is {text:?}{}: write the decimal point as a point, not as a comma", At(.line))]
    DecimalComma {
        /// The entry.
        key: String,
        /// Where.
        line: Option<usize>,
        /// What stands there.
        text: String,
    },
    /// NaN or an infinity.
    #[error("{key} is {value}{}, expected a finite number", At(.line))]
    NotFinite {
        /// The entry.
        key: String,
        /// Where.
        line: Option<usize>,
        /// The value.
        value: f64,
    },
    /// A scale of zero.
    #[error("{key} is zero: a scale divides, so the RPC cannot be used")]
    ZeroScale {
        /// The entry.
        key: String,
    },
    /// All entries are there and are numbers, and together they are no camera.
    #[error("{0}")]
    NoCamera(camera::RpcError),
    /// A list of coefficients of the wrong length.
    #[error("{key} has {found} values{}, expected {expected}", At(.line))]
    Count {
        /// The list.
        key: String,
        /// Where.
        line: Option<usize>,
        /// How many there are; counting stops one past what is expected in text formats.
        found: usize,
        /// How many there should be.
        expected: usize,
    },
    /// The file breaks the rules of its format.
    #[error("{what}{}", At(.line))]
    Syntax {
        /// What was found and expected.
        what: String,
        /// Where.
        line: Option<usize>,
    },
    /// Something the format allows and this reader does not know how to honour.
    #[error("{what}")]
    Unsupported {
        /// What, and what to do.
        what: String,
    },
}

/// ` (line 7)` where the line is known.
struct At<'a>(&'a Option<usize>);

impl fmt::Display for At<'_> {
    fn fmt(&self, f: &mut fmt::Formatter<'_>) -> fmt::Result {
        self.0.map_or(Ok(()), |line| write!(f, " (line {line})"))
    }
}

/// A format that was tried and why it was not that.
#[derive(Debug, Clone, PartialEq, Eq)]
pub struct Attempt {
    /// The format, or the place looked at.
    pub what: String,
    /// Why there was no RPC.
    pub why: String,
}

impl Attempt {
    pub(super) fn new(what: impl fmt::Display, why: impl fmt::Display) -> Self {
        Self { what: what.to_string(), why: why.to_string() }
    }
}

/// Why no RPC was read.
#[derive(Debug, thiserror::Error)]
#[non_exhaustive]
pub enum RpcReadError {
    /// The file cannot be opened or read.
    #[error("cannot read {}", .path.display())]
    Io {
        /// The file.
        path: PathBuf,
        /// The reason.
        source: std::io::Error,
    },
    /// A folder, pipe or device.
    #[error("expected a file, found something else: {}", .path.display())]
    NotAFile {
        /// What was given.
        path: PathBuf,
    },
    /// Too large to be RPC text.
    #[error("the file has {bytes} bytes, RPC text is read up to {limit} bytes: {}", .path.display())]
    TooLarge {
        /// The file.
        path: PathBuf,
        /// Its size.
        bytes: u64,
        /// The limit.
        limit: u64,
    },
    /// No known format in the file, and none beside it where it is an image.
    #[error("no RPC found (tried {}): {}", Tried(.tried), .path.display())]
    NotRpc {
        /// The file.
        path: PathBuf,
        /// What was tried.
        tried: Vec<Attempt>,
    },
    /// The format was recognised and its content is broken.
    #[error("{fault} in the RPC of {} (format {format}; formats ruled out before: {})", .path.display(), Tried(.tried))]
    Invalid {
        /// The file.
        path: PathBuf,
        /// The format.
        format: RpcFormat,
        /// What is wrong.
        fault: Box<Fault>,
        /// The formats that were ruled out before this one.
        tried: Vec<Attempt>,
    },
}

impl RpcReadError {
    pub(super) fn invalid(path: &Path, format: RpcFormat, fault: Fault, tried: Vec<Attempt>) -> Self {
        Self::Invalid { path: path.to_owned(), format, fault: Box::new(fault), tried }
    }
}

/// The list of attempts in one line.
struct Tried<'a>(&'a [Attempt]);

impl fmt::Display for Tried<'_> {
    fn fmt(&self, f: &mut fmt::Formatter<'_>) -> fmt::Result {
        if self.0.is_empty() {
            return f.write_str("none");
        }
        for (i, attempt) in self.0.iter().enumerate() {
            let separator = if i == 0 { "" } else { "; " };
            write!(f, "{separator}{}: {}", attempt.what, attempt.why)?;
        }
        Ok(())
    }
}

/// Why an RPC was not written.
#[derive(Debug, thiserror::Error)]
#[non_exhaustive]
pub enum RpcWriteError {
    /// The format is read only.
    #[error("cannot write {format}: choose text, rpb or json")]
    Format {
        /// The format asked for.
        format: RpcFormat,
    },
    /// The file was not written.
    #[error(transparent)]
    NotWritten(#[from] SaveError),
}
