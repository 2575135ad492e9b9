//! Small tools that every crate needs: progress and cancellation.

mod progress;

pub use progress::{CancelFlag, Cancellable, Cancelled, Choice, Progress, Silent};
