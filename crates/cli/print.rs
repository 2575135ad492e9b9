//! Results on standard output.

use std::io::Write;

/// Writes bytes as they are.
pub(crate) fn bytes(bytes: &[u8]) -> anyhow::Result<()> {
    Ok(std::io::stdout().write_all(bytes)?)
}

/// Writes text as it is.
pub(crate) fn text(text: &str) -> anyhow::Result<()> {
    bytes(text.as_bytes())
}

/// Writes a report as JSON if asked for, or else as text if it is to be shown.
pub(crate) fn report(
    as_json: bool,
    is_shown: bool,
    report: &impl serde::Serialize,
    as_text: impl FnOnce() -> String,
) -> anyhow::Result<()> {
    match (as_json, is_shown) {
        (true, _) => json(report),
        (false, true) => text(&as_text()),
        (false, false) => Ok(()),
    }
}

/// Writes a value as indented JSON.
pub(crate) fn json(value: &impl serde::Serialize) -> anyhow::Result<()> {
    text(&(serde_json::to_string_pretty(value)? + "\n"))
}
