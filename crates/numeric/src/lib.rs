//! Small tools that every crate needs.
//!
//! * [`random`]: seeded random numbers ([`SplitMix64`], [`RandomByIndex`]).
//! * Order statistics: [`upper_median`], [`percentile`], [`upper_nmad`] and others.
//! * [`nearest_name`]: the known name that a mistyped one was meant to be.
//! * [`vector`]: vectors of three numbers.
//! * [`Failure`] and [`Kind`]: what kind of failure an error is.
//! * [`Progress`], [`Choice`] and [`Cancelled`]: what a long job reports, and how it is stopped.

mod failure;
mod names;
mod order;
mod progress;
pub mod random;
pub mod vector;

pub use failure::{Failure, Kind};
pub use names::nearest_name;
pub use order::{
    Float, NMAD_FACTOR, middle_values, nearest_quantile, order_statistic, percentile, upper_median, upper_nmad,
};
pub use progress::{CancelFlag, Cancellable, Cancelled, Choice, Muted, Progress, Silent};
pub use random::{RandomByIndex, SplitMix64};
