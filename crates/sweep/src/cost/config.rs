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
    /// Mean of the best `K` reference–source pairs.
    BestOf(usize),
}

/// Pairs that count by default. Two of the sources see even the ground beside a wall, and on dates
/// like the reference's; the third best may not.
const BEST: usize = 2;

impl Aggregation {
    /// Picks the aggregation for `count` sources: best-of-2 for more than two, the full variance
    /// otherwise.
    ///
    /// ```
    /// use sweep::cost::Aggregation;
    ///
    /// assert_eq!(Aggregation::of_sources(2), Aggregation::Variance);
    /// assert_eq!(Aggregation::of_sources(6), Aggregation::BestOf(2));
    /// ```
    pub fn of_sources(count: usize) -> Self {
        if count > BEST { Self::BestOf(BEST) } else { Self::Variance }
    }
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
}

impl Default for CostConfig {
    fn default() -> Self {
        Self { aggregation: Aggregation::BestOf(BEST), tile: 64, map_tolerance_px: 0.02 }
    }
}
