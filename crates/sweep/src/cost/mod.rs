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
//! Work goes by tiles of the reference: each source is laid over the tile once ([`crate::geometry::LocalMap`]), and each height
//! plane is then a sub-pixel shift of that picture. Pictures are 16-bit integers, 128 to the difference that counts fully;
//! features and costs are bytes.

mod census;
mod config;
mod division;
mod kernels;
mod laid;
mod part;
mod planes;
mod raise;
mod scale;
mod shift;
mod tile;
mod transpose;
mod voids;

pub use config::{Aggregation, COST_MAX, CostConfig};
pub(crate) use planes::BlockCosts;
pub(crate) use scale::census_scale;
pub(crate) use tile::{TileScratch, sweep_tile};
