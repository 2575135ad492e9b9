//! The worker threads of a job.

use numeric::failures;

/// Most worker threads. Each takes memory for its stack.
const THREADS_MAX: usize = 1024;

/// Worker threads that cannot be started.
#[derive(Debug, thiserror::Error)]
#[non_exhaustive]
pub enum ThreadsError {
    /// No thread was asked for.
    #[error("the number of worker threads is 0, expected 1 or more")]
    Zero,
    /// More threads were asked for than any machine has use for.
    #[error("the number of worker threads is {threads}, expected at most {}", THREADS_MAX)]
    TooMany {
        /// How many were asked for.
        threads: usize,
    },
    /// The pool could not be made.
    #[error("cannot start {threads} worker threads: {reason}")]
    Start {
        /// How many were asked for.
        threads: usize,
        /// The reason that the pool gave.
        reason: String,
    },
}

failures!(ThreadsError: Input);

/// Runs `work` on a pool of `threads` workers, or on the caller's pool if no number is given.
///
/// # Errors
/// [`ThreadsError`] if the pool cannot be started.
pub fn install<T: Send>(threads: Option<usize>, work: impl FnOnce() -> T + Send) -> Result<T, ThreadsError> {
    let Some(threads) = threads else { return Ok(work()) };
    if threads == 0 {
        return Err(ThreadsError::Zero);
    }
    if threads > THREADS_MAX {
        return Err(ThreadsError::TooMany { threads });
    }
    let pool = rayon::ThreadPoolBuilder::new().num_threads(threads).build();
    let pool = pool.map_err(|e| ThreadsError::Start { threads, reason: e.to_string() })?;
    Ok(pool.install(work))
}

/// Returns the number of workers that encoders may use: the given number, or all cores.
pub fn count(threads: Option<usize>) -> usize {
    threads
        .map(|threads| threads.min(THREADS_MAX))
        .unwrap_or_else(|| std::thread::available_parallelism().map_or(1, usize::from))
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn absurd_numbers_of_threads_are_refused() {
        assert!(matches!(install(Some(0), || ()), Err(ThreadsError::Zero)));
        assert!(matches!(install(Some(100_000), || ()), Err(ThreadsError::TooMany { threads: 100_000 })));
        assert_eq!(count(Some(100_000)), THREADS_MAX);
    }
}
