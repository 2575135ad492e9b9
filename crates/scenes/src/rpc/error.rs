//! Why an RPC job ends without a result.

use std::path::PathBuf;

use camera::{CameraError, FitError};
use io::raster::RasterError;
use io::rpc::{RpcReadError, RpcWriteError};

use job::corrections::CorrectionsError;
use job::error::from_steps;

/// An RPC job that could not be done.
#[derive(Debug, thiserror::Error)]
#[non_exhaustive]
pub enum RpcJobError {
    /// The file holds no RPC that can be used.
    #[error(transparent)]
    Read(Box<RpcReadError>),
    /// The RPC cannot be written.
    #[error(transparent)]
    Write(#[from] RpcWriteError),
    /// The ending of the output file belongs to no format.
    #[error(
        "no RPC format belongs to the ending of {}: expected .txt, .rpc, .rpb, .json or .tif, or a stated format",
        path.display()
    )]
    UnknownEnding {
        /// The output file.
        path: PathBuf,
    },
    /// The corrections cannot be read.
    #[error(transparent)]
    Corrections(#[from] CorrectionsError),
    /// The report has no correction of the image.
    #[error("the report has no pointing correction of {}: {}", path.display(), report.display())]
    NotCorrected {
        /// The image.
        path: PathBuf,
        /// The report, or the folder of the run.
        report: PathBuf,
    },
    /// No RPC includes the correction.
    #[error("no RPC includes the pointing correction")]
    Folded(#[from] FitError),
    /// The image cannot be written with another RPC.
    #[error(transparent)]
    Image(#[from] RasterError),
    /// The camera model has no answer for a point.
    #[error("the RPC has no answer for the point {point:?}")]
    NoAnswer {
        /// The three numbers of the query.
        point: [f64; 3],
        /// Reason given by the camera model.
        source: CameraError,
    },
    /// A file of points cannot be opened.
    #[error("cannot read the points of {}", path.display())]
    Points {
        /// The file.
        path: PathBuf,
        /// Reason given by the operating system.
        source: std::io::Error,
    },
    /// A line of the points cannot be read or does not hold three numbers.
    #[error("line {line} of the points")]
    Line {
        /// Number of the line, from 1.
        line: usize,
        /// What is wrong with it.
        source: LineFault,
    },
    /// The receiver of the answers failed.
    #[error("cannot pass on the answers")]
    Output(#[source] std::io::Error),
    /// The job was cancelled.
    #[error(transparent)]
    Cancelled(#[from] numeric::Cancelled),
}

from_steps!(RpcJobError: Read(RpcReadError));

/// What is wrong with a line of points.
#[derive(Debug, thiserror::Error)]
#[non_exhaustive]
pub enum LineFault {
    /// The line cannot be read.
    #[error("cannot read the line")]
    Unreadable(#[from] std::io::Error),
    /// The line is longer than three numbers can be.
    #[error("the line has {limit} characters or more, expected three numbers")]
    TooLong {
        /// Largest permitted length.
        limit: u64,
    },
    /// The line has fewer or more than three words.
    #[error("found {found:?}, expected three numbers")]
    NotThree {
        /// The line.
        found: String,
    },
    /// A word of the line is not a number.
    #[error("found {found:?}, expected a number")]
    NotANumber {
        /// The word.
        found: String,
    },
}
