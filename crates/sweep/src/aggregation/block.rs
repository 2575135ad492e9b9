//! A block of pixels with their costs.

use super::layout::Pixels;

/// A block of pixels with their hypotheses, row after row.
pub(crate) struct Volume<'a> {
    pub(crate) width: usize,
    pub(crate) height: usize,
    /// First hypothesis of each pixel.
    pub(crate) low: &'a [i32],
    /// Where a steep surface is expected at each pixel ([`crate::ranges::Ranges::steep`]).
    pub(crate) steep: &'a [i32],
    /// Where each pixel's costs begin; one entry more than there are pixels.
    pub(crate) offsets: &'a [u32],
    /// The costs, and [`LANES`] entries that belong to no pixel.
    pub(crate) costs: &'a [u8],
    /// Strength of the image gradient at each pixel relative to the noise and contrast, 0 (flat) to 255 (edge).
    pub(crate) edges: &'a [u8],
}

impl Volume<'_> {
    pub(super) fn row(&self, y: usize) -> Pixels<'_> {
        let row = y * self.width..(y + 1) * self.width;
        let (low, steep) = (&self.low[row.clone()], &self.steep[row.clone()]);
        Pixels { low, steep, offsets: self.row_offsets(y), edges: &self.edges[row] }
    }

    /// Where the costs of a row's pixels begin, and those of the next row.
    pub(super) fn row_offsets(&self, y: usize) -> &[u32] {
        &self.offsets[y * self.width..(y + 1) * self.width + 1]
    }

    /// The most hypotheses of a row.
    pub(super) fn row_capacity(&self) -> usize {
        let row = |y: usize| self.offsets[(y + 1) * self.width] - self.offsets[y * self.width];
        (0..self.height).map(row).max().unwrap_or(0) as usize
    }
}
