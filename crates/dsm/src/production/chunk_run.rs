//! Computing chunks of a planned run.

use std::path::PathBuf;
use std::sync::Arc;
use std::time::{Duration, Instant};

use numeric::Progress;
use serde::Serialize;

use crate::production::chunk_folder::{ChunkFolder, ChunkState};
use crate::production::chunk_selection::ChunkSelection;
use crate::production::claim::{Claim, Claimed};
use crate::production::error::ProductionError;
use crate::production::plan_file::PlanFile;
use crate::production::plan_run::plan_again;
use crate::{ChunkContent, ChunkResult, DsmError, InputStamps, Session, run_chunk};
use job::error::JobError;
use job::error_text::with_causes;
use job::output_folder::OutputFolder;
use job::threads;

/// Time between two looks at a run folder that another process has for itself.
const WAIT: Duration = Duration::from_millis(200);
/// Times that a run is planned again because something changed meanwhile.
const CHANGES: usize = 3;

/// Configuration of a process that computes chunks.
#[derive(Debug, Clone, PartialEq, Eq)]
#[non_exhaustive]
pub struct ChunkRunConfig {
    /// Folder of a planned run.
    pub folder: PathBuf,
    /// Chunks to compute.
    pub chunks: ChunkSelection,
    /// Whether failed chunks are tried again, and a run whose inputs, configuration or program have
    /// changed is planned and computed again.
    pub resume: bool,
    /// Worker threads; all cores when `None`.
    pub threads: Option<usize>,
    /// Identity of the plan that the caller knows; another one is refused.
    pub plan: Option<String>,
}

impl ChunkRunConfig {
    /// Makes the configuration of a process that computes all chunks.
    pub fn new(folder: PathBuf) -> Self {
        Self { folder, chunks: ChunkSelection::All, resume: false, threads: None, plan: None }
    }
}

/// What a process did with the chunks that it was to compute.
#[derive(Debug, Clone, PartialEq, Eq, Default, Serialize)]
#[non_exhaustive]
pub struct ChunkRunReport {
    /// Number of chunks in the plan.
    pub chunks: usize,
    /// Chunks that this process computed.
    pub computed: usize,
    /// Chunks that had a result already.
    pub done_before: usize,
    /// Chunks that other processes are computing.
    pub elsewhere: usize,
    /// Chunks that failed, now or before.
    pub failed: Vec<ChunkFault>,
}

/// A chunk that could not be computed.
#[derive(Debug, Clone, PartialEq, Eq, Serialize)]
#[non_exhaustive]
pub struct ChunkFault {
    /// Number of the chunk, from 0.
    pub chunk: usize,
    /// Cause.
    pub reason: String,
}

impl ChunkRunReport {
    /// Returns the report as text.
    pub fn text(&self) -> String {
        let Self { chunks, computed, done_before, elsewhere, failed } = self;
        let mut text = format!(
            "chunks     {chunks} in the plan: {computed} computed, {done_before} done before, {elsewhere} elsewhere, \
             {} failed\n",
            failed.len()
        );
        for ChunkFault { chunk, reason } in failed {
            text += &format!("failed     chunk {chunk}: {reason}\n");
        }
        text
    }
}

/// Computes the selected chunks of a planned run that have no result yet. Other processes may work
/// in the same folder at the same time.
///
/// # Errors
/// [`JobError`]: no plan, or one that is damaged or was replaced; another version, configuration or
/// input than was planned, unless the run is resumed; a chunk that the plan does not have, inputs
/// that change meanwhile, and when cancelled. A chunk that
/// fails is no error.
pub fn run_chunks(config: &ChunkRunConfig, progress: &dyn Progress) -> Result<ChunkRunReport, JobError> {
    Ok(steps(config, progress)?)
}

