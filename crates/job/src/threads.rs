//! The worker threads of a job.

use numeric::failures;

use crate::error::{JobError, SettingError, from_failures};

/// Most worker threads. Each takes memory for its stack.
const THREADS_MAX: usize = 1024;

/// Worker threads that cannot be started.
#[derive(Debug, thiserror::Error)]
#[error("cannot start {threads} worker threads: {reason}")]
pub(crate) struct ThreadsError {
    threads: usize,
    reason: String,
}

failures!(ThreadsError: Input);

from_failures!(ThreadsError);

/// Runs `work` on a pool of `threads` workers, or on the caller's pool if no number is given.
///
/// # Errors
/// [`JobError`] for a number of threads that is 0 or above 1024, and if the pool cannot be started.
pub fn install<T: Send>(threads: Option<usize>, work: impl FnOnce() -> T + Send) -> Result<T, JobError> {
    let Some(threads) = threads else { return Ok(work()) };
    let unusable = |expected: String| SettingError::new("the number of worker threads", threads, expected);
    if threads == 0 {
        return Err(unusable("1 or more".to_owned()).into());
    }
    if threads > THREADS_MAX {
        return Err(unusable(format!("at most {THREADS_MAX}")).into());
    }
    let pool = rayon::ThreadPoolBuilder::new().num_threads(threads).build();
    let pool = pool.map_err(|e| ThreadsError { threads, reason: e.to_string() })?;
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
    use numeric::{Failure, Kind};

    use super::*;

    #[test]
    fn absurd_numbers_of_threads_are_refused() {
        for (threads, expected) in [(0, "is 0, expected 1 or more"), (100_000, "is 100000, expected at most 1024")] {
            let refused = install(Some(threads), || ()).unwrap_err();
            assert_eq!(refused.to_string(), format!("the number of worker threads {expected}"));
            assert_eq!((refused.kind(), refused.setting()), (Kind::Input, Some("the number of worker threads")));
        }
        assert_eq!(count(Some(100_000)), THREADS_MAX);
    }
}
