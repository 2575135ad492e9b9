//! Reasons why a class raster cannot be made.

use std::path::PathBuf;

use classes::ClassifyError;
use formats::raster::RasterError;
use numeric::{Cancelled, failures};
use terrain::TerrainError;

use crate::dtm::DtmError;
use crate::eval::EvalJobError;
use crate::ortho::OrthoError;
use job::error::{JobError, SettingError, from_steps, job_errors};
use job::files::FileError;

/// A class raster that cannot be made.
#[derive(Debug, thiserror::Error)]
pub(crate) enum ClassesError {
    /// The surface model cannot be used.
    #[error(transparent)]
    Surface(#[from] DtmError),
    /// Hardly any cell shows the ground, so that nothing can be said to stand on it.
    #[error(
        "{cells} of {heights} cells with heights show the ground, expected one in a hundred: without ground there are \
         no classes; use a surface that reaches open ground, or fit the search for the ground: {}",
        path.display()
    )]
    NoGround {
        /// The surface model.
        path: PathBuf,
        /// Cells that show the ground.
        cells: usize,
        /// Cells with heights.
        heights: usize,
    },
    /// The vegetation index cannot be read at the cells of the surface.
    #[error("cannot use the vegetation index")]
    Index(#[source] Box<EvalJobError>),
    /// A multispectral image does not say which bands are red and near infrared.
    #[error(
        "the image has {bands} bands and does not say which are red and near infrared: name the bands, in their \
         descriptions or in the settings: {}",
        path.display()
    )]
    NoIndexBands {
        /// The image.
        path: PathBuf,
        /// Number of its bands.
        bands: usize,
    },
    /// A multispectral image cannot be laid on the surface.
    #[error(transparent)]
    Ortho(Box<OrthoError>),
    /// The building index cannot be read at the cells of the surface.
    #[error("cannot use the building index")]
    Cue(#[source] Box<EvalJobError>),
    /// The building index holds a value that is none.
    #[error("the building index holds {found}, expected 0 to 1: {}", path.display())]
    CueRange {
        /// The raster.
        path: PathBuf,
        /// A value that it holds.
        found: f32,
    },
    /// The search for the ground was given a value that it cannot use.
    #[error(transparent)]
    Terrain(TerrainError),
    /// The search for classes was given a value that it cannot use.
    #[error(transparent)]
    Classify(#[from] ClassifyError),
    /// A setting, a file or the threads cannot be used, or the job was cancelled.
    #[error(transparent)]
    Job(#[from] JobError),
}

failures!(ClassesError: Other {
    Self::Surface(error) => error.kind(),
    Self::Index(error) => error.kind(),
    Self::Ortho(error) => error.kind(),
    Self::Cue(error) => error.kind(),
    Self::Job(error) => error.kind(),
});

job_errors!(ClassesError {
    Self::NoIndexBands { .. } => Some("the bands of the vegetation index"),
});

from_steps!(
    ClassesError: Index(EvalJobError),
    Job(FileError, SettingError, Cancelled, RasterError),
);

impl From<OrthoError> for ClassesError {
    fn from(error: OrthoError) -> Self {
        match error {
            OrthoError::Job(job) => Self::Job(job),
            other => Self::Ortho(other.into()),
        }
    }
}

impl From<TerrainError> for ClassesError {
    fn from(error: TerrainError) -> Self {
        match error {
            TerrainError::Cancelled(cancelled) => cancelled.into(),
            other => Self::Terrain(other),
        }
    }
}
