//! The variance cost volume: how little the views agree, per reference pixel and height hypothesis.
//!
//! The feature of a pixel is its graded census: the differences of its eight neighbours to it, in
//! units of the image's own typical difference, cut to [−1, 1]. Without grades it would be the
//! census transform of Zabih and Woodfill (1994). The cut keeps roof edges where they are: one
//! strong edge counts no more than fine texture, whereas it outvotes the texture in a correlation.
//! The grades keep noise from deciding about bits. As differences are relative to the image's own
//! contrast, gain and offset do not matter.
//!
//! The cost of a pair of views is the mean absolute difference of their features, 0 to 1. Pairs
//! with a void count little. For hard bits the mean over all pairs of N views is the variance
//! `2 N / (N − 1) · mean p (1 − p)`, with p the share of views that have a bit. The robust form
//! averages only the best of the reference–source pairs, so that occluded and changed views do not
//! outvote the rest. Their number follows from the noise of the images.
//!
//! Work goes by tiles of the reference. Each source is resampled over the tile once, through a
//! local map (`geometry::LocalMap`); each height plane is then a sub-pixel shift of that
//! image. Images are 16-bit integers in which 128 is the difference that counts fully; features
//! and costs are bytes.

mod averaged;
mod census;
mod config;
mod division;
mod kernels;
mod part;
mod planes;
mod raise;
mod scale;
mod shift;
mod tile;
mod transpose;
mod voids;
mod warped;

pub use config::{Aggregation, COST_MAX, CostConfig};
pub(crate) use planes::BlockCosts;
pub(crate) use scale::census_scale;
pub(crate) use tile::{TileScratch, sweep_tile};
