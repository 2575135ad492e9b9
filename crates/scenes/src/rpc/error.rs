//! Why an RPC job ends without a result.

use std::path::PathBuf;

use camera::{CameraError, FitError};
use formats::FormatError;
use formats::raster::RasterError;
use formats::rpc::{ReadOnlyFormat, RpcReadError};
use numeric::{Kind, failures};

use job::error::{JobError, SettingError, from_steps, job_errors};
use job::files::FileError;
use job::image_files::ImageFilesError;

/// An RPC job that could not be done.
#[derive(Debug, thiserror::Error)]
pub(crate) enum RpcJobError {
    /// The file holds no RPC that can be used.
    #[error(transparent)]
    Read(Box<RpcReadError>),
    /// The RPC cannot be written in a format.
    #[error(transparent)]
    Write(#[from] ReadOnlyFormat),
    /// The ending of the output file belongs to no format.
    #[error(
        "no RPC format belongs to the ending of {}: expected .txt, .rpc, .rpb, .json or .tif, or a stated format",
        path.display()
    )]
    UnknownEnding {
        /// The output file.
        path: PathBuf,
    },
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
    /// A folder or a pattern gives no images.
    #[error(transparent)]
    Images(#[from] ImageFilesError),
    /// There is no image to export.
    #[error("no image was given, expected images with RPCs or the folder of a DSM run")]
    NoImages,
    /// The range of heights is not known.
    #[error("the range of heights is not known: give it, or the folder of a DSM run with its surface model")]
    NoHeights,
    /// An image does not say where the sun stood.
    #[error("the image does not say where the sun stood, which the dataset needs: {}", path.display())]
    NoSun {
        /// The image.
        path: PathBuf,
    },
    /// An image does not show the ground of the surface model.
    #[error("the image does not show the ground of the surface model: {}", path.display())]
    Outside {
        /// The image.
        path: PathBuf,
    },
    /// An image is too large for a dataset.
    #[error(
        "the image has {} x {} pixels, expected at most 64 million: give the folder of a DSM run, whose ground the \
         images are cut to: {}", size[0], size[1], path.display()
    )]
    TooLarge {
        /// The image.
        path: PathBuf,
        /// Columns and rows.
        size: [usize; 2],
    },
    /// Two images have one name.
    #[error("two images are called {name}, expected different names, which name the files of the dataset")]
    SameName {
        /// The name without its ending.
        name: String,
    },
    /// The output folder holds files.
    #[error("the output folder is not empty: {}", path.display())]
    NotEmpty {
        /// The folder.
        path: PathBuf,
    },
    /// A text of the dataset cannot be written.
    #[error(transparent)]
    Text(#[from] formats::atomic::SaveError),
    /// A setting or a file cannot be used.
    #[error(transparent)]
    Job(#[from] JobError),
    /// The job was cancelled.
    #[error(transparent)]
    Cancelled(#[from] numeric::Cancelled),
}

failures!(RpcJobError: Other {
    Self::NotEmpty { .. } => Kind::OutputExists,
    Self::Points { .. } | Self::Output(_) => Kind::File,
    Self::Line { source, .. } => source.kind(),
    Self::Read(error) => error.kind(),
    Self::Write(error) => error.kind(),
    Self::Image(error) => error.kind(),
    Self::Images(error) => error.kind(),
    Self::Text(error) => error.kind(),
    Self::Job(error) => error.kind(),
    Self::Cancelled(error) => error.kind(),
});

job_errors!(RpcJobError {
    Self::UnknownEnding { .. } => Some("the format"),
    Self::NoHeights => Some("the range of heights of the images"),
    Self::NoSun { .. } => Some("the sun"),
    Self::NotEmpty { .. } => Some("the output folder"),
});

from_steps!(RpcJobError: Read(RpcReadError), Job(FileError, SettingError, FormatError));

/// What is wrong with a line of points.
#[derive(Debug, thiserror::Error)]
pub(crate) enum LineFault {
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

failures!(LineFault: Other { Self::Unreadable(_) => Kind::File });
