//! The folder that an evaluation writes its report to.

use std::path::{Path, PathBuf};

use report::EvaluationReport;

use super::error::EvalJobError;
use crate::files;

/// Name of the JSON report. It marks the folder of an evaluation.
pub(super) const REPORT_JSON: &str = "report.json";

/// Fails if one of `paths` exists in a folder without the report of an evaluation, unless it may be
/// replaced.
pub(super) fn check_ours(folder: &Path, paths: &[PathBuf], overwrite: bool) -> Result<(), EvalJobError> {
    let report = files::read_text(&folder.join(REPORT_JSON));
    let ours = report.is_ok_and(|text| EvaluationReport::is_ours(&text));
    match paths.iter().find(|path| path.symlink_metadata().is_ok()) {
        Some(path) if !ours && !overwrite => Err(EvalJobError::ForeignFile { path: path.clone() }),
        _ => Ok(()),
    }
}
