//! Merging the chunks of a planned run into its products.

use std::path::PathBuf;

use numeric::Progress;
use rayon::prelude::*;

use crate::production::chunk_folder::{ChunkFolder, ChunkState};
use crate::production::error::ProductionError;
use crate::production::plan_file::PlanFile;
use crate::products;
use crate::{ChunkResult, DsmError, DsmFolder, FILES, Merger, Product, StageTime, USED_CONFIG, refuse_results};
use job::error::JobError;
use job::output_folder::OutputFolder;
use job::threads;

/// Reason of a chunk that was not computed before a partial merge.
const NOT_COMPUTED: &str = "not computed";

/// How a chunk stands when its plan is merged.
enum Standing {
    /// It has a result.
    Done {
        /// Wall time, seconds.
        seconds: f64,
    },
    /// It is void for a reason.
    Void(String),
    /// Nobody has computed it.
    Missing,
}

/// Configuration of a merge.
#[derive(Debug, Clone, PartialEq, Eq)]
#[non_exhaustive]
pub struct MergeConfig {
    /// Folder of a planned run.
    pub folder: PathBuf,
    /// Whether chunks without a result are left void. Otherwise they are an error.
    pub partial: bool,
    /// Whether existing products may be replaced.
    pub overwrite: bool,
    /// Worker threads; all cores when `None`.
    pub threads: Option<usize>,
    /// Identity of the plan that the caller knows; another one is refused.
    pub plan: Option<String>,
}

impl MergeConfig {
    /// Makes the configuration of a merge of all chunks.
    pub fn new(folder: PathBuf) -> Self {
        Self { folder, partial: false, overwrite: false, threads: None, plan: None }
    }
}

/// Merges the chunks of a planned run. Failed chunks are void, and the report names them.
///
/// # Errors
/// [`JobError`]: no plan, or another one than this version and configuration make; chunks that are
/// missing or damaged unless a partial result is allowed; no chunk with a surface; products that
/// exist, a folder in which chunks are computed, what cannot be read or written, and when
/// cancelled. Nothing is left half-written.
pub fn merge_run(config: &MergeConfig, progress: &dyn Progress) -> Result<Product, JobError> {
    Ok(steps(config, progress)?)
}

fn steps(config: &MergeConfig, progress: &dyn Progress) -> Result<Product, ProductionError> {
    // A folder without a plan is no run folder, and not worth a lock.
    PlanFile::read_current(&config.folder)?;
    let folder = OutputFolder::take(&config.folder).map_err(DsmError::from)?;
    let file = PlanFile::read_current(&config.folder)?;
    file.require(config.plan.as_deref())?;
    if !config.overwrite {
        let products: Vec<&str> = FILES.into_iter().filter(|name| *name != USED_CONFIG).collect();
        refuse_results(&config.folder, &products)?;
    }
    threads::install(config.threads, || {
        let states = states(config, &file)?;
        let product = merge(&file, &states, DsmFolder::inside(folder)?, progress)?;
        let products = &file.plan.config.products;
        products::beside(&config.folder, products, config.overwrite, progress).map_err(DsmError::from)?;
        Ok(product)
    })?
}

/// Returns how all chunks stand. The results are compared with what was written, several at once.
fn states(config: &MergeConfig, file: &PlanFile) -> Result<Vec<Standing>, ProductionError> {
    let count = file.plan.chunks.len();
    let all: Vec<_> = (0..count).into_par_iter().map(|index| standing(config, file, index)).collect();
    // The error of the first chunk, whichever was seen first.
    let states = all.into_iter().collect::<Result<Vec<_>, _>>()?;
    let missing: Vec<usize> = (0..count).filter(|index| matches!(states[*index], Standing::Missing)).collect();
    if !config.partial && !missing.is_empty() {
        return Err(ProductionError::ChunksMissing { missing, count });
    }
    Ok(states)
}

fn standing(config: &MergeConfig, file: &PlanFile, index: usize) -> Result<Standing, ProductionError> {
    let folder = ChunkFolder::of(&config.folder, index);
    // Nobody computes now: this run has the folder for itself.
    folder.check()?;
    folder.remove_left_over()?;
    let state = folder.status(&file.id).map(|status| status.state);
    Ok(match (state.as_ref().and_then(|state| folder.damage(state)), state) {
        (Some(what), _) if config.partial => Standing::Void(format!("its result was damaged: {what}")),
        (Some(what), _) => return Err(ProductionError::ChunkDamaged { chunk: index, what }),
        (None, Some(ChunkState::Done { seconds, .. })) => Standing::Done { seconds },
        (None, Some(ChunkState::Failed { reason })) => Standing::Void(reason),
        (None, Some(ChunkState::Running(_)) | None) => Standing::Missing,
    })
}

fn merge(
    file: &PlanFile,
    states: &[Standing],
    folder: DsmFolder,
    progress: &dyn Progress,
) -> Result<Product, ProductionError> {
    let mut merger = Merger::begin(&file.plan, folder, progress)?;
    merger.plan_id = Some(file.id.clone());
    let read = |index: usize| {
        let is_done = matches!(states.get(index), Some(Standing::Done { .. }));
        is_done.then(|| checked(file, index))
    };
    let mut ahead = read(0);
    let (mut seconds, mut first) = (0.0, None);
    progress.begin("merging chunks", states.len());
    for (index, (chunk, state)) in file.plan.chunks.iter().zip(states).enumerate() {
        let reason = match state {
            Standing::Done { seconds: taken } => {
                progress.check_cancelled().map_err(DsmError::from)?;
                let result = std::mem::take(&mut ahead).unwrap_or_else(|| checked(file, index))?;
                let (added, next) = rayon::join(|| merger.add(result), || read(index + 1));
                added?;
                ahead = next;
                seconds += taken;
                progress.step();
                continue;
            }
            Standing::Void(reason) => reason.clone(),
            Standing::Missing => NOT_COMPUTED.to_owned(),
        };
        first.get_or_insert_with(|| reason.clone());
        merger.add_failed(chunk.core, reason);
    }
    match (merger.finish(&[StageTime { stage: "chunks".to_owned(), seconds }]), first) {
        (Err(DsmError::NoSurface { .. }), Some(reason)) => Err(ProductionError::NothingDone { reason }),
        (result, _) => Ok(result?),
    }
}

/// Reads the result of a chunk and compares it with the plan.
fn checked(file: &PlanFile, index: usize) -> Result<ChunkResult, DsmError> {
    let place = ChunkFolder::of(&file.plan.config.output, index).result();
    let result = ChunkResult::read(&place)?;
    result.check(&file.plan, index)?;
    Ok(result)
}
