//! Why an alignment ends without a result.

use std::path::PathBuf;

use colmap::align::AlignError;
use crs::CrsError;
use formats::FormatError;
use formats::raster::RasterError;
use geodesy::GeodesyError;
use numeric::{Cancelled, failures};

use job::error::{JobError, from_steps, job_errors};
use job::files::FileError;

/// An alignment that could not be made.
#[derive(Debug, thiserror::Error)]
pub(crate) enum AlignJobError {
    /// The threshold is not a positive number.
    #[error("the threshold of the residuals is {threshold_m}, expected a number of metres above 0")]
    Threshold {
        /// The threshold.
        threshold_m: f64,
    },
    /// A standard deviation of the noise is negative or not finite.
    #[error("a level of noise is {level}, expected a number from 0 on")]
    NoiseLevel {
        /// The level, metres or degrees.
        level: f64,
    },
    /// The CRS or the vertical datum cannot be used.
    #[error(transparent)]
    Crs(#[from] CrsError),
    /// A position has no UTM zone.
    #[error(transparent)]
    Geodesy(#[from] GeodesyError),
    /// The positions are map coordinates of a map that is not named.
    #[error("the positions are map coordinates, or there are none: the EPSG code of their map is needed")]
    UnknownMap,
    /// The CRS is not projected in metres.
    #[error("EPSG:{epsg} is not projected in metres: choose another reference system")]
    NotMetres {
        /// EPSG code of the CRS.
        epsg: u32,
    },
    /// A map to align over is not projected in metres.
    #[error("the map is not projected in metres, which an alignment is made in: warp it first: {map}")]
    MapNotInMetres {
        /// Name of the map.
        map: String,
    },
    /// A map to align over has no place in the world.
    #[error("the map has no coordinate system, so nothing can be brought to the world with it")]
    MapNotPlaced,
    /// A model has no points to lay over a map.
    #[error("the model has no points3D, which are laid over the map: {}", path.display())]
    NoPoints {
        /// Folder of the model.
        path: PathBuf,
    },
    /// More pairs than a person picks.
    #[error("found {found} pairs, at most {most} can be saved")]
    TooManyPairs {
        /// Number of pairs.
        found: usize,
        /// Most pairs.
        most: usize,
    },
    /// A photograph cannot be read.
    #[error(transparent)]
    Picture(#[from] RasterError),
    /// A photograph cannot be made a picture of a page.
    #[error("the photograph cannot be shown ({reason}): {}", path.display())]
    Photograph {
        /// The file.
        path: PathBuf,
        /// Why not.
        reason: String,
    },
    /// An image has two positions.
    #[error("image {image:?} has two positions: keep one")]
    TwoPositions {
        /// Name of the image.
        image: String,
    },
    /// No position belongs to the model.
    #[error("none of the positions is of an image of the model: compare the names")]
    NothingKnown,
    /// The positions do not determine a similarity.
    #[error("{pairs} of the positions are of the model's images")]
    Alignment {
        /// Number of positions that the model knows.
        pairs: usize,
        /// Why there is no similarity.
        source: AlignError,
    },
    /// A setting, a file or the threads cannot be used, or the job was cancelled.
    #[error(transparent)]
    Job(#[from] JobError),
}

failures!(AlignJobError: Other {
    Self::Crs(error) => error.kind(),
    Self::Picture(error) => error.kind(),
    Self::Job(error) => error.kind(),
});

job_errors!(AlignJobError {
    Self::Threshold { .. } => Some("the threshold of the residuals"),
    Self::UnknownMap => Some("the map of the positions"),
    Self::NotMetres { .. } => Some("the reference system"),
});

from_steps!(AlignJobError: Job(FileError, Cancelled, FormatError));
