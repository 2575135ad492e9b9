//! What can be wrong with the input of an evaluation.

/// Why an evaluation is refused.
#[derive(Debug, thiserror::Error)]
#[non_exhaustive]
pub enum EvalError {
    /// The reference has no valid cell left.
    #[error("the reference has no valid cell{}: check its no-data value and the skipped classes", skipped_text(*.skipped))]
    EmptyReference {
        /// Valid cells that were left out because of their class.
        skipped: usize,
    },
    /// No cell is valid in both surfaces.
    #[error(
        "the surfaces share no valid cell (the reference has {reference_cells}): check that they cover the same ground and \
         that each names its coordinate system"
    )]
    NoOverlap {
        /// Valid cells of the reference.
        reference_cells: usize,
    },
    /// Too few common cells for a search of the shift.
    #[error(
        "{found} cells are valid in both surfaces, a search of the shift needs {needed}: use the alignment none or z"
    )]
    TooFewCells {
        /// Cells valid in both, at the best shift.
        found: usize,
        /// The least number that is accepted.
        needed: usize,
    },
    /// The class raster is not on the reference grid.
    #[error(
        "the class grid has {found_width} x {found_height} cells, the reference {width} x {height}: \
         resample the classes onto the reference first"
    )]
    ClassShape {
        /// Columns found.
        found_width: usize,
        /// Rows found.
        found_height: usize,
        /// Columns expected.
        width: usize,
        /// Rows expected.
        height: usize,
    },
    /// Classes are to be skipped but none were given.
    #[error("classes are to be skipped, but there is no class raster: give one")]
    SkipWithoutClasses,
    /// A geotransform cannot be inverted, or holds values that are not finite.
    #[error("the geotransform {0:?} cannot be inverted: a grid needs cells with an area")]
    SingularGeotransform([f64; 6]),
    /// A threshold or a radius is not a positive finite number.
    #[error("{name} is {value}, expected a positive number of metres")]
    NotPositive {
        /// Which setting.
        name: &'static str,
        /// Its value.
        value: f64,
    },
    /// The search radius covers more cells than can be tried.
    #[error(
        "a search radius of {radius_m} m covers {candidates} cells of the reference, at most {most} are tried: \
         use a smaller radius, or a coarser reference"
    )]
    SearchTooWide {
        /// The radius asked for, metres.
        radius_m: f64,
        /// Whole-cell shifts within it.
        candidates: usize,
        /// The most that are tried.
        most: usize,
    },
}

fn skipped_text(skipped: usize) -> String {
    if skipped == 0 { String::new() } else { format!(" outside the skipped classes ({skipped} inside them)") }
}
