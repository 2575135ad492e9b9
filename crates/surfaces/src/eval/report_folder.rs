//! The folder that an evaluation writes its report to.

use std::path::{Path, PathBuf};

use report::EvaluationReport;

use super::error::EvalJobError;
use job::files::{self, FileError};
use job::guarded;
use job::output_folder::OutputFolder;

/// Name of the JSON report. It marks the folder of an evaluation.
pub(super) const REPORT_JSON: &str = "report.json";
/// Name of the errors as a GeoTIFF.
pub(super) const ERROR_MAP: &str = "error_map.tif";
/// Name of the errors as a picture.
pub(super) const ERROR_PICTURE: &str = "error_map.png";
/// Place of the picture on the map.
pub(super) const ERROR_WORLD: &str = "error_map.pgw";
/// Style of the GeoTIFF for QGIS.
pub(super) const ERROR_STYLE: &str = "error_map.qml";
/// Name of the page, which is written last, so that a folder with a page is complete.
pub(super) const PAGE: &str = "report.html";

/// Folder of the evaluation beside the results of a DSM run.
pub(super) const RUN_FOLDER: &str = "eval";

/// Removes the evaluation of the DSM in a run's folder, which is about to be replaced. Files that
/// no evaluation wrote stay.
pub fn remove_evaluation(run: &OutputFolder) -> Result<(), FileError> {
    let folder = run.path().join(RUN_FOLDER);
    let report = files::read_text(&folder.join(REPORT_JSON));
    if folder.is_symlink() || !report.is_ok_and(|text| EvaluationReport::is_ours(&text)) {
        return Ok(());
    }
    let others = [PAGE, ERROR_STYLE, ERROR_WORLD, ERROR_PICTURE, ERROR_MAP];
    guarded::remove_known(&folder, &|name| others.contains(&name))?;
    // The JSON marks the folder, so it goes last.
    guarded::remove_known(&folder, &|name| name == REPORT_JSON)
}

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
