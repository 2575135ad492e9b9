//! Reasons why cells cannot be classified.

/// Cells that cannot be classified.
#[derive(Debug, thiserror::Error)]
#[error(transparent)]
pub struct ClassifyError(#[from] pub(crate) Reason);

/// Why cells cannot be classified.
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
    /// A raster does not have the size of the surface.
    #[error("{what} has {found:?} cells (columns, rows), the surface {expected:?}: resample it first")]
    Size {
        /// Name of the raster.
        what: &'static str,
        /// Its columns and rows.
        found: (usize, usize),
        /// Columns and rows of the surface.
        expected: (usize, usize),
    },
}
