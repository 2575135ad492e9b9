//! The pool of worker threads that work on arrays and jobs uses, also in forked processes.
//!
//! A fork copies the memory of a process and one thread of it. The usual pool of rayon then waits
//! for workers that stayed in the parent, without end. So every use of that pool goes through
//! [`in_own_pool`], which gives a forked process a pool of its own when it first needs one. Nothing
//! here takes a lock: one that another thread holds while the process forks is never released in
//! the child.

use std::ptr;
use std::sync::atomic::{AtomicPtr, AtomicU32, Ordering};

use rayon::ThreadPool;

use crate::fault::Fault;

/// Process that loaded the library.
static LOADED_BY: AtomicU32 = AtomicU32::new(0);
/// The pool of the last process that was forked and needed one. It is never freed.
static FORKED: AtomicPtr<ForkedPool> = AtomicPtr::new(ptr::null_mut());

/// A pool, and the process that its threads are in.
struct ForkedPool {
    process: u32,
    threads: ThreadPool,
}

/// Notes the process that loads the library.
pub(crate) fn note_process() {
    LOADED_BY.store(std::process::id(), Ordering::Relaxed);
}

/// Runs work on the usual pool, or in a forked process on the pool of that process.
///
/// # Errors
/// [`Fault`] of the work, and when the system gives no threads.
pub(crate) fn in_own_pool<T: Send>(work: impl FnOnce() -> Result<T, Fault> + Send) -> Result<T, Fault> {
    let process = std::process::id();
    if process == LOADED_BY.load(Ordering::Relaxed) { work() } else { pool_of(process)?.install(work) }
}

/// Returns the pool of a forked process, which is made if it is the first time.
fn pool_of(process: u32) -> Result<&'static ThreadPool, Fault> {
    let known = FORKED.load(Ordering::Acquire);
    // SAFETY: the pointer is null or comes from `Box::leak` below, and is never freed. The pool of
    // a parent is not used: its number is looked at alone.
    if let Some(known) = unsafe { known.as_ref() }
        && known.process == process
    {
        return Ok(&known.threads);
    }
    let threads = rayon::ThreadPoolBuilder::new().build();
    let threads = threads.map_err(|e| Fault::internal(&format!("cannot start worker threads: {e}")))?;
    let made: &'static mut ForkedPool = Box::leak(Box::new(ForkedPool { process, threads }));
    let made: *mut ForkedPool = made;
    // Where two threads make one at the same time, each uses its own, and later calls the last.
    FORKED.store(made, Ordering::Release);
    // SAFETY: as above; nobody changes what the pointer leads to.
    Ok(unsafe { &(*made).threads })
}
