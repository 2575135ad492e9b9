//! Errors of reading and writing RPC files.

use std::fmt;
use std::path::{Path, PathBuf};

use numeric::failures;

use super::format::RpcFormat;

/// A defect in the content of an RPC file, with the key and, in text formats, the number of the
/// line from 1.
#[derive(Debug, Clone, PartialEq, thiserror::Error)]
#[non_exhaustive]
pub enum Fault {
    /// A required entry is missing.
    #[error("{key} is missing, expected one entry")]
    Missing {
        /// The entry, as the format names it.
        key: String,
    },
    /// An entry occurs twice.
    #[error("{key} occurs a second time{}: remove one", At(.line))]
    Duplicate {
        /// The entry.
        key: String,
        /// Line.
        line: Option<usize>,
    },
    /// An entry that an RPC does not have, such as a 21st coefficient.
    #[error("{key} is not an entry of an RPC{}, expected 20 coefficients per polynomial", At(.line))]
    Extra {
        /// The entry.
        key: String,
        /// Line.
        line: Option<usize>,
    },
    /// Not a number.
    #[error("{key} is {text:?}{}, expected a number", At(.line))]
    NotANumber {
        /// The entry.
        key: String,
        /// Line.
        line: Option<usize>,
        /// The text found (its beginning).
        text: String,
    },
    /// A comma where the decimal point belongs.
    #[error("{key} is {text:?}{}: write the decimal separator as a point, not as a comma", At(.line))]
    DecimalComma {
        /// The entry.
        key: String,
        /// Line.
        line: Option<usize>,
        /// The text found.
        text: String,
    },
    /// NaN or an infinity.
    #[error("{key} is {value}{}, expected a finite number", At(.line))]
    NotFinite {
        /// The entry.
        key: String,
        /// Line.
        line: Option<usize>,
        /// The value.
        value: f64,
    },
    /// A scale of zero.
    #[error("{key} is zero, expected a scale other than zero")]
    ZeroScale {
        /// The entry.
        key: String,
    },
    /// All entries are numbers, but together they do not make a camera.
    #[error("{0}")]
    NoCamera(camera::RpcError),
    /// A list of coefficients of the wrong length.
    #[error("{key} has {found} values{}, expected {expected}", At(.line))]
    Count {
        /// The list.
        key: String,
        /// Line.
        line: Option<usize>,
        /// Number of values. Text formats stop counting at one more than `expected`.
        found: usize,
        /// Number of values required.
        expected: usize,
    },
    /// The file breaks the rules of its format.
    #[error("{what}{}", At(.line))]
    Syntax {
        /// The text found and the text expected.
        what: String,
        /// Line.
        line: Option<usize>,
    },
    /// Content that the format allows and this reader does not support.
    #[error("{what}")]
    Unsupported {
        /// The content, and what to do.
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

/// A format or place that was tried, and why it had no RPC.
#[derive(Debug, Clone, PartialEq, Eq)]
pub struct Attempt {
    /// The format, or the place looked at.
    pub what: String,
    /// The reason why there was no RPC.
    pub why: String,
}

impl Attempt {
    pub(super) fn new(what: impl fmt::Display, why: impl fmt::Display) -> Self {
        Self { what: what.to_string(), why: why.to_string() }
    }
}

/// An RPC that was not read.
#[derive(Debug, thiserror::Error)]
#[non_exhaustive]
pub enum RpcReadError {
    /// The file cannot be opened or read.
    #[error("cannot read {}", .path.display())]
    Io {
        /// The file.
        path: PathBuf,
        /// The error of the system.
        source: std::io::Error,
    },
    /// The path is a folder, pipe or device.
    #[error("expected a file, found a folder, pipe or device: {}", .path.display())]
    NotAFile {
        /// The path.
        path: PathBuf,
    },
    /// The text is larger than any RPC file.
    #[error("the file has {bytes} bytes, expected at most {limit} bytes of RPC text: {}", .path.display())]
    TooLarge {
        /// The file.
        path: PathBuf,
        /// Its size, bytes.
        bytes: u64,
        /// The limit, bytes.
        limit: u64,
    },
    /// No RPC in the file, nor beside it where it is an image.
    #[error("no RPC found (tried {}): {}", Tried(.tried), .path.display())]
    NotRpc {
        /// The file.
        path: PathBuf,
        /// The formats and places tried.
        tried: Vec<Attempt>,
    },
    /// The format was recognised, but its content is broken.
    #[error("{fault} in the RPC of {} (format {format}; formats tried before: {})", .path.display(), Tried(.tried))]
    Invalid {
        /// The file.
        path: PathBuf,
        /// The format.
        format: RpcFormat,
        /// The defect.
        fault: Box<Fault>,
        /// The formats tried before this one.
        tried: Vec<Attempt>,
    },
}

failures!(RpcReadError: File);

impl RpcReadError {
    pub(super) fn invalid(path: &Path, format: RpcFormat, fault: Fault, tried: Vec<Attempt>) -> Self {
        Self::Invalid { path: path.to_owned(), format, fault: Box::new(fault), tried }
    }
}

/// A list of attempts on one line.
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

/// A format of RPCs that can be read but not written.
#[derive(Debug, thiserror::Error)]
#[error("the format {format} can only be read: choose text, RPB or JSON")]
#[non_exhaustive]
pub struct ReadOnlyFormat {
    /// The format that was asked for.
    pub format: RpcFormat,
}

failures!(ReadOnlyFormat: File);
