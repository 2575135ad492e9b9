//! The map of a surface model: by its EPSG code where it has one, else by its WKT. Height maps lie
//! on maps of their own, which have no code.

use crs::{Crs, CrsError, MapProjection};
use formats::raster::{CogCrs, Dem};

/// The horizontal CRS of a surface model.
#[derive(Debug, Clone, PartialEq)]
pub(crate) enum MapCrs {
    /// Its EPSG code.
    Epsg(u32),
    /// Its definition as WKT.
    Wkt(String),
}

impl MapCrs {
    /// Returns the map of a surface model; `None` if the file names none.
    pub(crate) fn of(dem: &Dem) -> Option<Self> {
        dem.horizontal_epsg.map(Self::Epsg).or_else(|| dem.crs_wkt.clone().map(Self::Wkt))
    }

    /// Returns the projection of the map.
    pub(crate) fn projection(&self) -> Result<MapProjection, CrsError> {
        match self {
            Self::Epsg(code) => MapProjection::from_epsg(*code),
            Self::Wkt(wkt) => MapProjection::from_definition(wkt),
        }
    }

    /// Returns the CRS of a raster on the map whose heights, if any, are above the ellipsoid.
    pub(crate) fn ellipsoidal(&self) -> CogCrs<'_> {
        match self {
            Self::Epsg(code) => Crs::ellipsoidal(*code).into(),
            Self::Wkt(wkt) => CogCrs::Wkt(wkt),
        }
    }
}
