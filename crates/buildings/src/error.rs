//! Reasons why there is no building index.

use numeric::Cancelled;

/// A building index that cannot be computed.
#[derive(Debug, thiserror::Error)]
#[error(transparent)]
pub struct BuildingIndexError(#[from] pub(crate) Reason);

/// Why there is no building index.
#[derive(Debug, thiserror::Error)]
pub(crate) enum Reason {
    /// A parameter is outside of its range.
    #[error("{name} is {found}, expected {expected}")]
    Parameter {
        /// Name in words.
        name: &'static str,
        /// Value that was given.
        found: f64,
        /// Values that are accepted.
        expected: &'static str,
    },
    /// The pixels are too coarse to see buildings, or so fine that sides have too many of them.
    #[error(
        "a pixel measures {gsd_m} m, expected {finest_m} to {coarsest_m} m: the shortest side of a building must \
         have four pixels, the longest at most {SIDE_MAX}"
    )]
    Scale {
        /// Side of a pixel, metres.
        gsd_m: f64,
        /// Finest pixels that are taken, metres.
        finest_m: f64,
        /// Coarsest pixels that are taken, metres.
        coarsest_m: f64,
    },
    /// The work was cancelled.
    #[error(transparent)]
    Cancelled(#[from] Cancelled),
}

impl From<Cancelled> for BuildingIndexError {
    fn from(cancelled: Cancelled) -> Self {
        Reason::from(cancelled).into()
    }
}

/// Most pixels of the longest side.
pub(crate) const SIDE_MAX: usize = 1000;
