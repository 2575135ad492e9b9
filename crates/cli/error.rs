//! How an error reaches the user: `error: what happened`, one indented line per cause, and a hint
//! that names an option.

use std::fmt;
use std::io::{ErrorKind, Write};

use numeric::{Failure, Kind};

/// Hint for an output that exists.
const OVERWRITE: &str = "nothing was written: give --overwrite to replace it";

/// Hint for an input on a network.
const REMOTE: &str = "--allow-remote reads rasters from web addresses (https://…) that are given as inputs";

/// Hint for a geoid grid that is missing.
const GRIDS: &str = "--fetch-grids fetches geoid grids that PROJ does not find, once";

/// Advice that names options of the command line; errors of the library do not know them.
#[derive(Debug)]
struct Hint(String);

impl fmt::Display for Hint {
    fn fmt(&self, f: &mut fmt::Formatter<'_>) -> fmt::Result {
        f.write_str(&self.0)
    }
}

/// Adds a hint to an error of the library: the one given, or else that of its kind, where there is
/// one.
pub(crate) fn with_hint<E>(error: E, hint: Option<&str>) -> anyhow::Error
where
    E: Failure + Send + Sync + 'static,
{
    let of_kind = || match error.kind() {
        Kind::OutputExists => Some(OVERWRITE),
        Kind::RemoteRefused => Some(REMOTE),
        Kind::GridMissing => Some(GRIDS),
        _ => None,
    };
    match hint.or_else(of_kind) {
        Some(hint) => anyhow::Error::new(error).context(Hint(hint.to_owned())),
        None => error.into(),
    }
}

/// Adds the hint of its kind to an error of the library, where there is one.
pub(crate) fn hinted<E>(error: E) -> anyhow::Error
where
    E: Failure + Send + Sync + 'static,
{
    with_hint(error, None)
}

/// Whether the reader of our output went away (`skysweep … | head`), which is not our error.
pub(crate) fn is_closed_pipe(e: &anyhow::Error) -> bool {
    e.chain().filter_map(|cause| cause.downcast_ref::<std::io::Error>()).any(|io| io.kind() == ErrorKind::BrokenPipe)
}

/// Writes the error, its causes and its hint to standard error.
pub(crate) fn report(e: &anyhow::Error) {
    let hint = e.downcast_ref::<Hint>();
    let causes = e.chain().skip(usize::from(hint.is_some())).map(ToString::to_string);
    let (mut text, mut last) = (String::new(), String::new());
    for cause in causes {
        // Some errors have the text of their cause within their own.
        if text.is_empty() {
            text = format!("error: {cause}\n");
        } else if !last.contains(&cause) {
            text.push_str(&format!("  caused by: {cause}\n"));
        }
        last = cause;
    }
    if let Some(hint) = hint {
        text.push_str(&format!("  hint: {hint}\n"));
    }
    // Where even standard error is closed, only the exit code is left.
    let _ = std::io::stderr().write_all(text.as_bytes());
}
