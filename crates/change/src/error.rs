//! Reasons why change cannot be found.

/// A change that cannot be found.
#[derive(Debug, thiserror::Error)]
#[non_exhaustive]
pub enum ChangeError {
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
    /// Too few cells are observed in both surfaces.
    #[error("{found} cells are observed in both surfaces, {needed} are needed: check that they cover the same ground")]
    TooFewCells {
        /// Number of cells.
        found: usize,
        /// Lowest number that is accepted.
        needed: usize,
    },
}
