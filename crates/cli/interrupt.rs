//! Ctrl-C and requests to end (SIGINT, SIGTERM, SIGHUP): a job stops at its next step, removes its
//! temporary files and gives its claims back, as [`numeric::Cancelled`] asks of it. Then the
//! process ends by the signal, so that a shell or a scheduler sees the usual status (130, 143,
//! 129).
//!
//! A second signal ends the process at once. A signal that the caller has made it ignore (`nohup`,
//! a job in the background of a script) stays ignored.

use numeric::{Choice, Progress};

/// Passes progress on, and stops the job when the process was asked to end.
pub(crate) struct Interruptible<'a>(pub(crate) &'a dyn Progress);

impl Progress for Interruptible<'_> {
    fn begin(&self, stage: &str, steps: usize) {
        self.0.begin(stage, steps);
    }

    fn step(&self) {
        self.0.step();
    }

    fn choice(&self, choice: &Choice) {
        self.0.choice(choice);
    }

    fn warn(&self, text: &str) {
        self.0.warn(text);
    }

    fn part(&self, name: &str, state: Option<&str>) {
        self.0.part(name, state);
    }

    fn is_cancelled(&self) -> bool {
        signals::received().is_some() || self.0.is_cancelled()
    }
}

pub(crate) use signals::{end_if_interrupted, listen};

#[cfg(unix)]
mod signals {
    use std::sync::Arc;
    use std::sync::OnceLock;
    use std::sync::atomic::{AtomicBool, AtomicUsize, Ordering};

    use signal_hook::consts::{SIGHUP, SIGINT, SIGTERM};
    use signal_hook::{flag, low_level};

    /// The number of the signal that came; 0 before one has come.
    static RECEIVED: OnceLock<Arc<AtomicUsize>> = OnceLock::new();

    /// Begins to listen to the signals. Called before a job begins; commands without a job end at
    /// once, as ever.
    pub(crate) fn listen() {
        RECEIVED.get_or_init(|| {
            let (received, again) = (Arc::new(AtomicUsize::new(0)), Arc::new(AtomicBool::new(false)));
            let ignored = ignored();
            let is_ignored = |signal: &i32| match ignored {
                Some(mask) => mask >> (signal - 1) & 1 == 1,
                None => *signal == SIGHUP,
            };
            for signal in [SIGINT, SIGTERM, SIGHUP].into_iter().filter(|signal| !is_ignored(signal)) {
                // The order matters: only a second signal finds the flag set. Where the system
                // refuses, the signal ends the process at once, as without us.
                let _ = flag::register_conditional_default(signal, Arc::clone(&again));
                let _ = flag::register(signal, Arc::clone(&again));
                let _ = flag::register_usize(signal, Arc::clone(&received), signal as usize);
            }
            received
        });
    }

    /// The signal that came, if one has.
    pub(super) fn received() -> Option<i32> {
        let signal = RECEIVED.get()?.load(Ordering::Relaxed);
        i32::try_from(signal).ok().filter(|signal| *signal != 0)
    }

    /// Ends the process by the signal that came, if one has.
    pub(crate) fn end_if_interrupted() {
        if let Some(signal) = received() {
            // Returns only where the system refuses; the exit code is then that of an error.
            let _ = low_level::emulate_default_handler(signal);
        }
    }

    /// The signals that this process ignores since its start, one bit each; `None` where the system
    /// does not tell. SIGHUP, which `nohup` turns off, is then left as it is.
    fn ignored() -> Option<u64> {
        let status = std::fs::read_to_string("/proc/self/status").ok()?;
        let mask = status.lines().find_map(|line| line.strip_prefix("SigIgn:"))?;
        u64::from_str_radix(mask.trim(), 16).ok()
    }
}

#[cfg(not(unix))]
mod signals {
    /// Other systems end the process at once.
    pub(crate) fn listen() {}

    pub(super) fn received() -> Option<i32> {
        None
    }

    pub(crate) fn end_if_interrupted() {}
}
