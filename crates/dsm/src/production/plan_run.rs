//! Planning a run: the scene is looked at once, and what was found is written for the chunks.

use std::path::Path;
use std::sync::Arc;

use numeric::Progress;
use serde::Serialize;

use crate::{
    DsmConfig, DsmError, FILES, Plan, PlanReport, Session, USED_CONFIG, open, plan, point, refuse_results, register,
    write_config,
};

use crate::production::chunk_folder;
use crate::production::error::ProductionError;
use crate::production::input_files::inputs_of;
use crate::production::plan_file::{PLAN, POINTING, PlanFile};
use job::error::JobError;
use job::files::write_json;
use job::job_paths::resolved;
use job::output_folder::OutputFolder;
use job::threads;

/// What `pointing.json` holds: the pointing part of a plan, in the form of a report.
#[derive(Serialize)]
struct PointingFile<'a> {
    version: &'a str,
    #[serde(flatten)]
    found: PlanReport,
}

/// Plans a run and writes nothing.
///
/// # Errors
/// [`JobError`]: a configuration or images that cannot be used.
pub fn make_plan(config: &DsmConfig, progress: &dyn Progress) -> Result<PlanFile, JobError> {
    Ok(steps(config, progress)?)
}

fn steps(config: &DsmConfig, progress: &dyn Progress) -> Result<PlanFile, ProductionError> {
    config.validate()?;
    Ok(stored_plan(config, progress)?.located(&config.output))
}

fn stored_plan(config: &DsmConfig, progress: &dyn Progress) -> Result<PlanFile, ProductionError> {
    threads::install(config.threads, || {
        // Hashed first: a file that changes while it is read differs from its hash afterwards.
        let inputs = inputs_of(config)?;
        let found = chain(config, &mut Session::new(progress))?;
        PlanFile::stored(&found, inputs, &config.output)
    })?
}

fn chain(config: &DsmConfig, session: &mut Session<'_>) -> Result<Plan, DsmError> {
    let opened = open(config)?;
    opened.warn(session.progress);
    let pointed = register(config, point(config, &opened, session)?, session)?;
    plan(config, &pointed, session)
}

/// Plans a run into its output folder: `used_config.toml`, `pointing.json` and `plan.json`.
///
/// Results of chunks stay when the same plan is made again, and are removed when it is another one.
///
/// # Errors
/// As [`make_plan`]; [`DsmError::Exists`] for a folder with a plan or results, unless the
/// configuration allows to replace them; [`DsmError::InUse`].
pub fn plan_run(config: &DsmConfig, progress: &dyn Progress) -> Result<PlanFile, JobError> {
    Ok(planned(config, progress)?)
}

fn planned(config: &DsmConfig, progress: &dyn Progress) -> Result<PlanFile, ProductionError> {
    config.validate()?;
    let folder = OutputFolder::take(&config.output).map_err(DsmError::from)?;
    if !config.overwrite {
        refuse_results(folder.path(), &[PLAN])?;
        // A configuration alone is a job file, or what a killed process left.
        let results: Vec<&str> = FILES.into_iter().filter(|name| *name != USED_CONFIG).collect();
        refuse_results(folder.path(), &results)?;
    }
    chunk_folder::check_all(folder.path())?;
    let file = stored_plan(config, progress)?;
    replace(&folder, config, &file)?;
    Ok(file.located(&config.output))
}

/// Writes a plan, and removes the chunks of others.
fn replace(folder: &OutputFolder, config: &DsmConfig, file: &PlanFile) -> Result<(), ProductionError> {
    write(folder, config, file)?;
    Ok(chunk_folder::remove_others(folder.path(), &file.id)?)
}

/// Writes the files of a plan. The plan itself comes last. Until then the folder has the old one,
/// which the new configuration or the new inputs make void.
fn write(folder: &OutputFolder, config: &DsmConfig, file: &PlanFile) -> Result<(), ProductionError> {
    let work = folder.work_folder()?;
    let asked = DsmConfig { overwrite: false, ..config.clone() };
    write_config(&work.path().join(USED_CONFIG), &asked, folder.path())?;
    let mut found = file.plan.report.clone();
    for image in &mut found.images {
        image.path = resolved(&image.path, folder.path());
    }
    let pointing = PointingFile { version: &file.plan.version, found };
    write_json(&work.path().join(POINTING), &pointing, false)?;
    write_json(&work.path().join(PLAN), file, false)?;
    for name in [USED_CONFIG, POINTING, PLAN] {
        folder.publish(work.path(), name)?;
    }
    Ok(())
}

/// Plans the run of a folder again from the configuration there, with `threads` where given.
/// Does nothing when another process was faster, and the plan fits.
///
/// # Errors
/// As [`plan_run`]; [`ProductionError::Job`].
pub(super) fn plan_again(
    folder: &Path,
    threads: Option<usize>,
    progress: &dyn Progress,
) -> Result<(), ProductionError> {
    let taken = OutputFolder::take(folder)?;
    let fits = |file: Arc<PlanFile>| threads::install(threads, || file.check_inputs())?;
    match PlanFile::read_current(folder).and_then(fits) {
        Ok(()) => return Ok(()),
        Err(error) => progress.warn(&format!("the run is planned and computed again: {error}")),
    }
    let mut config = crate::job_file::read_dsm_job(&folder.join(USED_CONFIG))?;
    folder.clone_into(&mut config.output);
    config.validate()?;
    chunk_folder::check_all(folder)?;
    let file = stored_plan(&DsmConfig { threads: threads.or(config.threads), ..config.clone() }, progress)?;
    replace(&taken, &config, &file)
}
