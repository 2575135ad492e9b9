//! The files that both trainings write.

use std::path::{Path, PathBuf};

use ::train::TrainingState;
use formats::FormatError;
use formats::splat_ply::{self, LocalOrigin, SplatFile, SplatForm, SplatLayout};

use super::checkpoint::Checkpoint;
use super::error::TrainError;
use job::files::{self, FileError};
use job::output_folder::OutputFolder;

/// The splats.
const SPLATS: &str = "splats.ply";
/// The report, with its page beside.
pub(super) const REPORT: &str = "report.json";
/// The page of the report.
const PAGE: &str = "report.html";
/// The state to go on from, until the results are written.
pub(super) const CHECKPOINT: &str = "checkpoint.bin";
/// Folder of the views that were not trained on.
pub(super) const RENDERS: &str = "renders";
/// Thickness of a splat in the file, metres. 2DGS has none.
const THICKNESS_M: f32 = 1e-4;

/// Refuses a folder with results that may not be replaced, and a checkpoint that no training wrote.
/// Returns whether results may be replaced: where the user allows it, and where a training of all
/// `iterations` that is gone on with was killed while its results got their names.
pub(super) fn may_replace(output: &Path, overwrite: bool, resume: bool, iterations: u32) -> Result<bool, TrainError> {
    let checkpoint = output.join(CHECKPOINT);
    let results = [SPLATS, REPORT, PAGE].map(|name| output.join(name));
    let is_there = results.iter().any(|path| path.symlink_metadata().is_ok());
    let was_publishing = || Ok::<_, TrainError>(Checkpoint::iteration(&checkpoint)? >= Some(iterations));
    let may_replace = overwrite || (resume && is_there && was_publishing()?);
    results.iter().try_for_each(|path| files::refuse_existing(path, may_replace))?;
    if !resume && checkpoint.symlink_metadata().is_ok() && !Checkpoint::is_ours(&checkpoint) {
        let found = format!("{CHECKPOINT}, which no training wrote");
        return Err(FileError::Foreign { path: output.to_owned(), found }.into());
    }
    Ok(may_replace)
}

/// Takes away the report of earlier results, which are about to be replaced. Without it the folder
/// counts as incomplete.
pub(super) fn begin(folder: &OutputFolder) -> Result<(), FileError> {
    [REPORT, PAGE].into_iter().try_for_each(|name| folder.remove(name))
}

/// Writes splats with their harmonics and their origin, and returns their file.
pub(super) fn write_splats(
    output: &Path,
    state: &TrainingState,
    origin: &LocalOrigin,
    overwrite: bool,
) -> Result<PathBuf, FormatError> {
    let path = output.join(SPLATS);
    let file = SplatFile {
        splats: state.surfels.iter().map(|s| s.to_splat(THICKNESS_M)).collect(),
        harmonics: state.harmonics.to_splats(),
        labels: None,
        layout: SplatLayout { form: SplatForm::Discs, sh_degree: state.harmonics.degree() },
        origin: Some(origin.clone()),
    };
    splat_ply::write_file(&path, &file, overwrite)?;
    Ok(path)
}
