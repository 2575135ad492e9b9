//! A block of pixels with the costs of their hypotheses.

use super::layout::RowPixels;

/// A block of pixels with the costs of their hypotheses, row after row.
pub(crate) struct VolumeBlock<'a> {
    /// Pixels per row.
    pub(crate) width: usize,
    /// Number of rows.
    pub(crate) height: usize,
    /// First hypothesis of each pixel.
    pub(crate) low: &'a [i32],
    /// Hypothesis at which a steep surface is expected at each pixel
    /// ([`crate::ranges::Ranges::steep`]).
    pub(crate) steep: &'a [i32],
    /// Index of each pixel's first cost; one entry more than there are pixels.
    pub(crate) offsets: &'a [u32],
    /// The costs, followed by [`super::layout::LANES`] entries that belong to no pixel.
    pub(crate) costs: &'a [u8],
    /// Strength of the image gradient at each pixel against noise and contrast, 0 (flat) to 255
    /// (edge).
    pub(crate) edges: &'a [u8],
}

impl VolumeBlock<'_> {
    /// Returns the pixels of a row.
    pub(super) fn row(&self, y: usize) -> RowPixels<'_> {
        let row = y * self.width..(y + 1) * self.width;
        let (low, steep) = (&self.low[row.clone()], &self.steep[row.clone()]);
        RowPixels { low, steep, offsets: self.row_offsets(y), edges: &self.edges[row] }
    }

    /// Returns the index of the first cost of each pixel of a row, and of the next row.
    pub(super) fn row_offsets(&self, y: usize) -> &[u32] {
        &self.offsets[y * self.width..(y + 1) * self.width + 1]
    }

    /// Returns the number of hypotheses of the row that has most.
    pub(super) fn row_capacity(&self) -> usize {
        let row = |y: usize| self.offsets[(y + 1) * self.width] - self.offsets[y * self.width];
        (0..self.height).map(row).max().unwrap_or(0) as usize
    }
}
