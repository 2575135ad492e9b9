//! Log lines on standard error: warnings by default, more with `-v`, nothing but errors with `-q`.
//!
//! Errors and warnings begin with `error: ` and `warning: `, as everywhere in the program.
//! `SKYSWEEP_LOG` (a `tracing` filter such as `io=trace`) replaces both options.

use std::fmt;

use tracing::{Event, Level, Subscriber};
use tracing_subscriber::EnvFilter;
use tracing_subscriber::fmt::format::Writer;
use tracing_subscriber::fmt::{FmtContext, FormatEvent, FormatFields};
use tracing_subscriber::registry::LookupSpan;

use crate::Global;

/// One event a line, without time and place.
struct Lines;

impl<S, N> FormatEvent<S, N> for Lines
where
    S: Subscriber + for<'a> LookupSpan<'a>,
    N: for<'a> FormatFields<'a> + 'static,
{
    fn format_event(&self, context: &FmtContext<'_, S, N>, mut out: Writer<'_>, event: &Event<'_>) -> fmt::Result {
        match *event.metadata().level() {
            Level::ERROR => out.write_str("error: ")?,
            Level::WARN => out.write_str("warning: ")?,
            _ => {}
        }
        context.format_fields(out.by_ref(), event)?;
        writeln!(out)
    }
}

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
        .with_ansi(false)
        // The log would report a broken standard error on standard error, and panic.
        .log_internal_errors(false)
        .event_format(Lines)
        .init();
}
