//! Why a training ends without a result.

use std::path::PathBuf;

use ::train::CheckpointDefect;
use crs::CrsError;
use formats::FormatError;
use formats::raster::RasterError;
use formats::rpc::RpcReadError;
use numeric::{Cancelled, failures};

use job::error::{JobError, SettingError, from_steps, job_errors};
use job::files::FileError;

/// A training that gives no splats.
#[derive(Debug, thiserror::Error)]
pub(crate) enum TrainError {
    /// A coordinate reference system cannot be used.
    #[error(transparent)]
    Crs(#[from] CrsError),
    /// A file of the dataset is not as the priors job writes it.
    #[error("{what}: {}", path.display())]
    Dataset {
        /// The file.
        path: PathBuf,
        /// What was found and what was expected.
        what: String,
    },
    /// No camera has an image.
    #[error("none of {cameras} cameras has an image, expected files with the cameras' names in {}", folder.display())]
    NoImages {
        /// Number of cameras.
        cameras: usize,
        /// The folder that was looked in.
        folder: PathBuf,
    },
    /// An image does not have the size of its camera or map.
    #[error("{what} has {found:?} columns and rows, its camera {expected:?}: {}", path.display())]
    Size {
        /// What was read.
        what: &'static str,
        /// The file.
        path: PathBuf,
        /// Columns and rows of the file.
        found: [usize; 2],
        /// Columns and rows of the camera.
        expected: [usize; 2],
    },
    /// A photograph has no mask.
    #[error("{name} has no mask, expected {expected} in {}: give a mask for every image", folder.display())]
    NoMask {
        /// Name of the image.
        name: String,
        /// File names that were looked for.
        expected: String,
        /// The folder that was looked in.
        folder: PathBuf,
    },
    /// A mask leaves nothing of a photograph.
    #[error("the mask of {name} is 0 everywhere, so that nothing is left of it: masks are 0 where images do not count")]
    EmptyMask {
        /// Name of the image.
        name: String,
    },
    /// A camera has a lens that cannot be laid over a pinhole.
    #[error("the lens of {name} ({model}) cannot be laid over a pinhole: undistort the images first")]
    Lens {
        /// Name of the image.
        name: String,
        /// Name of the lens model.
        model: &'static str,
    },
    /// There are no points to begin with.
    #[error("the dataset has {count} points, expected at least 4: {}", path.display())]
    NoPoints {
        /// Number of points.
        count: usize,
        /// The model.
        path: PathBuf,
    },
    /// A view that is to be held out is not there, or there are several of its name.
    #[error("{found} views have the name {name}, which is to be held out; expected one, named such as {expected:?}")]
    HeldOut {
        /// The name that was given.
        name: String,
        /// Number of views of that name.
        found: usize,
        /// Name of a view.
        expected: String,
    },
    /// No view is left to train on.
    #[error("all {count} views are to be held out, so that none is left to train on: hold out fewer")]
    NothingLeft {
        /// Number of views.
        count: usize,
    },
    /// The checkpoint cannot be used.
    #[error("cannot go on from the checkpoint; remove it to begin again: {}", path.display())]
    Checkpoint {
        /// The checkpoint.
        path: PathBuf,
        /// What is wrong with it.
        source: CheckpointDefect,
    },
    /// The checkpoint is of another dataset.
    #[error("the checkpoint has {found} views, this training {expected}; remove it to begin again: {}", path.display())]
    OtherViews {
        /// The checkpoint.
        path: PathBuf,
        /// Number of its views.
        found: usize,
        /// Number of views of this training.
        expected: usize,
    },
    /// A setting, a file or the threads cannot be used, or the job was cancelled.
    #[error(transparent)]
    Job(#[from] JobError),
}

failures!(TrainError: Other {
    Self::Crs(error) => error.kind(),
    Self::Job(error) => error.kind(),
});

job_errors!(TrainError);

from_steps!(
    TrainError: Job(FileError, SettingError, Cancelled, RasterError, RpcReadError, FormatError)
);
