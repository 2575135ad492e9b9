//! What can go wrong with a point cloud.

use std::path::{Path, PathBuf};

/// A point cloud that cannot be read.
#[derive(Debug, thiserror::Error)]
#[non_exhaustive]
pub enum PointsError {
    /// The file is not there or may not be read.
    #[error("cannot read the file ({source}): check the name and the permissions: {}", path.display())]
    Unreadable {
        /// The file.
        path: PathBuf,
        /// The system's answer.
        source: std::io::Error,
    },
    /// The content is damaged, truncated, or of a kind that is not read.
    #[error("not a readable LAS or LAZ file ({reason}): {}", path.display())]
    Damaged {
        /// The file.
        path: PathBuf,
        /// What was found.
        reason: String,
    },
    /// No point makes a surface.
    #[error("no point is left of {points} (noise and withheld points do not count): {}", path.display())]
    NoPoints {
        /// The file.
        path: PathBuf,
        /// Points read.
        points: u64,
    },
    /// More points than are held in memory.
    #[error("the cloud has {points} points, up to {most} are compared: thin it or cut it: {}", path.display())]
    TooManyPoints {
        /// The file.
        path: PathBuf,
        /// Points in the file.
        points: u64,
        /// The most.
        most: u64,
    },
    /// The grid would be far larger than the cloud.
    #[error(
        "the cloud's extent holds {cells:.0} cells of {cell} map units for {points} points, at most {most} are made: \
         use larger cells: {}", path.display()
    )]
    TooManyCells {
        /// The file.
        path: PathBuf,
        /// Cells of the extent.
        cells: f64,
        /// Side of a cell, map units.
        cell: f64,
        /// Points in the file.
        points: u64,
        /// The most cells for so many points.
        most: u64,
    },
    /// The coordinate reference system cannot be read.
    #[error("coordinate reference system ({source}): {}", path.display())]
    Crs {
        /// The file.
        path: PathBuf,
        /// What geodesy says.
        source: crs::CrsError,
    },
}

impl PointsError {
    pub(super) fn damaged(path: &Path, reason: impl ToString) -> Self {
        Self::Damaged { path: path.to_owned(), reason: reason.to_string() }
    }
}
