//! Semi-global aggregation (Hirschmüller 2008) over height hypotheses that differ from pixel to
//! pixel.
//!
//! Along each of eight directions the cost of the path to hypothesis k of pixel p is
//!
//! `L(p, k) = C(p, k) + min(L(q, k), L(q, k ± 1) + P1, min L(q) + P2) − min L(q)`
//!
//! with q the pixel before p. The result is ΣL over the directions. Hypotheses are indices on one
//! height lattice, so that pixels with different ranges meet at equal heights. A height that the
//! previous pixel did not search can be reached only by a jump (P2). P2 falls where the image has
//! an edge. Path costs are bytes, cut at 255.
//!
//! Steps favour flat surfaces and penalise steep ones: the face of a quarry would be cut short.
//! Where the coarser level found a steep surface, k is counted relative to it, so that its climb
//! from q to p costs nothing: a surface orientation prior (SGM-P; Scharstein, Taniai and Sinha
//! 2017). Flat surfaces get no such prior, as it would hand the noise of the coarser level down.
//!
//! What the first four directions add to the cost is kept as bytes: half of it, rounded up.
//!
//! # Files
//! [`Penalties`] and the block of costs are the input. `layout` draws the memory of one row,
//! `links` finds the neighbours of its pixels in it, `pixel` extends paths to one pixel, `row` to a
//! row, and `directions` makes the two passes over the block. The vector code works on
//! `crate::simd`; with arrays instead of registers it runs under Miri, which checks the pointers
//! of `row` and `pixel`.

mod block;
mod directions;
mod layout;
mod links;
mod penalties;
mod pixel;
mod row;
mod row_sums;
mod store;

pub(crate) use block::VolumeBlock;
pub(crate) use directions::aggregate;
pub(crate) use layout::{FARTHEST, LANES};
pub use penalties::Penalties;
pub use row_sums::RowSums;
