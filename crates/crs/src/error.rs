//! Errors of coordinate reference systems.

use std::path::PathBuf;

use geodesy::GeodesyError;

/// A coordinate reference system, a projection or a height conversion that is not available.
#[derive(Debug, Clone, PartialEq, thiserror::Error)]
#[non_exhaustive]
pub enum CrsError {
    /// The text is not a CRS in a supported form.
    #[error(
        "'{text}' is not a coordinate reference system: expected an EPSG code (EPSG:32617 or 32617, \
         with +CODE for heights), 'utm' or 'auto'"
    )]
    UnknownCrs {
        /// The text as given.
        text: String,
    },
    /// The text is not a vertical datum.
    #[error(
        "'{text}' is not a vertical datum: expected 'ellipsoid', 'egm96', 'egm2008' or an EPSG code such as EPSG:5773"
    )]
    UnknownVerticalDatum {
        /// The text as given.
        text: String,
    },
    /// The CRS has no map coordinates.
    #[error("{crs} is {found}, which has no map: expected a projected CRS, such as the UTM zone of the scene")]
    NotAMap {
        /// The CRS.
        crs: String,
        /// Its kind and name in words.
        found: String,
    },
    /// The code of another kind of CRS is given as a vertical datum.
    #[error(
        "EPSG:{code} is {found}, expected a vertical datum: 'ellipsoid', 'egm96', 'egm2008' or the code of a vertical \
         CRS such as EPSG:5773"
    )]
    NotVertical {
        /// The code.
        code: u32,
        /// Kind and name of its CRS in words.
        found: String,
    },
    /// The position is not on the Earth or outside the map projection.
    #[error(transparent)]
    Position(#[from] GeodesyError),
    /// PROJ has no transformation between two systems.
    #[error(
        "no transformation from {source_crs} to {target_crs} ({reason}): name another CRS, or \
         install the grids that PROJ needs"
    )]
    NoTransformation {
        /// The system to transform from.
        source_crs: String,
        /// The system to transform to.
        target_crs: String,
        /// PROJ's message.
        reason: String,
    },
    /// The geoid grid that is needed is not installed.
    #[error(
        "heights above {datum} need {}, which PROJ does not find: put the file into one of the folders that PROJ \
         searches ({}); PROJ's tool projsync fetches grids by their names, and https://cdn.proj.org has them all",
        grids(.candidates),
        listed(.folders)
    )]
    MissingGrid {
        /// The datum requested.
        datum: String,
        /// The file names that were tried.
        candidates: String,
        /// The folders that PROJ searches.
        folders: Vec<PathBuf>,
    },
    /// The given geoid grid cannot be used.
    #[error(
        "the geoid grid cannot be used ({reason}), expected a GTX or GeoTIFF grid that PROJ reads: {}",
        path.display()
    )]
    UnusableGrid {
        /// The file.
        path: PathBuf,
        /// PROJ's message.
        reason: String,
    },
    /// Coordinate slices have different lengths.
    #[error("the coordinate slices have the lengths {lengths:?}, expected equal lengths")]
    LengthMismatch {
        /// The lengths found.
        lengths: Vec<usize>,
    },
}

/// Names folders.
fn listed(folders: &[PathBuf]) -> String {
    folders.iter().map(|folder| folder.display().to_string()).collect::<Vec<_>>().join(", ")
}

/// Names the grids of a list, which any of them serves.
fn grids(candidates: &str) -> String {
    let kind = if candidates.contains(", ") { "one of the geoid grids" } else { "the geoid grid" };
    format!("{kind} {candidates}")
}