fn steps(config: &ChunkRunConfig, progress: &dyn Progress) -> Result<ChunkRunReport, ProductionError> {
    let (_share, file) = current_plan(config, progress)?;
    file.require(config.plan.as_deref())?;
    let count = file.plan.chunks.len();
    let chosen = config.chunks.of(count);
    let chosen = chosen.map_err(|index| DsmError::NoSuchChunk { index, count })?;
    let inputs = InputStamps::of(&file.plan.config);
    threads::install(config.threads, || {
        let mut session = Session::new(progress);
        let mut report = ChunkRunReport { chunks: count, ..ChunkRunReport::default() };
        if file.plan.chunk_side.is_some() {
            progress.begin("sweeping chunks", chosen.len());
        }
        for index in chosen {
            let worker = Worker { config, file: &file, inputs: &inputs };
            worker.work(index, &mut session, &mut report)?;
            if file.plan.chunk_side.is_some() {
                progress.step();
            }
        }
        Ok(report)
    })?
}

/// Returns the plan with a share of its folder. A plan that no longer fits is made again when the
/// run is resumed: by one of the processes that see it, while the others wait for it.
fn current_plan(
    config: &ChunkRunConfig,
    progress: &dyn Progress,
) -> Result<(OutputFolder, Arc<PlanFile>), ProductionError> {
    let read = || {
        let file = PlanFile::read_current(&config.folder)?;
        threads::install(config.threads, || file.check_inputs())??;
        Ok::<_, ProductionError>(file)
    };
    let (mut is_waiting, mut changes) = (false, 0);
    loop {
        // A folder without a plan is no run folder, and not worth a lock.
        let found = match read() {
            Err(error) if config.resume && error.is_change() => plan_again(&config.folder, config.threads, progress),
            other => other.map(|_| ()),
        };
        // What the plan rests on may have changed before the share was taken.
        let shared = found.and_then(|()| {
            let share = OutputFolder::share(&config.folder)?;
            Ok((share, read()?))
        });
        match shared {
            Ok(found) => return Ok(found),
            Err(error) if config.resume && error.is_change() && changes < CHANGES => changes += 1,
            Err(error) if config.resume && error.is_in_use() => {
                if !std::mem::replace(&mut is_waiting, true) {
                    progress.warn("another process has the run folder for itself; waiting for it");
                }
                std::thread::sleep(WAIT);
            }
            Err(error) => return Err(error),
        }
        progress.check_cancelled().map_err(DsmError::from)?;
    }
}

/// What the work on a chunk needs.
struct Worker<'a> {
    config: &'a ChunkRunConfig,
    file: &'a PlanFile,
    inputs: &'a InputStamps,
}

impl Worker<'_> {
    fn work(
        &self,
        index: usize,
        session: &mut Session<'_>,
        report: &mut ChunkRunReport,
    ) -> Result<(), ProductionError> {
        let folder = ChunkFolder::of(&self.config.folder, index);
        let plan = &self.file.id;
        // A result that is no longer as it was written is computed again, whoever damaged it.
        let again = |state: &ChunkState| match state {
            ChunkState::Failed { .. } => self.config.resume,
            done => folder.damage(done).is_some_and(|what| {
                session.progress.warn(&format!("the result of chunk {index} is damaged and computed again: {what}"));
                true
            }),
        };
        let Claimed::Ours(claim) = Claim::take(&folder, plan, again)? else {
            match folder.status(plan).map(|status| status.state) {
                Some(ChunkState::Done { .. }) => report.done_before += 1,
                Some(ChunkState::Failed { reason }) => report.failed.push(ChunkFault { chunk: index, reason }),
                _ => report.elsewhere += 1,
            }
            return Ok(());
        };
        let since = Instant::now();
        let result = run_chunk(&self.file.plan, index, session);
        self.inputs.check()?;
        if matches!(result, Err(DsmError::Cancelled)) {
            return Err(DsmError::Cancelled.into());
        }
        // Whoever took the claim over says how the chunk stands.
        if !claim.is_ours() {
            report.elsewhere += 1;
            return Ok(());
        }
        let state = match result {
            Err(error) => ChunkState::Failed { reason: with_causes(&error) },
            Ok(ChunkResult { content: ChunkContent::Failed { reason }, .. }) => ChunkState::Failed { reason },
            Ok(result) => {
                result.write(&folder.result())?;
                let files = folder.result_files()?;
                ChunkState::Done { seconds: since.elapsed().as_secs_f64(), files }
            }
        };
        match &state {
            ChunkState::Failed { reason } => report.failed.push(ChunkFault { chunk: index, reason: reason.clone() }),
            _ => report.computed += 1,
        }
        folder.set_status(plan, state)?;
        Ok(())
    }
}
