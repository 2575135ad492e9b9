//! What can be wrong with the input of an evaluation.

/// Why an evaluation is refused.
#[derive(Debug, thiserror::Error)]
#[non_exhaustive]
pub enum EvalError {
    /// The reference has no valid cell left.
    #[error("the reference has no valid cell{}: check its no-data value, the mask and the skipped classes", skipped_text(*.skipped))]
    EmptyReference {
        /// Valid cells that were left out because of their class or the mask.
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
    /// A raster that has to be on the reference grid is not.
    #[error(
        "the {what} grid has {found_width} x {found_height} cells, the reference {width} x {height}: \
         resample it onto the reference first"
    )]
    Shape {
        /// Which raster.
        what: &'static str,
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
    #[error("classes are to be skipped, but there are none: give a class raster (--classes)")]
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
    /// The ground has too little slope for Nuth and Kääb's method.
    #[error(
        "the ground is too flat for the alignment nuth-kaab: {:.2} % of it is steeper than {slope_deg}° at cells of {cell_m:.1} m, \
         needed are {:.0} %: use the alignment xyz, z or none", 100.0 * share, 100.0 * needed
    )]
    TooFlat {
        /// Share of the cells that are steep enough, 0 to 1.
        share: f64,
        /// The least share that is accepted.
        needed: f64,
        /// What counts as steep, degrees.
        slope_deg: f64,
        /// The cells at which the slope was taken, metres.
        cell_m: f64,
    },
    /// All slopes look the same way.
    #[error(
        "the slopes all face one way or its opposite, which leaves the shift across open for the alignment nuth-kaab: \
         use the alignment xyz, z or none"
    )]
    OneWaySlopes,
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
    if skipped == 0 {
        String::new()
    } else {
        format!(" outside the mask and the skipped classes ({skipped} inside them)")
    }
}
