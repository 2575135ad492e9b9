//! A surface model that goes on where an earlier run was stopped, in one call.

use std::fs;

use numeric::Progress;

use crate::production::chunk_folder::{self, CHUNKS};
use crate::production::chunk_run::{ChunkRunConfig, run_chunks};
use crate::production::error::ProductionError;
use crate::production::merge_run::{MergeConfig, merge_run};
use crate::production::plan_file::PlanFile;
use crate::production::plan_run::plan_run;
use crate::{DsmConfig, DsmReport};
use job::error::JobError;
use job::files::FileError;
use job::output_folder::OutputFolder;

/// Plans, computes and merges a surface model in its output folder. A plan of the same
/// configuration and inputs that is there is gone on with. The results of the chunks are removed
/// when the surface model is whole.
///
/// # Errors
/// Those of [`plan_run`], [`run_chunks`] and [`merge_run`].
pub fn make_or_resume(config: &DsmConfig, progress: &dyn Progress) -> Result<DsmReport, JobError> {
    Ok(steps(config, progress)?)
}

fn steps(config: &DsmConfig, progress: &dyn Progress) -> Result<DsmReport, ProductionError> {
    config.validate()?;
    let planned = PlanFile::read_current(&config.output);
    let fits = planned.is_ok_and(|file| file.is_of(config) && file.check_inputs().is_ok());
    if !(fits && config.overwrite) {
        plan_run(config, progress)?;
    }
    let mut chunks = ChunkRunConfig::new(config.output.clone());
    (chunks.resume, chunks.threads) = (true, config.threads);
    run_chunks(&chunks, progress)?;
    let mut merge = MergeConfig::new(config.output.clone());
    (merge.overwrite, merge.threads) = (true, config.threads);
    let report = merge_run(&merge, progress)?.report;
    if report.chunks.as_ref().is_none_or(|chunks| chunks.failed.is_empty()) {
        remove_chunks(config, progress)?;
    }
    Ok(report)
}

/// Removes the results of the chunks, unless somebody works on them. They leave their name at once,
/// so that a killed process leaves none that looks whole.
fn remove_chunks(config: &DsmConfig, progress: &dyn Progress) -> Result<(), FileError> {
    let path = config.output.join(CHUNKS);
    let folder = match OutputFolder::take(&config.output) {
        // Whoever has the folder now goes on with them.
        Err(FileError::InUse { .. }) => return Ok(()),
        other => other?,
    };
    if let Err(error) = chunk_folder::check_all(folder.path()) {
        // The surface model is whole; what somebody put among the chunks stays with them.
        progress.warn(&format!("the results of the chunks are not removed: {error}"));
        return Ok(());
    }
    let work = folder.work_folder()?;
    let failed = |source| FileError::Remove { path: path.clone(), source };
    fs::rename(&path, work.path().join(CHUNKS)).map_err(failed)?;
    work.close().map_err(failed)
}
