//! Progress and cancellation of long jobs.
//!
//! A job takes a `&dyn Progress`. It reports its stages, its steps, its choices and its warnings to
//! it, and asks it between two steps whether it should stop. Use [`Silent`] to watch nothing.
//!
//! A job calls [`Progress::check_cancelled`] between steps and turns [`Cancelled`] into its own
//! error. It must then leave no half-written file behind.

use std::sync::atomic::{AtomicBool, Ordering};

/// Receives the progress of a job. Its methods may be called from several threads at once.
pub trait Progress: Sync {
    /// Begins the stage called `stage`, which takes `steps` steps.
    fn begin(&self, stage: &str, steps: usize);

    /// Counts one finished step of the current stage.
    fn step(&self);

    /// Reports a choice that the job made or was given.
    fn choice(&self, choice: &Choice);

    /// Reports a problem that does not stop the job.
    fn warn(&self, text: &str);

    /// Reports what a part of the job does that runs beside others, such as a scene of a batch;
    /// `None` when it has ended. Watchers that show one stage at a time ignore it.
    fn part(&self, _name: &str, _state: Option<&str>) {}

    /// Returns whether the job should stop at its next step.
    fn is_cancelled(&self) -> bool {
        false
    }

    /// Returns an error if the job should stop, so that a job can write
    /// `progress.check_cancelled()?`.
    ///
    /// # Errors
    /// [`Cancelled`] if [`is_cancelled`](Self::is_cancelled) is true.
    fn check_cancelled(&self) -> Result<(), Cancelled> {
        if self.is_cancelled() { Err(Cancelled) } else { Ok(()) }
    }
}

/// A value that a job chose, or was given, and the reason for it.
#[derive(Debug, Clone, PartialEq, Eq, serde::Serialize, serde::Deserialize)]
pub struct Choice {
    /// Name of what was chosen: `gsd`, `crs`, `height range`, …
    pub name: String,
    /// Chosen value, with its unit.
    pub value: String,
    /// Reason for the value.
    pub reason: String,
}

/// Receives progress and ignores it.
///
/// ```
/// use numeric::{Progress, Silent};
///
/// fn job(progress: &dyn Progress) -> Result<usize, numeric::Cancelled> {
///     progress.begin("rows", 3);
///     for _ in 0..3 {
///         progress.check_cancelled()?;
///         progress.step();
///     }
///     Ok(3)
/// }
/// assert_eq!(job(&Silent), Ok(3));
/// ```
#[derive(Debug, Clone, Copy, Default)]
pub struct Silent;

impl Progress for Silent {
    fn begin(&self, _stage: &str, _steps: usize) {}
    fn step(&self) {}
    fn choice(&self, _choice: &Choice) {}
    fn warn(&self, _text: &str) {}
}

/// The error of a job that was asked to stop.
#[derive(Debug, Clone, Copy, PartialEq, Eq, thiserror::Error)]
#[error("the job was cancelled")]
pub struct Cancelled;

/// A flag that one thread sets to stop a job that runs on others.
#[derive(Debug, Default)]
pub struct CancelFlag(AtomicBool);

impl CancelFlag {
    /// Returns a flag that is not set.
    pub const fn new() -> Self {
        Self(AtomicBool::new(false))
    }

    /// Sets the flag. It stays set.
    pub fn cancel(&self) {
        self.0.store(true, Ordering::Relaxed);
    }

    /// Returns whether the flag is set.
    pub fn is_cancelled(&self) -> bool {
        self.0.load(Ordering::Relaxed)
    }
}

/// Passes progress on to `inner` and stops the job when `flag` is set, or when `inner` asks for it.
///
/// ```
/// use numeric::{CancelFlag, Cancellable, Progress, Silent};
///
/// let flag = CancelFlag::new();
/// let progress = Cancellable { inner: &Silent, flag: &flag };
/// assert!(progress.check_cancelled().is_ok());
/// flag.cancel();
/// assert!(progress.check_cancelled().is_err());
/// ```
#[derive(Clone, Copy)]
pub struct Cancellable<'a> {
    /// Receiver of the progress.
    pub inner: &'a dyn Progress,
    /// Flag that stops the job.
    pub flag: &'a CancelFlag,
}

impl Progress for Cancellable<'_> {
    fn begin(&self, stage: &str, steps: usize) {
        self.inner.begin(stage, steps);
    }

    fn step(&self) {
        self.inner.step();
    }

    fn choice(&self, choice: &Choice) {
        self.inner.choice(choice);
    }

    fn warn(&self, text: &str) {
        self.inner.warn(text);
    }

    fn is_cancelled(&self) -> bool {
        self.flag.is_cancelled() || self.inner.is_cancelled()
    }
}

/// A watcher of work inside a step: passes on the wish to stop, and nothing else.
pub struct Muted<'a>(pub &'a dyn Progress);

impl Progress for Muted<'_> {
    fn begin(&self, _stage: &str, _steps: usize) {}
    fn step(&self) {}
    fn choice(&self, _choice: &Choice) {}
    fn warn(&self, _text: &str) {}

    fn is_cancelled(&self) -> bool {
        self.0.is_cancelled()
    }
}

#[cfg(test)]
mod tests {
    use super::*;
    use std::sync::atomic::AtomicUsize;

    #[derive(Default)]
    struct Counter(AtomicUsize);

    impl Progress for Counter {
        fn begin(&self, _: &str, _: usize) {}
        fn step(&self) {
            self.0.fetch_add(1, Ordering::Relaxed);
        }
        fn choice(&self, _: &Choice) {}
        fn warn(&self, _: &str) {}
    }

    #[test]
    fn a_flag_stops_a_job_between_two_steps() {
        let (counter, flag) = (Counter::default(), CancelFlag::new());
        let progress = Cancellable { inner: &counter, flag: &flag };
        let job = |progress: &dyn Progress| {
            (0..10).try_for_each(|step| {
                progress.check_cancelled()?;
                progress.step();
                if step == 3 {
                    flag.cancel();
                }
                Ok(())
            })
        };
        assert_eq!(job(&progress), Err(Cancelled));
        assert_eq!(counter.0.load(Ordering::Relaxed), 4);
    }
}
