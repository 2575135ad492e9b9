//! What can go wrong between coordinate reference systems.

use std::path::PathBuf;

use geodesy::GeodesyError;

/// A coordinate reference system, a projection or a height conversion that cannot be had.
#[derive(Debug, Clone, PartialEq, thiserror::Error)]
#[non_exhaustive]
pub enum CrsError {
    /// The text names no CRS in a form that is read here.
    #[error(
        "'{text}' is no coordinate reference system: expected an EPSG code (EPSG:32617 or 32617, with +CODE for heights), 'utm' or 'auto'"
    )]
    UnknownCrs {
        /// The text as given.
        text: String,
    },
    /// The text names no vertical datum.
    #[error(
        "'{text}' is no vertical datum: expected 'ellipsoid', 'egm96', 'egm2008' or an EPSG code such as EPSG:5773"
    )]
    UnknownVerticalDatum {
        /// The text as given.
        text: String,
    },
    /// A position that is not on the Earth, or that the map does not hold.
    #[error(transparent)]
    Position(#[from] GeodesyError),
    /// PROJ knows no way between two systems.
    #[error(
        "no transformation from {source_crs} to {target_crs} ({reason}): name another CRS, or install the grids that PROJ asks for"
    )]
    NoTransformation {
        /// Where from.
        source_crs: String,
        /// Where to.
        target_crs: String,
        /// PROJ's own words.
        reason: String,
    },
    /// A geoid grid is needed and not installed.
    #[error(
        "heights above {datum} need one of the geoid grids {candidates}, and none was found: put one into ~/.local/share/proj or into PROJ's own folder, or give its path (PROJ_DATA replaces the folders that PROJ searches: list its own there too)"
    )]
    MissingGrid {
        /// The datum asked for.
        datum: String,
        /// File names that were tried.
        candidates: String,
    },
    /// A geoid grid named by the user cannot be used.
    #[error("the geoid grid cannot be used ({reason}): expected a GTX or GeoTIFF grid that PROJ reads: {}", path.display())]
    UnusableGrid {
        /// The file as named.
        path: PathBuf,
        /// PROJ's own words.
        reason: String,
    },
    /// Coordinate slices have different lengths.
    #[error("coordinate slices of lengths {lengths:?}: expected equal lengths")]
    LengthMismatch {
        /// The lengths found.
        lengths: Vec<usize>,
    },
}
