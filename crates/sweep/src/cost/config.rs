//! Parameters of the cost volume.

/// Largest cost. Costs are integers from 0 to this value.
///
/// Its steps are finer than the noise of a comparison. Together with the penalty of a jump, which
/// is a little larger, it fits a byte, as the cost of a path must.
pub const COST_MAX: u8 = 112;

/// How the costs of the pairs of views are combined into one.
#[derive(Debug, Clone, Copy, PartialEq, Eq)]
pub enum Aggregation {
    /// Mean over all pairs of views, source–source pairs included: the variance over the views.
    Variance,
    /// Mean of the best reference–source pairs: of one where the images show their texture, of more
    /// where noise hides it. With one pair a pixel needs a single source that sees it on a similar
    /// date, which is the usual case beside a wall. A chance likeness of two views is left to the
    /// consistency check.
    Best,
}

/// Parameters of the cost volume.
#[derive(Debug, Clone, Copy, PartialEq)]
pub struct CostConfig {
    /// How the pairs of views are combined.
    pub aggregation: Aggregation,
    /// Side of the tiles, pixels: large enough to make up for resampling the sources, small enough
    /// for the cache.
    pub tile: usize,
    /// Largest error of a tile's local map against the exact RPC chain, pixels.
    pub map_tolerance_px: f64,
    /// Whether the cost of a pixel at a height is averaged with those of its eight neighbours at
    /// the same height.
    ///
    /// The larger patch finds more matches where texture is weak, but it widens what stands on the
    /// ground by a pixel. On a coarse level, where a house is a few pixels wide, it would lose the
    /// house.
    pub blends_neighbours: bool,
}

impl Default for CostConfig {
    fn default() -> Self {
        Self { aggregation: Aggregation::Best, tile: 64, map_tolerance_px: 0.02, blends_neighbours: true }
    }
}
