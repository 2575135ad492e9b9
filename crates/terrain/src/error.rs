//! Reasons why the ground cannot be found.

use numeric::Cancelled;

/// A ground that cannot be found.
#[derive(Debug, thiserror::Error)]
#[non_exhaustive]
pub enum TerrainError {
    /// The cells have no usable size.
    #[error("the cells measure {found} m, expected a positive number of metres")]
    CellSize {
        /// Size that was given.
        found: f64,
    },
    /// A parameter of the method is outside of its range.
    #[error("{name} is {found}, expected {expected}")]
    Parameter {
        /// Name in words.
        name: &'static str,
        /// Value that was given.
        found: f64,
        /// Values that are accepted.
        expected: &'static str,
    },
    /// A layer has another size than the surface.
    #[error("the layer has {} × {} cells, expected the {} × {} of the surface", found.0, found.1, expected.0, expected.1)]
    Layer {
        /// Columns and rows that were given.
        found: (usize, usize),
        /// Columns and rows of the surface.
        expected: (usize, usize),
    },
    /// The caller asked to stop.
    #[error(transparent)]
    Cancelled(#[from] Cancelled),
}
