//! Reasons why a viewer cannot be opened.

use std::path::PathBuf;

use formats::FormatError;
use formats::areas::AreaError;
use formats::raster::RasterError;
use numeric::{Kind, failures};

use job::error::{JobError, SettingError, from_steps, job_errors};

/// A viewer that cannot be opened.
#[derive(Debug, thiserror::Error)]
pub(crate) enum ViewError {
    /// A raster cannot be read.
    #[error(transparent)]
    Raster(#[from] RasterError),
    /// Vectors cannot be read.
    #[error(transparent)]
    Vectors(#[from] AreaError),
    /// Vectors cannot be laid into the system of the map.
    #[error("the vectors cannot be laid into the coordinate system of the map ({what}): {}", path.display())]
    VectorPlace {
        /// The file.
        path: PathBuf,
        /// What is in the way.
        what: String,
    },
    /// A folder holds no raster that can be shown.
    #[error("found no GeoTIFF to show, expected the folder of a run, or a raster: {}", path.display())]
    NoRasters {
        /// The folder.
        path: PathBuf,
    },
    /// A file of splats or a mesh is too large for a browser.
    #[error(
        "found {found} {what}, a browser can show {most}: make a smaller file (a budget of a training, a coarser mesh): {}",
        path.display()
    )]
    TooLarge {
        /// The file.
        path: PathBuf,
        /// What it has.
        what: &'static str,
        /// How many it has.
        found: u64,
        /// How many may be shown.
        most: u64,
    },
    /// A mesh cannot be read.
    #[error("the mesh cannot be read: {}", path.display())]
    Mesh {
        /// The file.
        path: PathBuf,
        /// Reason given by the operating system.
        source: std::io::Error,
    },
    /// One picture of a raster would take too long.
    #[error(
        "the raster of {columns} × {rows} cells has no overviews that fit: one picture would read {megacells} million \
         cells. Add overviews (gdaladdo -r average FILE), or make a Cloud-Optimised GeoTIFF of it (gdal_translate -of \
         COG FILE NEW): {}",
        path.display()
    )]
    NoOverviews {
        /// The raster.
        path: PathBuf,
        /// Its columns.
        columns: usize,
        /// Its rows.
        rows: usize,
        /// Cells that one picture would need, millions.
        megacells: u64,
    },
    /// The port cannot be used.
    #[error("cannot listen on port {port} of 127.0.0.1: choose another port, or none")]
    Port {
        /// The port; 0 is one that the system chooses.
        port: u16,
        /// Reason given by the operating system.
        source: std::io::Error,
    },
    /// The system gives no random numbers for the token of the address.
    #[error("the system gives no random numbers, which the address of the viewer needs: {reason}")]
    Token {
        /// Reason given by the operating system.
        reason: String,
    },
    /// A thread that answers requests cannot be started.
    #[error("cannot start a thread that answers requests")]
    Thread(#[source] std::io::Error),
    /// The browser cannot be started.
    #[error("cannot start a browser: open the address yourself")]
    Browser(#[source] std::io::Error),
    /// A setting cannot be used, or the job was cancelled.
    #[error(transparent)]
    Job(#[from] JobError),
}

failures!(ViewError: Other {
    Self::Mesh { .. } => Kind::File,
    Self::Raster(error) => error.kind(),
    Self::Vectors(error) => error.kind(),
    Self::Job(error) => error.kind(),
});

job_errors!(ViewError { Self::Port { .. } => Some("the port") });

from_steps!(ViewError: Job(SettingError, FormatError));
