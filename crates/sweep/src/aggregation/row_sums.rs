//! Sums of path costs.

use super::layout::LANES;

/// Sums of path costs of one row; what the first four directions add is rounded up to an even number.
#[derive(Debug, Clone, Copy)]
pub struct RowSums<'a> {
    sums: &'a [u16],
    /// Of the row's pixels among all costs, and where the next row's begin.
    offsets: &'a [u32],
}

impl<'a> RowSums<'a> {
    pub(super) fn new(sums: &'a [u16], offsets: &'a [u32]) -> Self {
        Self { sums, offsets }
    }

    /// Those of the pixel at `x`.
    pub fn pixel(&self, x: usize) -> &[u16] {
        let (sums, count) = self.pixel_and_more(x);
        &sums[..count]
    }

    /// Those of the pixel at `x` with [`LANES`] more behind them, and how many they are.
    #[inline(always)]
    pub(crate) fn pixel_and_more(&self, x: usize) -> (&[u16], usize) {
        // The last pixel comes first.
        let end = self.offsets[self.offsets.len() - 1];
        let (first, count) = (end - self.offsets[x + 1], self.offsets[x + 1] - self.offsets[x]);
        (&self.sums[first as usize..][..count as usize + LANES], count as usize)
    }
}
