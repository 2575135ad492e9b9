//! Parts of tiles with the margin that the census needs.

/// The census looks at the eight neighbours, as MicMac's patches in cities do: the aggregation brings the support that they
/// lack, and roofs keep their edges.
pub(super) const CENSUS_REACH: usize = 1;

/// A part of a tile with its margin.
#[derive(Clone, Copy)]
pub(super) struct Part {
    /// Where it begins in the tile with its margin.
    pub(super) within: [i64; 2],
    pub(super) width: usize,
    pub(super) height: usize,
}

impl Part {
    pub(super) fn area(self) -> usize {
        self.width * self.height
    }
}
