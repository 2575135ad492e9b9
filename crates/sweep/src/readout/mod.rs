//! Heights from aggregated costs.

mod least;
mod modes;

pub(crate) use least::Sums;
pub(crate) use modes::{Estimates, Modes, TOGETHER};
