//! The plan of a run as a file.
//!
//! Paths in the file are relative to its folder. The identity of a plan is a hash of all that
//! decides the bytes of the result: version, configuration, contents of the inputs, chunks.

use std::path::{Path, PathBuf};
use std::sync::Arc;

use serde::{Deserialize, Serialize};

use crate::job_file::read_dsm_job;
use crate::production::content_hash;
use crate::production::error::ProductionError;
use crate::production::estimate::PlanEstimate;
use crate::production::input_files::{self, InputFile};
use crate::production::plan_cache::{LastRead, stamp};
use crate::{DsmConfig, Plan, USED_CONFIG, files_of, open};
use job::error::JobError;
use job::files::TEXT_LIMIT;
use job::job_paths::{relative, resolved};

/// Name of the plan in the folder of a run.
pub const PLAN: &str = "plan.json";
/// Name of the pointing corrections with their residuals, which later runs can use.
pub const POINTING: &str = "pointing.json";

/// The plan that this process read last.
static LAST: LastRead<PlanFile> = LastRead::new();

/// The plan of a run with the files that it rests on.
#[derive(Debug, Clone, PartialEq, Serialize, Deserialize)]
#[serde(deny_unknown_fields)]
#[non_exhaustive]
pub struct PlanFile {
    /// Identity: a hash of everything below but the times of the files.
    pub id: String,
    /// Memory and processor time.
    pub estimate: PlanEstimate,
    /// Files that the plan rests on.
    pub inputs: Vec<InputFile>,
    /// Grid, chunks with their windows, sources, heights and levels, choices with reasons.
    pub plan: Plan,
}

impl PlanFile {
    /// Puts a plan together with its inputs. Their paths become relative to `folder`.
    ///
    /// # Errors
    /// [`ProductionError::File`] when the plan cannot be written as JSON.
    pub(super) fn stored(plan: &Plan, inputs: Vec<InputFile>, folder: &Path) -> Result<Self, ProductionError> {
        let mut file = Self { id: String::new(), estimate: PlanEstimate::of(plan), inputs, plan: plan.clone() };
        // Whether files may be replaced is asked again of every command.
        file.plan.config.overwrite = false;
        file.map_paths(|path| relative(path, folder));
        file.id = file.identity()?;
        Ok(file)
    }

    fn identity(&self) -> Result<String, ProductionError> {
        let inputs: Vec<_> = self.inputs.iter().map(|input| (&input.path, &input.sha256)).collect();
        let plan = Plan { config: self.plan.config.deciding(), ..self.plan.clone() };
        Ok(content_hash::of_value(&(inputs, plan)).map_err(job::files::FileError::from)?)
    }

    fn map_paths(&mut self, change: impl Fn(&Path) -> PathBuf) {
        self.plan.config.map_paths(&change);
        let images =
            self.plan.images.iter_mut().flat_map(|image| std::iter::once(&mut image.path).chain(&mut image.masks));
        let reported = self.plan.report.images.iter_mut().map(|image| &mut image.path);
        let reference = self.plan.report.pointing.reference.iter_mut().map(|reference| &mut reference.path);
        for path in images.chain(reported).chain(reference).chain(self.inputs.iter_mut().map(|input| &mut input.path)) {
            *path = change(path);
        }
    }

    /// Reads the plan in the folder of a run, unless this process has read it last.
    ///
    /// # Errors
    /// [`JobError`]: no plan, a file that is damaged or was edited or whose parts do not fit each
    /// other, another version.
    pub fn read(folder: &Path) -> Result<Arc<Self>, JobError> {
        Ok(Self::stored_in(folder)?)
    }

    fn stored_in(folder: &Path) -> Result<Arc<Self>, ProductionError> {
        let stamp = stamp(&folder.join(PLAN));
        if let Some(known) = LAST.kept(folder, stamp) {
            return Ok(known);
        }
        let file = Arc::new(Self::parsed(folder)?);
        LAST.keep(folder, stamp, &file);
        Ok(file)
    }

