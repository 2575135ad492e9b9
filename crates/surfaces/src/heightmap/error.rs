//! Reasons why a height map cannot be made or unprojected.

use std::path::PathBuf;

use crs::CrsError;
use formats::FormatError;
use heightmap::HeightMapError;
use numeric::{Cancelled, Kind, failures};

use crate::camera_stand::StandError;
use crate::city_files::CitySurfaceError;
use job::error::{FileCrsError, JobError, from_steps, job_errors};
use job::files::FileError;

/// A height map that cannot be made or unprojected.
#[derive(Debug, thiserror::Error)]
pub(crate) enum HeightMapJobError {
    /// A camera cannot be used.
    #[error(transparent)]
    Stand(#[from] StandError),
    /// A raster cannot be read.
    #[error(transparent)]
    Raster(#[from] formats::raster::RasterError),
    /// The city model cannot serve as surface.
    #[error(transparent)]
    City(#[from] CitySurfaceError),
    /// A city model is in degrees.
    #[error("the model is in degrees, expected a projected coordinate system: {}", path.display())]
    InDegrees {
        /// The model.
        path: PathBuf,
    },
    /// A point cloud failed while it was read for several tiles.
    #[error("{reason}")]
    PointsStopped {
        /// What the reader reported.
        reason: String,
    },
    /// The source names no coordinate reference system.
    #[error("the file names no coordinate system: {}", path.display())]
    NoCrs {
        /// The file.
        path: PathBuf,
    },
    /// The coordinate reference system of a file cannot be used.
    #[error(transparent)]
    FileCrs(#[from] FileCrsError),
    /// Coordinates or heights cannot be converted.
    #[error(transparent)]
    Crs(#[from] CrsError),
    /// A position is not on the Earth.
    #[error(transparent)]
    Position(#[from] geodesy::GeodesyError),
    /// The tile cannot be made.
    #[error(transparent)]
    Tile(#[from] HeightMapError),
    /// The tile lies beside the source.
    #[error(
        "the map around {lat_deg:.5}° N, {lon_deg:.5}° E lies outside the source: it covers x {:.1} to {:.1}, y {:.1} to \
         {:.1}, and the source x {:.1} to {:.1}, y {:.1} to {:.1}{}: {}",
        tile[0], tile[2], tile[1], tile[3], source_extent[0], source_extent[2], source_extent[1], source_extent[3],
        if *is_swapped { "; with latitude and longitude exchanged it would lie inside" } else { "" }, path.display()
    )]
    OutsideSource {
        /// File of the source.
        path: PathBuf,
        /// Longitude of the camera, degrees.
        lon_deg: f64,
        /// Latitude of the camera, degrees.
        lat_deg: f64,
        /// Extent of the tile on the map of the source: x and y from, x and y to.
        tile: [f64; 4],
        /// Extent of the source.
        source_extent: [f64; 4],
        /// Whether a camera with latitude and longitude exchanged would stand on the source.
        is_swapped: bool,
    },
    /// The tile is empty.
    #[error("the source has no height anywhere in the tile: check position and coordinate systems")]
    EmptyTile,
    /// Another file has the name of a map of a list.
    #[error(
        "a file is in the way that is not the map asked for (other settings, or another source); choose another folder: {}",
        path.display()
    )]
    OtherMap {
        /// The file.
        path: PathBuf,
    },
    /// A worker thread stopped.
    #[error("a worker thread stopped while it made a map")]
    WorkerLost,
    /// The file is not a height map of skysweep.
    #[error("no height map of skysweep ({found}): {}", path.display())]
    NotAHeightMap {
        /// The file.
        path: PathBuf,
        /// What its metadata lacks.
        found: String,
    },
    /// The map has too many pixels.
    #[error("{width} x {height} pixels, at most 2^28 are read: {}", path.display())]
    TooLarge {
        /// The map.
        path: PathBuf,
        /// Columns.
        width: usize,
        /// Rows.
        height: usize,
    },
    /// The map has no place.
    #[error("no {missing}: {}", path.display())]
    NoPlace {
        /// The map.
        path: PathBuf,
        /// `georeference` or `coordinate system`.
        missing: &'static str,
    },
    /// Pixels of the map lie outside of its projection.
    #[error("{lost} pixels lie outside the map of their coordinate system")]
    PixelsOutside {
        /// How many.
        lost: usize,
    },
    /// No format belongs to the ending of the output.
    #[error("no format belongs to the ending of {}: expected {expected}", path.display())]
    UnknownEnding {
        /// The output.
        path: PathBuf,
        /// Endings that are known.
        expected: &'static str,
    },
    /// Splats cannot be written on the axes of the camera.
    #[error(
        "splats are turned by rotations, and the axes of the camera are mirrored: write splats on the axes of the world"
    )]
    MirroredAxes,
    /// Splats need a map in metres.
    #[error("the map is not in metres: {}", path.display())]
    NotInMetres {
        /// The map.
        path: PathBuf,
    },
    /// The splats cannot be made.
    #[error(transparent)]
    Splats(#[from] splats::SplatError),
    /// A setting, a file or the threads cannot be used, or the job was cancelled.
    #[error(transparent)]
    Job(#[from] JobError),
}

failures!(HeightMapJobError: Other {
    Self::OtherMap { .. } => Kind::OutputExists,
    Self::Stand(error) => error.kind(),
    Self::Raster(error) => error.kind(),
    Self::City(error) => error.kind(),
    Self::FileCrs(error) => error.kind(),
    Self::Crs(error) => error.kind(),
    Self::Tile(error) => error.kind(),
    Self::Job(error) => error.kind(),
});

job_errors!(HeightMapJobError {
    Self::NoCrs { .. } => Some("the coordinate system of the source"),
    Self::City(CitySurfaceError::NoSurface { .. }) => Some("the city model"),
    Self::Tile(HeightMapError::Bent { .. }) => Some("the bend of the map"),
    Self::Tile(HeightMapError::NotMetric { .. }) => Some("the coordinate system of the map"),
    Self::Tile(HeightMapError::NoDatum { .. }) => Some("the vertical datum of the source"),
    Self::Tile(HeightMapError::NoGround { .. }) => Some("the ground"),
    Self::MirroredAxes => Some("the axes of the splats"),
});

from_steps!(HeightMapJobError: Job(FileError, Cancelled, FormatError));
