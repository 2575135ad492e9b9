//! Reasons why change cannot be found.

/// A change that cannot be found.
#[derive(Debug, thiserror::Error)]
#[error(transparent)]
pub struct ChangeError(#[from] pub(crate) Reason);

/// Why change cannot be found.
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
    /// Two rasters do not have the same size.
    #[error("{what} has {found:?} cells (columns, rows), the first surface {expected:?}: resample it first")]
    Size {
        /// Name of the raster.
        what: &'static str,
        /// Its columns and rows.
        found: (usize, usize),
        /// Columns and rows of the first surface.
        expected: (usize, usize),
    },
    /// Too few cells decide.
    #[error(
        "{observed} cells are observed in both surfaces, and {found} of them are rather right than wrong and clear of \
         the borders; {needed} are needed: check that the surfaces cover the same ground and hold"
    )]
    TooFewCells {
        /// Number of cells that decide.
        found: usize,
        /// Number of cells observed in both surfaces.
        observed: usize,
        /// Lowest number that is accepted.
        needed: usize,
    },
}
