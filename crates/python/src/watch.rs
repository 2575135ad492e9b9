//! Runs work on a thread of its own while the caller's thread serves Python: signals, progress,
//! warnings.
//!
//! The work never holds the interpreter lock. Its progress goes through a channel to the caller's
//! thread, which alone calls into Python. So a callback may do anything, a slow one holds up no
//! worker, and Ctrl-C is seen within [`POLL`]. A signal, or an exception of the callback, asks the
//! work to stop; it is raised once the work has ended, which leaves nothing half-written.

use std::path::Path;
use std::sync::Mutex;
use std::sync::atomic::{AtomicBool, Ordering};
use std::sync::mpsc::{Receiver, RecvTimeoutError, Sender, channel};
use std::time::Duration;

use numeric::{Choice, Progress};
use pyo3::prelude::*;

use crate::exception::raise_about;
use crate::fault::Fault;
use crate::forked::in_own_pool;

/// Time between two looks at signals and steps.
const POLL: Duration = Duration::from_millis(50);
/// Stack of the thread that works, bytes: that of a main thread.
const STACK: usize = 8 << 20;

/// What the work reports.
enum Event {
    /// A stage of so many steps begins.
    Begin(String, usize),
    Step,
    Choice(Choice),
    Warn(String),
    Part(String, Option<String>),
}

/// Receives the progress of the work on any thread.
struct Bridge {
    events: Sender<Event>,
    stop: AtomicBool,
}

impl Bridge {
    fn send(&self, event: Event) {
        // The receiver outlives the work.
        let _ = self.events.send(event);
    }
}

impl Progress for Bridge {
    fn begin(&self, stage: &str, steps: usize) {
        self.send(Event::Begin(stage.to_owned(), steps));
    }

    fn step(&self) {
        self.send(Event::Step);
    }

    fn choice(&self, choice: &Choice) {
        self.send(Event::Choice(choice.clone()));
    }

    fn warn(&self, text: &str) {
        self.send(Event::Warn(text.to_owned()));
    }

    fn part(&self, name: &str, state: Option<&str>) {
        self.send(Event::Part(name.to_owned(), state.map(str::to_owned)));
    }

    fn is_cancelled(&self) -> bool {
        self.stop.load(Ordering::Relaxed)
    }
}

/// Runs `work` and tells `watcher` of its progress.
///
/// `watcher` has the methods `begin(stage, steps)`, `steps(count)`, `choice(name, value, reason)`,
/// `warn(text)` and `part(name, state)`. Errors of files name the one of `paths` that they are
/// about.
pub(crate) fn watched<T: Send>(
    py: Python<'_>,
    watcher: &Bound<'_, PyAny>,
    paths: &[&Path],
    work: impl FnOnce(&dyn Progress) -> Result<T, Fault> + Send,
) -> PyResult<T> {
    let (events, received) = channel();
    let bridge = Bridge { events, stop: AtomicBool::new(false) };
    let received = Mutex::new(received);
    std::thread::scope(|scope| {
        let (ended, end) = channel::<()>();
        let worker = std::thread::Builder::new().name("skysweep".to_owned()).stack_size(STACK);
        let bridge = &bridge;
        let handle = worker.spawn_scoped(scope, move || {
            // Dropped when the work has ended, also by a panic.
            let _ended = ended;
            in_own_pool(|| work(bridge))
        })?;
        let end = Mutex::new(end);
        let mut raised: PyResult<()> = Ok(());
        loop {
            let is_over = py.detach(|| waited(&end));
            if raised.is_ok() {
                raised = py.check_signals().and_then(|()| served(watcher, &received));
                if raised.is_err() {
                    bridge.stop.store(true, Ordering::Relaxed);
                }
            }
            if is_over {
                break;
            }
        }
        let result = py.detach(|| handle.join());
        raised?;
        let failed = |_| Fault::internal("the job ended by a panic; please report what standard error says");
        result.map_err(failed).and_then(|result| result).map_err(|fault| raise_about(py, &fault, paths))
    })
}

/// Waits for the end of the work, for [`POLL`] at most; returns whether it has ended.
fn waited(end: &Mutex<Receiver<()>>) -> bool {
    end.lock().is_ok_and(|end| end.recv_timeout(POLL) != Err(RecvTimeoutError::Timeout))
}

/// Tells the watcher what was reported since the last time.
fn served(watcher: &Bound<'_, PyAny>, received: &Mutex<Receiver<Event>>) -> PyResult<()> {
    let Ok(received) = received.lock() else { return Ok(()) };
    // Steps that follow one another are told at once.
    let mut steps = 0_usize;
    let tell = |steps: &mut usize| match std::mem::take(steps) {
        0 => Ok(()),
        count => watcher.call_method1("steps", (count,)).map(|_| ()),
    };
    while let Ok(event) = received.try_recv() {
        match event {
            Event::Step => steps += 1,
            Event::Begin(stage, count) => {
                tell(&mut steps)?;
                watcher.call_method1("begin", (stage, count))?;
            }
            Event::Choice(Choice { name, value, reason }) => {
                watcher.call_method1("choice", (name, value, reason))?;
            }
            Event::Warn(text) => {
                watcher.call_method1("warn", (text,))?;
            }
            Event::Part(name, state) => {
                watcher.call_method1("part", (name, state))?;
            }
        }
    }
    tell(&mut steps)
}
