//! Heights from aggregated costs: the best hypothesis, its mode, and the soft-argmin over it.

mod least;
mod modes;

pub(crate) use least::LeastSum;
pub(crate) use modes::{Estimates, Modes, TOGETHER};
