//! Reasons why products cannot be made.

use std::path::PathBuf;

use crs::CrsError;
use formats::raster::RasterError;
use numeric::{Cancelled, Failure, Kind, failures};

use job::error::{JobError, SettingError, from_steps, job_errors};
use job::files::FileError;

/// Products that cannot be made.
#[derive(Debug, thiserror::Error)]
pub(crate) enum ProductsError {
    /// The folder is not that of a finished run.
    #[error("expected the folder of a finished DSM run, found no {}", missing.display())]
    NotARun {
        /// The file that is missing.
        missing: PathBuf,
    },
    /// A raster of the run cannot be read.
    #[error(transparent)]
    Raster(#[from] RasterError),
    /// A raster lies on another grid than the surface.
    #[error("{found:?} cells, the surface model has {expected:?}: {}", path.display())]
    OtherGrid {
        /// The raster.
        path: PathBuf,
        /// Its columns and rows.
        found: (usize, usize),
        /// Columns and rows of the surface.
        expected: (usize, usize),
    },
    /// The surface is larger than fits into memory.
    #[error("{width} x {height} cells, at most 2^28: make the surface model in parts or with larger cells")]
    TooLarge {
        /// Columns.
        width: usize,
        /// Rows.
        height: usize,
    },
    /// The surface model's coordinate reference system has no EPSG code.
    #[error("the surface model's coordinate system has no EPSG code: {}", path.display())]
    NoEpsg {
        /// The surface model.
        path: PathBuf,
    },
    /// The surface has no triangle.
    #[error("no four neighbouring cells have heights, expected a surface for the mesh: {}", path.display())]
    NoTriangles {
        /// The surface model.
        path: PathBuf,
    },
    /// The ortho has no georeference.
    #[error("the ortho has no georeference, expected the map of the surface model: {}", path.display())]
    OrthoPlace {
        /// The ortho.
        path: PathBuf,
    },
    /// The ortho does not show the surface.
    #[error("the ortho shows no cell of the surface model; is it in the same coordinate system? {}", path.display())]
    OrthoElsewhere {
        /// The ortho.
        path: PathBuf,
    },
    /// The images of the run cannot be found.
    #[error("cannot find the images of the run for an ortho; give an ortho, or the settings of the run")]
    Images(#[source] Box<JobError>),
    /// The ortho cannot be made.
    #[error("cannot make the ortho that colours the products; an ortho can be given instead")]
    Ortho(#[source] Box<JobError>),
    /// The terrain model cannot be made.
    #[error("cannot make the terrain model")]
    Dtm(#[source] Box<JobError>),
    /// The classes cannot be found.
    #[error("cannot find the classes of the surface model")]
    Classes(#[source] Box<JobError>),
    /// The coordinate reference system cannot be used.
    #[error(transparent)]
    Crs(#[from] CrsError),
    /// A setting, a file or the threads cannot be used, or the job was cancelled.
    #[error(transparent)]
    Job(#[from] JobError),
}

failures!(ProductsError: Other {
    Self::Raster(error) => error.kind(),
    Self::Images(error) => error.kind(),
    Self::Ortho(error) => error.kind(),
    Self::Dtm(error) => error.kind(),
    Self::Classes(error) => error.kind(),
    Self::Crs(error) => error.kind(),
    Self::Job(error) => error.kind(),
});

job_errors!(ProductsError {
    Self::Images(_) | Self::Ortho(_) | Self::OrthoElsewhere { .. } => Some("the ortho"),
});

from_steps!(ProductsError: Job(SettingError, FileError, Cancelled));

impl ProductsError {
    /// Takes the error of the job that makes a product. A job that was cancelled is wrapped in
    /// nothing.
    pub(super) fn of(error: JobError, wrapped: fn(Box<JobError>) -> Self) -> Self {
        if error.kind() == Kind::Cancelled { Self::Job(error) } else { wrapped(Box::new(error)) }
    }
}
