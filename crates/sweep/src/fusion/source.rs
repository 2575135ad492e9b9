//! Where the heights of cells come from, and how rasters say so.

/// Value of `filled` in a cell with an observed height.
pub const OBSERVED: u8 = 0;
/// Value of `filled` in a cell that was filled.
pub const FILLED: u8 = 1;
/// Value of `filled` in a cell without a height.
pub const VOID: u8 = 255;

/// Where the height of a cell comes from, or why it has none: the codes of `dsm/source.tif`.
#[derive(Debug, Clone, Copy, PartialEq, Eq)]
#[repr(u8)]
pub enum CellSource {
    /// Void: fewer than two views image the cell.
    Outside = 0,
    /// The height was observed.
    Observed = 1,
    /// Filled: hidden from all but one view. The ground under what hides it.
    FilledHidden = 2,
    /// Filled: two views see it and do not match. Completed from its surroundings.
    FilledSurface = 3,
    /// Filled: a narrow gap that two views see.
    FilledNarrow = 4,
    /// Filled: between roofs, in a quarter of which hardly any ground is known. The ground there as
    /// far as it is known, or that under the lowest heights around.
    FilledStreet = 5,
    /// Void: two views see it and do not match: change, water, too little texture.
    Unmatched = 10,
    /// Void: the images have a single grey value there.
    Blank = 11,
    /// Void: hidden from all but one view. No ground is known near, or nothing was to be filled.
    Hidden = 12,
    /// Void: under a mask, or outside the area that was asked for.
    Masked = 13,
}

impl CellSource {
    /// Returns the code in `dsm/source.tif`.
    #[must_use]
    pub const fn code(self) -> u8 {
        self as u8
    }

    /// Returns whether the cell was filled.
    #[must_use]
    pub const fn is_filled(self) -> bool {
        matches!(self, Self::FilledHidden | Self::FilledSurface | Self::FilledNarrow | Self::FilledStreet)
    }
    /// Returns the value of `dsm/filled.tif`: [`OBSERVED`], [`FILLED`] or [`VOID`].
    #[must_use]
    pub const fn filled_flag(self) -> u8 {
        match self {
            Self::Observed => OBSERVED,
            filled if filled.is_filled() => FILLED,
            _ => VOID,
        }
    }
}
