//! How an error reaches the user: `error: what happened`, then one indented line per cause, on standard error.

use std::io::{ErrorKind, Write};

/// Whether the reader of our output went away (`skysweep … | head`), which is no error of ours.
pub(crate) fn is_closed_pipe(e: &anyhow::Error) -> bool {
    e.chain().filter_map(|cause| cause.downcast_ref::<std::io::Error>()).any(|io| io.kind() == ErrorKind::BrokenPipe)
}

/// Writes the error and its causes to standard error.
pub(crate) fn report(e: &anyhow::Error) {
    let mut text = format!("error: {e}\n");
    for cause in e.chain().skip(1) {
        text.push_str(&format!("  caused by: {cause}\n"));
    }
    // Where even standard error is closed, the exit code is all that is left to say it with.
    let _ = std::io::stderr().write_all(text.as_bytes());
}
