//! Log lines on standard error: warnings by default, more with `-v`, nothing but errors with `-q`.
//!
//! `SKYSWEEP_LOG` (a `tracing` filter such as `io=trace`) replaces both options.

use tracing_subscriber::EnvFilter;

use crate::Global;

/// Installs the subscriber; called once.
pub(crate) fn init(global: Global) {
    let level = match (global.quiet, global.verbose) {
        (true, _) => "error",
        (false, 0) => "warn",
        (false, 1) => "info",
        (false, _) => "debug",
    };
    let filter = EnvFilter::try_from_env("SKYSWEEP_LOG").unwrap_or_else(|_| EnvFilter::new(level));
    tracing_subscriber::fmt()
        .with_env_filter(filter)
        .with_writer(std::io::stderr)
        .with_target(false)
        .with_level(false)
        .without_time()
        .with_ansi(false)
        // The log would report a broken standard error on standard error, and panic.
        .log_internal_errors(false)
        .init();
}
