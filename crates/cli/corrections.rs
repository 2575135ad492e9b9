//! The option `--corrections` of several commands.

use std::path::Path;

use jobs::corrections::CorrectionSource;

/// Reads `--corrections`: a report, the word `none`, or nothing (the corrections of the run that
/// made the surface).
pub(crate) fn corrections_of(option: Option<&Path>) -> CorrectionSource {
    match option {
        None => CorrectionSource::SurfaceRun,
        Some(word) if word.as_os_str() == "none" => CorrectionSource::Uncorrected,
        Some(report) => CorrectionSource::Report(report.to_owned()),
    }
}
