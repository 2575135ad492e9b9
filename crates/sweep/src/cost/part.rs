//! A part of a tile with the margin that its costs need.

/// Reach of the census, pixels: the eight neighbours.
///
/// MicMac uses patches as small in cities. The aggregation brings the support that they lack, and
/// roofs keep their edges.
const CENSUS_REACH: usize = 1;
/// Reach of the average of costs over neighbours, pixels.
const BLEND_REACH: usize = 1;
/// Margin of a part on each side, pixels.
pub(super) const MARGIN: usize = CENSUS_REACH + BLEND_REACH;

/// A part of a tile, with a margin of [`MARGIN`] pixels on each side.
#[derive(Clone, Copy)]
pub(super) struct Part {
    /// Column and row of its first pixel in the tile with its margin.
    pub(super) within: [i64; 2],
    /// Columns, margin included.
    pub(super) width: usize,
    /// Rows, margin included.
    pub(super) height: usize,
}

impl Part {
    /// Returns the number of pixels, margin included.
    pub(super) fn area(self) -> usize {
        self.width * self.height
    }
}
