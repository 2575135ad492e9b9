//! The variance cost volume: how little the views agree, per reference pixel and height hypothesis.
//!
//! With zero-mean, unit-norm patch features `f_i` the variance over N views is `1 − ‖mean f_i‖²`
//! `= (1 − 1/N) (1 − mean over pairs of ρ_ij)` with ρ the zero-mean normalised cross-correlation. The cost stored is
//! `1 − ρ`, each pair truncated to [0, 1], averaged: anti-correlation says no more than no correlation. The robust form averages
//! only the best K of the reference–source pairs, so that occluded and changed views do not outvote the rest.
//!
//! Work goes by tiles of the reference: each source is laid over the tile once ([`crate::TileMap`]), and each height
//! plane is then a sub-pixel shift of that picture.

mod kernels;
pub(crate) use kernels::patch_moments;
mod tile;

pub use tile::TileScratch;
pub(crate) use tile::{BlockCosts, Reference, VARIANCE_FLOOR, remove_mean, sweep_tile};

use raster::Grid;

/// Costs are stored as integers 0 to this: finer than the noise of any correlation, and sums of eight paths fit 16 bits.
pub const COST_MAX: u8 = 127;

/// How the pairs of views are combined into one cost.
#[derive(Debug, Clone, Copy, PartialEq, Eq)]
pub enum Aggregation {
    /// The variance over all views, source–source pairs included.
    Variance,
    /// The mean of the best `K` reference–source pairs.
    BestOf(usize),
}

/// Parameters of the cost volume.
#[derive(Debug, Clone, Copy, PartialEq)]
pub struct CostConfig {
    /// Patches are squares of `2 · radius + 1` pixels.
    pub patch_radius: usize,
    /// How views are combined.
    pub aggregation: Aggregation,
    /// Side of the tiles, pixels: large enough that the laid-over pictures pay, small enough for the cache.
    pub tile: usize,
    /// Largest error of the local map against the exact RPC chain, pixels.
    pub map_tolerance_px: f64,
}

impl Default for CostConfig {
    /// 3 × 3 patches, as MicMac uses in cities: the aggregation brings the support that they lack, and roofs keep their
    /// edges (the simulated town and the LiDAR truth of JAX_068 agree; 5 × 5 loses a point of completeness on both).
    fn default() -> Self {
        Self { patch_radius: 1, aggregation: Aggregation::BestOf(2), tile: 64, map_tolerance_px: 0.02 }
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
}
