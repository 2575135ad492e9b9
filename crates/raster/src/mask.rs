//! Flags of pixels that are missing or not reliable.
//!
//! Float rasters mark no-data by NaN in memory. A [`Flags`] grid beside them records why a pixel is
//! missing, and which pixels are present but not reliable.

use crate::Grid;

/// Flags of every pixel, combined by `|`. 0 is a pixel without fault.
pub type Flags = Grid<u8>;

/// The pixel holds the file's no-data value or NaN, or is masked or transparent.
pub const FLAG_NO_DATA: u8 = 1;
/// The pixel lies outside the image.
pub const FLAG_OUTSIDE: u8 = 2;
/// The detector was saturated: the value is a lower bound.
pub const FLAG_SATURATED: u8 = 4;

/// Returns whether a pixel has no value. A doubtful value is not missing.
pub const fn is_missing(flags: u8) -> bool {
    flags & (FLAG_NO_DATA | FLAG_OUTSIDE) != 0
}
