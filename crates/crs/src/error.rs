//! Errors of coordinate reference systems.

use std::path::PathBuf;

use geodesy::GeodesyError;
use numeric::{Kind, failures};

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
         searches ({}), or allow grids to be fetched from https://cdn.proj.org",
        grids(.candidates),
        listed(.folders)
    )]
    MissingGrid {
        /// The datum requested.
        datum: String,
        /// The names of the files, any of which serves; empty where PROJ's database names none.
        candidates: Vec<String>,
        /// The folders that PROJ searches.
        folders: Vec<PathBuf>,
    },
    /// The geoid grid that is needed is not installed and cannot be fetched.
    #[error("the geoid grid {name}, which PROJ does not find, cannot be fetched: {reason}")]
    GridNotFetched {
        /// Name of the file.
        name: String,
        /// What failed, in words.
        reason: String,
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

failures!(CrsError: Crs { Self::MissingGrid { .. } => Kind::GridMissing });

/// Names folders.
fn listed(folders: &[PathBuf]) -> String {
    folders.iter().map(|folder| folder.display().to_string()).collect::<Vec<_>>().join(", ")
}

/// Names the grids of a list, which any of them serves.
fn grids(candidates: &[String]) -> String {
    match candidates {
        [] => "a geoid grid that PROJ's tool projinfo names".to_owned(),
        [one] => format!("the geoid grid {one}"),
        several => format!("one of the geoid grids {}", several.join(", ")),
    }
}
