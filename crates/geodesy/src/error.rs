//! What can go wrong with positions.

/// A position that is not on the Earth, or that a map does not hold.
#[derive(Debug, Clone, PartialEq, thiserror::Error)]
#[non_exhaustive]
pub enum GeodesyError {
    /// Longitude or latitude is not a position on the Earth.
    #[error("longitude {lon_deg}, latitude {lat_deg} is not a position: expected finite degrees with |latitude| <= 90")]
    InvalidPosition {
        /// Longitude, degrees.
        lon_deg: f64,
        /// Latitude, degrees.
        lat_deg: f64,
    },
    /// A point lies outside the domain of the projection.
    #[error("({x}, {y}) lies outside the domain of {crs}: expected a position that the projection can represent")]
    OutsideDomain {
        /// First coordinate as given.
        x: f64,
        /// Second coordinate as given.
        y: f64,
        /// The CRS of the map.
        crs: String,
    },
}