    fn parsed(folder: &Path) -> Result<Self, ProductionError> {
        let path = folder.join(PLAN);
        let failed = |reason: String| ProductionError::Plan { path: path.clone(), reason };
        if !path.exists() {
            return Err(ProductionError::NoPlan { path });
        }
        let json = formats::read_regular(&path, TEXT_LIMIT).map_err(|e| failed(e.to_string()))?;
        let here = env!("CARGO_PKG_VERSION");
        if let Some(planned) = version_of(&json).filter(|planned| planned != here) {
            return Err(ProductionError::OtherVersion { path, planned, here: here.to_owned() });
        }
        let file: Self = serde_json::from_slice(&json).map_err(|e| failed(e.to_string()))?;
        if file.identity()? != file.id {
            return Err(failed("it is not as it was written".to_owned()));
        }
        if file.estimate != PlanEstimate::of(&file.plan) {
            return Err(failed("its estimate is that of another plan".to_owned()));
        }
        let file = file.located(folder);
        file.plan.check().map_err(failed)?;
        Ok(file)
    }

    /// Reads the plan in the folder of a run, and checks that the configuration there is still the
    /// one that it was made from.
    ///
    /// # Errors
    /// As [`Self::read`]; [`ProductionError::Job`], [`ProductionError::ConfigChanged`].
    pub(super) fn read_current(folder: &Path) -> Result<Arc<Self>, ProductionError> {
        let file = Self::stored_in(folder)?;
        let path = folder.join(USED_CONFIG);
        if !same(&read_dsm_job(&path)?, &file.plan.config, folder) {
            return Err(ProductionError::ConfigChanged { path });
        }
        Ok(file)
    }

    /// Checks that the plan is the one that a caller knows.
    ///
    /// # Errors
    /// [`ProductionError::OtherPlan`].
    pub(super) fn require(&self, known: Option<&str>) -> Result<(), ProductionError> {
        match known {
            Some(known) if known != self.id => {
                Err(ProductionError::OtherPlan { path: self.plan.config.output.join(PLAN) })
            }
            _ => Ok(()),
        }
    }

    /// Whether the plan is of a configuration.
    pub(super) fn is_of(&self, config: &DsmConfig) -> bool {
        same(&self.plan.config, config, &config.output)
    }

    /// Returns the plan with the paths that its folder makes of the relative ones.
    pub(super) fn located(mut self, folder: &Path) -> Self {
        self.map_paths(|path| resolved(path, folder));
        // As the caller names it, so that messages and reports do.
        folder.clone_into(&mut self.plan.config.output);
        self
    }

    /// Checks that the inputs have the content that was planned, that no file was added to the
    /// images, such as another RPC, and that the images of the plan are those of the files.
    ///
    /// # Errors
    /// [`ProductionError::InputChanged`], [`ProductionError::InputAdded`],
    /// [`ProductionError::Plan`], [`ProductionError::File`], [`ProductionError::Dsm`].
    pub(super) fn check_inputs(&self) -> Result<(), ProductionError> {
        input_files::check(&self.inputs)?;
        let files = files_of(&self.plan.config)?;
        let added = input_files::added(&files, &self.inputs);
        if let Some(path) = added {
            return Err(ProductionError::InputAdded { path: path.clone() });
        }
        let path = self.plan.config.output.join(PLAN);
        let failed = |reason: String| ProductionError::Plan { path, reason };
        self.plan.check_opened(&open(&self.plan.config)?).map_err(failed)
    }
}

/// Whether two configurations of a folder ask for the same result.
fn same(a: &DsmConfig, b: &DsmConfig, folder: &Path) -> bool {
    let plain = |config: &DsmConfig| {
        let mut config = config.deciding();
        config.output = PathBuf::new();
        config.map_paths(|path| relative(path, folder));
        config
    };
    plain(a) == plain(b)
}

/// Returns the version that made a plan, also one whose fields this version does not know.
fn version_of(json: &[u8]) -> Option<String> {
    #[derive(Deserialize)]
    struct Versioned {
        version: String,
    }
    #[derive(Deserialize)]
    struct Outer {
        plan: Versioned,
    }
    serde_json::from_slice::<Outer>(json).ok().map(|outer| outer.plan.version)
}
