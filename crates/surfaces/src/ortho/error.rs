//! Reasons why an ortho cannot be made.

use std::path::PathBuf;

use crs::CrsError;
use formats::raster::RasterError;
use formats::rpc::RpcReadError;
use numeric::{Cancelled, failures};

use job::error::{JobError, SettingError, from_steps, job_errors};
use job::files::FileError;

/// An ortho that cannot be made.
#[derive(Debug, thiserror::Error)]
pub(crate) enum OrthoError {
    /// The surface model names no coordinate reference system.
    #[error("the surface model has no coordinate reference system: {}", path.display())]
    NoCrs {
        /// The surface model.
        path: PathBuf,
    },
    /// The surface model is empty.
    #[error("the surface model has no heights: {}", path.display())]
    NoHeights {
        /// The surface model.
        path: PathBuf,
    },
    /// Coordinates or heights cannot be converted.
    #[error(transparent)]
    Crs(#[from] CrsError),
    /// An image does not see the surface.
    #[error("the image does not see the surface model: {}", path.display())]
    NotSeen {
        /// The image.
        path: PathBuf,
        /// What the geometry of the image lacks.
        source: occlusion::EyelineError,
    },
    /// Images have different numbers of bands.
    #[error("{found} bands, expected the {expected} of the first image: {}", path.display())]
    Bands {
        /// The image.
        path: PathBuf,
        /// Its bands.
        found: usize,
        /// Bands of the first image.
        expected: usize,
    },
    /// The area has no cells or too many.
    #[error("from {low} to {high} there are {cells} cells of {cell} units of the map, expected 1 to 2^28")]
    Extent {
        /// Lower bound on the map.
        low: f64,
        /// Upper bound on the map.
        high: f64,
        /// Number of cells.
        cells: f64,
        /// Side of a cell, units of the map.
        cell: f64,
    },
    /// The ortho does not fit in memory.
    #[error("{width} x {height} cells of {bands} bands, at most 2^28 in all: choose a smaller area or larger cells")]
    TooLarge {
        /// Columns.
        width: usize,
        /// Rows.
        height: usize,
        /// Bands.
        bands: usize,
    },
    /// No image shows any cell of the area.
    #[error(
        "no image shows the area: of its {cells} cells {heights} have a height in the surface model; \
         check that the area is in the coordinates of the surface model"
    )]
    NothingSeen {
        /// Cells of the area.
        cells: usize,
        /// Cells with a height.
        heights: usize,
    },
    /// The grey values cannot be brought together.
    #[error("the grey values of the images cannot be brought together")]
    Balance(#[from] ortho::BalanceError),
    /// A setting, a file or the threads cannot be used, or the job was cancelled.
    #[error(transparent)]
    Job(#[from] JobError),
}

failures!(OrthoError: Other {
    Self::Crs(error) => error.kind(),
    Self::Job(error) => error.kind(),
});

job_errors!(OrthoError {
    Self::Balance(_) => Some("the balance of grey values"),
    Self::TooLarge { .. } => Some("the area"),
});

from_steps!(OrthoError: Job(SettingError, FileError, Cancelled, RasterError, RpcReadError));
