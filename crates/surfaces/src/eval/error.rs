//! Reasons why an evaluation cannot be made.

use std::path::PathBuf;

use crs::{CrsError, VerticalDatum};
use formats::FormatError;
use numeric::{Cancelled, Kind, failures};

use job::error::{FileCrsError, JobError, SettingError, from_steps, job_errors};
use job::files::FileError;

/// An evaluation that cannot be made.
#[derive(Debug, thiserror::Error)]
pub(crate) enum EvalJobError {
    /// A raster cannot be read.
    #[error(transparent)]
    Raster(#[from] formats::raster::RasterError),
    /// The coordinate reference system of a file cannot be used.
    #[error(transparent)]
    FileCrs(#[from] FileCrsError),
    /// Coordinates or heights cannot be converted.
    #[error(transparent)]
    Crs(#[from] CrsError),
    /// One file names its vertical datum and the other does not.
    #[error(
        "the {known}'s heights are above {datum}, the {unknown} does not say what its own are above: name its vertical datum"
    )]
    DatumUnknown {
        /// The file that names its datum: `test` or `reference`.
        known: &'static str,
        /// The file that does not.
        unknown: &'static str,
        /// The datum that is named.
        datum: VerticalDatum,
    },
    /// Heights are to be converted without a known position.
    #[error(
        "heights can be converted from {from} to {to} only in a known coordinate system, there is none: {}",
        path.display()
    )]
    NoCrsForHeights {
        /// The file.
        path: PathBuf,
        /// Datum of its heights.
        from: VerticalDatum,
        /// Datum that is wanted.
        to: VerticalDatum,
    },
    /// A class raster, a mask or a raster of buildings cannot be used.
    #[error("the {what} raster {found}: {}", path.display())]
    NumberRaster {
        /// `class`, `mask` or `building`.
        what: &'static str,
        /// What is wrong with it.
        found: String,
        /// The file.
        path: PathBuf,
    },
    /// A raster is not on the grid of the test.
    #[error("the raster has another grid ({found}) than the test ({expected}): {}", path.display())]
    OtherGrid {
        /// The raster.
        path: PathBuf,
        /// Its grid.
        found: String,
        /// Grid of the test.
        expected: String,
    },
    /// Surfaces are compared in metres only.
    #[error(
        "the coordinates are not in metres ({definition}), and surfaces are compared in metres: project it first: {}",
        path.display()
    )]
    NotInMetres {
        /// The file.
        path: PathBuf,
        /// Its coordinate reference system.
        definition: String,
    },
    /// Points lie outside of a map projection.
    #[error("{lost} points cannot be converted from {from} to {to}: {}", path.display())]
    PointsLost {
        /// The file.
        path: PathBuf,
        /// How many points.
        lost: usize,
        /// Coordinate reference system of the file.
        from: String,
        /// Coordinate reference system that is wanted.
        to: String,
    },
    /// Two maps do not come from one camera.
    #[error("the test has {test}, the reference {reference}: expected maps of one camera")]
    MapShapes {
        /// Shape of the test in words.
        test: String,
        /// Shape of the reference in words.
        reference: String,
    },
    /// The kind of a map cannot be found from its shape, or does not fit it.
    #[error("a map has {channels} numbers a pixel, expected {expected}: {}", path.display())]
    MapChannels {
        /// The map.
        path: PathBuf,
        /// Numbers a pixel.
        channels: usize,
        /// Numbers that are accepted.
        expected: &'static str,
    },
    /// Grids cannot be compared.
    #[error(transparent)]
    Grids(#[from] eval::EvalError),
    /// Surfaces cannot be compared.
    #[error(transparent)]
    Surfaces(#[from] eval::SurfaceError),
    /// Maps cannot be compared.
    #[error(transparent)]
    Maps(#[from] eval::MapSizeError),
    /// Files that no evaluation wrote would be replaced.
    #[error("a file is in the way that no evaluation wrote; choose another folder: {}", path.display())]
    ForeignFile {
        /// The file.
        path: PathBuf,
    },
    /// An error map needs an EPSG code.
    #[error("an error map takes the coordinate system of the reference, which has no EPSG code")]
    NoEpsgForErrorMap,
    /// A picture cannot be made.
    #[error(transparent)]
    Picture(#[from] report::PictureError),
    /// A setting, a file or the threads cannot be used, or the job was cancelled.
    #[error(transparent)]
    Job(#[from] JobError),
}

failures!(EvalJobError: Other {
    Self::ForeignFile { .. } => Kind::OutputExists,
    Self::Raster(error) => error.kind(),
    Self::FileCrs(error) => error.kind(),
    Self::Crs(error) => error.kind(),
    Self::Job(error) => error.kind(),
});

job_errors!(EvalJobError {
    Self::DatumUnknown { unknown: "test", .. } => Some("the vertical datum of the test"),
    Self::DatumUnknown { .. } => Some("the vertical datum of the reference"),
    Self::NoEpsgForErrorMap => Some("the error map"),
    Self::MapChannels { .. } => Some("the kind of the maps"),
    Self::Grids(eval::EvalError::SkipWithoutClasses) => Some("the classes"),
});

from_steps!(EvalJobError: Job(SettingError, FileError, Cancelled, FormatError));
