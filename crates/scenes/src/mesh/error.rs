//! Why no mesh is made.

use std::path::PathBuf;

use formats::FormatError;
use formats::raster::RasterError;
use numeric::{Cancelled, failures};
use tsdf::FusionError;

use crate::train::TrainError;
use job::error::{JobError, SettingError, from_steps, job_errors};
use job::files::FileError;

/// A mesh that is not made.
#[derive(Debug, thiserror::Error)]
pub(crate) enum MeshJobError {
    /// The place of the dataset cannot be read.
    #[error(transparent)]
    Place(Box<TrainError>),
    /// An image cannot be read.
    #[error(transparent)]
    Image(#[from] RasterError),
    /// A map or an image has another size than its camera.
    #[error("{found:?} columns and rows, its camera has {expected:?}: {}", path.display())]
    Size {
        /// The file.
        path: PathBuf,
        /// Columns and rows of the file.
        found: Vec<usize>,
        /// Columns and rows of the camera.
        expected: [usize; 2],
    },
    /// A camera has a lens with distortion, through which splats are not drawn.
    #[error("the lens of {name} has distortion ({model}), expected a pinhole to draw splats: give depth maps instead")]
    Lens {
        /// Name of the image.
        name: String,
        /// Name of the lens model.
        model: &'static str,
    },
    /// No camera has a depth map.
    #[error("none of {cameras} cameras has a depth map: expected NAME.npy in {}", folder.display())]
    NoMaps {
        /// Number of cameras.
        cameras: usize,
        /// The folder that was looked in.
        folder: PathBuf,
    },
    /// The dataset has no mask of a camera.
    #[error("the dataset has no mask of {name}: {}", path.display())]
    NoMask {
        /// Name of the image.
        name: String,
        /// The file that was looked for.
        path: PathBuf,
    },
    /// The maps cannot be fused.
    #[error(transparent)]
    Fusion(#[from] FusionError),
    /// Nothing is left of the mesh.
    #[error("the mesh is empty: {triangles} triangles were found, in parts that are too small or seen too seldom")]
    Empty {
        /// Number of triangles before small parts were left out.
        triangles: usize,
    },
    /// The mesh cannot be compared with the reference.
    #[error("the mesh is written, but cannot be compared with the reference")]
    Comparison(#[source] Box<JobError>),
    /// A setting, a file or the threads cannot be used, or the job was cancelled.
    #[error(transparent)]
    Job(#[from] JobError),
}

failures!(MeshJobError: Other {
    Self::Place(error) => error.kind(),
    Self::Image(error) => error.kind(),
    Self::Comparison(error) => error.kind(),
    Self::Job(error) => error.kind(),
});

job_errors!(MeshJobError {
    Self::Place(error) => error.setting(),
});

impl From<TrainError> for MeshJobError {
    fn from(error: TrainError) -> Self {
        Self::Place(Box::new(error))
    }
}

from_steps!(MeshJobError: Job(FileError, SettingError, Cancelled, FormatError));
