//! Semi-global aggregation (Hirschmüller 2008) over height hypotheses that differ from pixel to pixel.
//!
//! Along each of eight directions, `L(p, k) = C(p, k) + min(L(q, k), L(q, k ± 1) + P1, min L(q) + P2) − min L(q)` with q
//! the pixel before p; the result is ΣL. Hypotheses are indices on one height lattice, so pixels with different ranges
//! meet at equal heights; a height that the previous pixel did not search can only be reached by a jump. P2 falls where
//! the image has an edge. Path costs are bytes, cut at 255.
//!
//! Steps make flat surfaces cheap, and steep ones dear: a quarry's face is cut short. Where the coarser level found a steep surface,
//! it is its climb from q to p that costs nothing, and k counts from there: a surface orientation prior (Scharstein, Taniai and
//! Sinha 2017, SGM-P) that leaves flat ones alone, whose noise it would hand down.
//!
//! What the first four paths add to the cost is kept in bytes too, halved and rounded up.

mod block;
mod directions;
mod layout;
mod links;
mod penalties;
mod pixel;
mod row;
mod row_sums;
mod store;

pub(crate) use block::Volume;
pub(crate) use directions::aggregate;
pub(crate) use layout::{FARTHEST, LANES};
pub use penalties::Penalties;
pub use row_sums::RowSums;
