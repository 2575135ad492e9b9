//! Aggregated costs of one row.

use super::layout::LANES;

/// Sums of the path costs over eight directions, for the hypotheses of one row of pixels.
///
/// The share of the first four directions is rounded up to an even number.
#[derive(Debug, Clone, Copy)]
pub struct RowSums<'a> {
    /// Sums in the order of the backward pass: the last pixel comes first.
    sums: &'a [u16],
    /// Index of each pixel's first cost in the block, and of the next row's.
    offsets: &'a [u32],
}

impl<'a> RowSums<'a> {
    /// Returns the sums of the row whose costs lie at `offsets`.
    pub(super) fn new(sums: &'a [u16], offsets: &'a [u32]) -> Self {
        Self { sums, offsets }
    }

    /// Returns the sums of the pixel at column `x`, one per hypothesis.
    pub fn pixel(&self, x: usize) -> &[u16] {
        let (sums, count) = self.pixel_with_overhang(x);
        &sums[..count]
    }

    /// Returns the sums of the pixel at column `x` followed by [`LANES`] others, and the number of
    /// its own ones.
    #[inline(always)]
    pub(crate) fn pixel_with_overhang(&self, x: usize) -> (&[u16], usize) {
        let end = self.offsets[self.offsets.len() - 1];
        let (first, count) = (end - self.offsets[x + 1], self.offsets[x + 1] - self.offsets[x]);
        (&self.sums[first as usize..][..count as usize + LANES], count as usize)
    }
}
