//! Errors of an evaluation.

use numeric::failures;

/// The reason why an evaluation is refused.
#[derive(Debug, thiserror::Error)]
#[non_exhaustive]
pub enum EvalError {
    /// The reference has no valid cell left.
    #[error("the reference has no valid cell{}: check its no-data value, the mask and the skipped \
      classes", skipped_text(*.skipped))]
    EmptyReference {
        /// Number of valid cells that the class or the mask excludes.
        skipped: usize,
    },
    /// No cell is valid in both surfaces.
    #[error(
        "the surfaces share no valid cell (the reference has {reference_cells}): check that they cover the same \
          ground and \
         that each names its coordinate system"
    )]
    NoOverlap {
        /// Number of valid cells of the reference.
        reference_cells: usize,
    },
    /// Too few cells are valid in both surfaces to search for the shift.
    #[error(
        "{found} cells are valid in both surfaces, a search of the shift needs {needed}: use the alignment none or z"
    )]
    TooFewCells {
        /// Number of cells valid in both, at the best shift.
        found: usize,
        /// Lowest number that is accepted.
        needed: usize,
    },
    /// A raster does not have the size of the grid that it belongs to.
    #[error(
        "the {what} grid has {found_width} x {found_height} cells, the reference {width} x {height}: \
         resample it onto the reference first"
    )]
    Shape {
        /// Name of the raster.
        what: &'static str,
        /// Number of columns found.
        found_width: usize,
        /// Number of rows found.
        found_height: usize,
        /// Number of columns expected.
        width: usize,
        /// Number of rows expected.
        height: usize,
    },
    /// Classes are to be skipped, but there is no class raster.
    #[error("classes are to be skipped, but there is no class raster: give one")]
    SkipWithoutClasses,
    /// A geotransform cannot be inverted, or holds values that are not finite.
    #[error("the geotransform {0:?} cannot be inverted: a grid needs cells with an area")]
    SingularGeotransform([f64; 6]),
    /// Blocks for local shifts are too small to have relief of their own.
    #[error("blocks of {block_m} m are too small for local shifts: at least {least_m} m are needed on these cells")]
    BlockTooSmall {
        /// Side of a block, metres.
        block_m: f64,
        /// Shortest side, metres.
        least_m: f64,
    },
    /// No block found a shift of its own.
    #[error(
        "none of {blocks} blocks has heights and slopes of both surfaces: choose larger blocks, or align the surfaces as a whole"
    )]
    NoLocalShift {
        /// Number of blocks.
        blocks: usize,
    },
    /// A threshold or a radius is not a positive finite number.
    #[error("{name} is {value}, expected a positive number of metres")]
    NotPositive {
        /// Name of the setting.
        name: &'static str,
        /// Value of the setting.
        value: f64,
    },
    /// The ground has too little slope for the method of Nuth and Kääb.
    #[error(
        "the ground is too flat for the alignment nuth-kaab: {:.2} % of it is steeper than {slope_deg}° at \
          cells of {cell_m:.1} m, \
         needed are {:.0} %: use the alignment xyz, z or none", 100.0 * share, 100.0 * needed
    )]
    TooFlat {
        /// Share of the cells that are steep enough, 0 to 1.
        share: f64,
        /// Lowest share that is accepted, 0 to 1.
        needed: f64,
        /// Slope from which a cell is steep, degrees.
        slope_deg: f64,
        /// Size of the cells on which the slope was computed, metres.
        cell_m: f64,
    },
    /// All slopes face one direction or its opposite.
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
        /// Requested radius, metres.
        radius_m: f64,
        /// Number of whole-cell shifts within the radius.
        candidates: usize,
        /// Highest number that is tried.
        most: usize,
    },
}

failures!(EvalError: Input);

fn skipped_text(skipped: usize) -> String {
    if skipped == 0 {
        String::new()
    } else {
        format!(" outside the mask and the skipped classes ({skipped} inside them)")
    }
}
