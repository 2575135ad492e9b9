//! Errors of the comparison of two surfaces.

/// The reason why two surfaces cannot be compared.
#[derive(Debug, Clone, PartialEq, thiserror::Error)]
#[error(transparent)]
pub struct SurfaceError(#[from] pub(crate) Reason);

/// Why two surfaces cannot be compared.
#[derive(Debug, Clone, PartialEq, thiserror::Error)]
pub(crate) enum Reason {
    /// A surface has no points, or no triangle with an area.
    #[error("the {which} has {found}: there is nothing to compare")]
    Empty {
        /// `test` or `reference`.
        which: &'static str,
        /// Description of what was found.
        found: &'static str,
    },
    /// A coordinate is not finite or too far from the origin.
    #[error("point {index} of the {which} is not within 1e9 m of the local origin")]
    Position {
        /// `test` or `reference`.
        which: &'static str,
        /// Index of the point.
        index: usize,
    },
    /// A triangle refers to a corner that does not exist.
    #[error("triangle {index} of the {which} refers to a corner that does not exist")]
    Corner {
        /// `test` or `reference`.
        which: &'static str,
        /// Index of the triangle.
        index: usize,
    },
    /// A setting is not a positive number.
    #[error("{name} is {value}, expected a positive number")]
    Setting {
        /// Name of the setting.
        name: &'static str,
        /// Value of the setting.
        value: f64,
    },
}
