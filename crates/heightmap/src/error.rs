//! Reasons why a height map cannot be made.

use crs::CrsError;
use geodesy::GeodesyError;
use numeric::failures;

/// A height map that cannot be made.
#[derive(Debug, Clone, PartialEq, thiserror::Error)]
#[non_exhaustive]
pub enum HeightMapError {
    /// The size or the resolution is out of range.
    #[error(
        "a tile of {size} x {size} pixels at {resolution_px_per_m} px/m: expected 1 to {most} pixels a side, and up to {widest_m} m"
    )]
    Tile {
        /// Pixels along each side.
        size: usize,
        /// Pixels per metre.
        resolution_px_per_m: f64,
        /// Most pixels along a side.
        most: usize,
        /// Longest side, metres.
        widest_m: f64,
    },
    /// The heading is not finite.
    #[error("the heading is {heading_deg}, expected degrees clockwise from north")]
    Heading {
        /// Heading that was given.
        heading_deg: f64,
    },
    /// The map of a CRS bends too much for an affine georeference.
    #[error(
        "EPSG:{epsg} bends the tile by {off_px:.3} px, at most {limit_px} px can be written as a geotransform: use the local map"
    )]
    Bent {
        /// The CRS asked for.
        epsg: u32,
        /// Largest error of a corner, pixels.
        off_px: f64,
        /// The limit.
        limit_px: f64,
    },
    /// The CRS is not a map in metres.
    #[error("EPSG:{epsg} is not a map in metres: use the local map, the UTM zone or another projected CRS")]
    NotMetric {
        /// The CRS asked for.
        epsg: u32,
    },
    /// The map between the tile and the source is not defined everywhere.
    #[error("the source's coordinate system is not defined over the whole tile: choose another source or position")]
    OutsideSource,
    /// PROJ has no grid for the vertical datum, or none at the tile.
    #[error(
        "heights above {datum} cannot be converted here (PROJ has no grid for them): install PROJ's grid, or \
         name the ellipsoid as the vertical datum to take them as they are"
    )]
    NoDatum {
        /// Vertical datum of the source.
        datum: String,
    },
    /// There is no surface under the camera.
    #[error(
        "the source has no height within {reach_m} m of the camera at {lon_deg}, {lat_deg}: use a terrain model, or give the camera a height"
    )]
    NoGround {
        /// Radius that was searched, metres.
        reach_m: f64,
        /// Longitude of the camera.
        lon_deg: f64,
        /// Latitude of the camera.
        lat_deg: f64,
    },
    /// A coordinate reference system that cannot be used.
    #[error(transparent)]
    Crs(#[from] CrsError),
    /// A position that is not on the Earth.
    #[error(transparent)]
    Position(#[from] GeodesyError),
}

failures!(HeightMapError: Other { Self::Crs(error) => error.kind() });
