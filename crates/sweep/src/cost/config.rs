//! Parameters of the cost volume.

/// Costs are stored as integers 0 to this: finer than the noise of any correlation, and a path's cost fits a byte: this and the
/// penalty of a jump, which is a little more.
pub const COST_MAX: u8 = 112;

/// How the pairs of views are combined into one cost.
#[derive(Debug, Clone, Copy, PartialEq, Eq)]
pub enum Aggregation {
    /// The variance over all views, source–source pairs included.
    Variance,
    /// The mean of the best `K` reference–source pairs.
    BestOf(usize),
}

/// Two of the sources see even the ground beside a wall, and on dates like the reference's; the third best may not.
const BEST: usize = 2;

impl Aggregation {
    /// That for so many sources: the best count where there are others.
    pub fn of_sources(count: usize) -> Self {
        if count > BEST { Self::BestOf(BEST) } else { Self::Variance }
    }
}

/// Parameters of the cost volume.
#[derive(Debug, Clone, Copy, PartialEq)]
pub struct CostConfig {
    /// How views are combined.
    pub aggregation: Aggregation,
    /// Side of the tiles, pixels: large enough that the laid-over pictures pay, small enough for the cache.
    pub tile: usize,
    /// Largest error of the local map against the exact RPC chain, pixels.
    pub map_tolerance_px: f64,
}

impl Default for CostConfig {
    fn default() -> Self {
        Self { aggregation: Aggregation::BestOf(BEST), tile: 64, map_tolerance_px: 0.02 }
    }
}
