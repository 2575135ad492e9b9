//! What is known against a pixel.
//!
//! Float rasters mark no-data by NaN in memory; a [`Flags`] grid beside them says why a pixel is missing, and which
//! pixels are present but not to be trusted.

use crate::Grid;

/// Reasons against a pixel, combined by `|`; 0 is a pixel without fault.
pub type Flags = Grid<u8>;

/// The pixel holds the file's no-data value, is masked or transparent, or is not a number.
pub const FLAG_NO_DATA: u8 = 1;
/// The pixel lies outside the image.
pub const FLAG_OUTSIDE: u8 = 2;
/// The detector was saturated: the value is present and says "at least this".
pub const FLAG_SATURATED: u8 = 4;

/// Whether a pixel's value is missing (rather than doubtful).
pub const fn is_missing(flags: u8) -> bool {
    flags & (FLAG_NO_DATA | FLAG_OUTSIDE) != 0
}
