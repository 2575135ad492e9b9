//! The variance cost volume: how little the views agree, per reference pixel and height hypothesis.
//!
//! The feature of a pixel is its census in grades: the differences of its eight neighbours to it, in units of the
//! image's own typical difference, cut to [−1, 1]. Cut hard it is the census transform of Zabih and Woodfill (1994), which keeps
//! roof edges where they are (one strong edge counts no more than fine texture, where in a correlation it outvotes it);
//! graded, noise does not decide about bits. Differences in units of the image's own contrast do not depend on gain or offset.
//! The cost of a pair is the mean absolute difference of the two features, 0 to 1; pairs with a void count little. With hard
//! bits the mean over all pairs of N views is the variance `2 N / (N − 1) · mean p (1 − p)`. The robust form averages only the best K of the
//! reference–source pairs, so that occluded and changed views do not outvote the rest.
//!
//! Work goes by tiles of the reference: each source is laid over the tile once ([`crate::TileMap`]), and each height
//! plane is then a sub-pixel shift of that picture. Pictures are 16-bit integers, 128 to the difference that counts fully;
//! features and costs are bytes.

mod kernels;
mod laid;
mod planes;
mod tile;
mod voids;

pub use tile::Reference;
pub(crate) use tile::{BlockCosts, TileScratch, census_scale, sweep_tile};

use raster::Grid;

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

/// A source view on the level being swept.
#[derive(Debug, Clone, Copy)]
pub struct SourceLevel<'a> {
    /// Its place among the views.
    pub index: usize,
    /// Its image on this level, NaN where invalid.
    pub image: &'a Grid<f32>,
    /// Its camera.
    pub camera: &'a camera::RpcCamera,
    /// Its noise on this level, grey values.
    pub noise: f32,
    /// Its typical difference between neighbouring pixels on this level, grey values.
    pub contrast: f32,
}
