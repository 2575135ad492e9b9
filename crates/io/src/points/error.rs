//! Why a point cloud was not read.

use std::path::{Path, PathBuf};

use numeric::failures;

/// Why a point cloud was not read.
#[derive(Debug, thiserror::Error)]
#[non_exhaustive]
pub enum PointsError {
    /// The system cannot read the file.
    #[error("cannot read the file ({source}), check its name and permissions: {}", path.display())]
    Unreadable {
        /// Path of the file.
        path: PathBuf,
        /// Error of the system.
        source: std::io::Error,
    },
    /// The file is damaged, truncated, or of a kind that is not supported.
    #[error("the file is not a readable LAS or LAZ file ({reason}): {}", path.display())]
    Damaged {
        /// Path of the file.
        path: PathBuf,
        /// What was found, and what was expected.
        reason: String,
    },
    /// No point is left.
    #[error("none of the {points} points can be used (noise and withheld points do not count): {}", path.display())]
    NoPoints {
        /// Path of the file.
        path: PathBuf,
        /// Number of points read.
        points: u64,
    },
    /// The cloud has more points than are held in memory.
    #[error("the cloud has {points} points, at most {most} are read, thin it or cut it: {}", path.display())]
    TooManyPoints {
        /// Path of the file.
        path: PathBuf,
        /// Number of points in the file.
        points: u64,
        /// Largest number of points.
        most: u64,
    },
    /// The grid would have many more cells than the cloud has points.
    #[error(
        "the extent of the cloud has {cells:.0} cells of {cell} map units for {points} points, \
         the limit is {most} cells, use larger cells: {}", path.display()
    )]
    TooManyCells {
        /// Path of the file.
        path: PathBuf,
        /// Number of cells of the extent.
        cells: f64,
        /// Side of a cell, map units.
        cell: f64,
        /// Number of points in the file.
        points: u64,
        /// Largest number of cells for this number of points.
        most: u64,
    },
    /// The coordinate reference system cannot be read.
    #[error("the coordinate reference system cannot be read ({source}): {}", path.display())]
    Crs {
        /// Path of the file.
        path: PathBuf,
        /// Error of the crate `crs`.
        source: crs::CrsError,
    },
}

failures!(PointsError: File { Self::Crs { source, .. } => source.kind() });

impl PointsError {
    pub(super) fn damaged(path: &Path, reason: impl ToString) -> Self {
        Self::Damaged { path: path.to_owned(), reason: reason.to_string() }
    }
}
