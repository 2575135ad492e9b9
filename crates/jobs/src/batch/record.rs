//! What is known of a task from earlier runs of the batch, so that what is complete is left alone.

use std::collections::BTreeSet;
use std::path::{Path, PathBuf};

use serde::{Deserialize, Serialize};
use serde_json::Value;

use crate::batch::task::TaskJob;
use dsm::files_of;
use dsm::production::{InputFile, ProductFile, added_input, check_inputs, inputs_of};
use job::error_text::with_causes;
use job::files::{TEXT_LIMIT, write_json};

/// The record of a task.
#[derive(Debug, Clone, PartialEq, Serialize, Deserialize)]
pub(super) struct TaskRecord {
    /// Hash of the settings and of the version.
    pub(super) key: String,
    /// Whether the task was done to the end.
    pub(super) is_done: bool,
    /// Files that the task read.
    pub(super) inputs: Vec<InputFile>,
    /// Files that the task made, relative to the folder of the scene. A record without any proves
    /// nothing.
    #[serde(default)]
    pub(super) products: Vec<ProductFile>,
    /// How the task went.
    #[serde(default)]
    pub(super) course: TaskCourse,
}

/// How a task went, for the reports of later runs of the batch.
#[derive(Debug, Clone, Default, PartialEq, Serialize, Deserialize)]
pub(super) struct TaskCourse {
    /// Wall time, seconds.
    pub(super) seconds: f64,
    /// Times that it was tried.
    pub(super) attempts: usize,
    /// Warnings that it gave.
    pub(super) warnings: Vec<String>,
}

/// What a record says of a task that is to be done.
#[derive(Debug, Clone, PartialEq)]
pub(super) enum Standing {
    /// It is done, and settings, inputs and products are as they were.
    Complete,
    /// It was never done to the end, or settings or inputs have changed since.
    Open,
    /// It was done, and a product is no longer as it was written: the product and what is wrong.
    Damaged(String),
}

impl TaskRecord {
    /// Makes the record of a task that begins.
    ///
    /// # Errors
    /// A text for an input that cannot be read.
    pub(super) fn begin(job: &TaskJob) -> Result<Self, String> {
        Ok(Self {
            key: key_of(job)?,
            is_done: false,
            inputs: inputs_of_job(job)?,
            products: Vec::new(),
            course: TaskCourse::default(),
        })
    }

    /// Reads a record; `None` when there is none.
    pub(super) fn read(path: &Path) -> Option<Self> {
        serde_json::from_slice(&formats::read_regular(path, TEXT_LIMIT).ok()?).ok()
    }

    /// Writes the record.
    ///
    /// # Errors
    /// A text for a file that cannot be written.
    pub(super) fn write(&self, path: &Path) -> Result<(), String> {
        write_json(path, self, true).map_err(|e| with_causes(&e))
    }

    /// Notes that the task is done: its products in the folder of the scene, with their hashes.
    ///
    /// # Errors
    /// A text for a product that is missing or cannot be read.
    pub(super) fn finish(&mut self, job: &TaskJob, scene: &Path, course: TaskCourse) -> Result<(), String> {
        if let Some(missing) = job.needed().into_iter().find(|path| path.symlink_metadata().is_err()) {
            return Err(format!("the task ended without its result: {} is missing", missing.display()));
        }
        let inside = |path: PathBuf| path.strip_prefix(scene).map(Path::to_owned).unwrap_or(path);
        let places: Vec<PathBuf> = job.places().into_iter().map(inside).collect();
        self.products = ProductFile::all_of(scene, &places).map_err(|e| with_causes(&e))?;
        self.course = course;
        self.is_done = true;
        Ok(())
    }

    /// Returns how the task stands: whether it is done, and settings, inputs and products are as
    /// they were.
    pub(super) fn standing(&self, job: &TaskJob, scene: &Path) -> Standing {
        let is_as_asked = self.is_done
            && key_of(job).is_ok_and(|key| key == self.key)
            && check_inputs(&self.inputs).is_ok()
            && files_of_images(job).is_ok_and(|files| added_input(&files, &self.inputs).is_none())
            && !self.products.is_empty();
        match ProductFile::damage(scene, &self.products) {
            _ if !is_as_asked => Standing::Open,
            Some(what) => Standing::Damaged(what),
            None => Standing::Complete,
        }
    }
}

/// Returns the hash of all settings that decide the result.
fn key_of(job: &TaskJob) -> Result<String, String> {
    let mut plain = job.clone();
    plain.set_running(None, false);
    if let TaskJob::Dsm(config) = &mut plain {
        **config = config.deciding();
    }
    dsm::production::hash_of(&(env!("CARGO_PKG_VERSION"), plain)).map_err(|e| e.to_string())
}

/// Returns the files that a task reads: those of the images of a surface model, and for other tasks
/// every file that the settings name, with the files of a surface model.
fn inputs_of_job(job: &TaskJob) -> Result<Vec<InputFile>, String> {
    if let TaskJob::Dsm(config) = job {
        return inputs_of(config).map_err(|e| with_causes(&e));
    }
    let mut files = files_of_images(job)?;
    collect(&serde_json::to_value(job).map_err(|e| e.to_string())?, &mut files);
    let product = job.product();
    let one = |path: &PathBuf| InputFile::of(path).map_err(|e| with_causes(&e));
    files.iter().filter(|path| !path.starts_with(&product)).map(one).collect()
}

/// Returns the files that belong to the images of a task, such as RPCs beside them.
fn files_of_images(job: &TaskJob) -> Result<BTreeSet<PathBuf>, String> {
    let images = match job {
        TaskJob::Dsm(config) => return files_of(config).map_err(|e| with_causes(&e)),
        TaskJob::Ortho(config) => config.images.as_slice(),
        TaskJob::Priors(config) => config.cameras.as_slice(),
        TaskJob::Classes(config) => config.multispectral.as_slice(),
        TaskJob::Eval(_) | TaskJob::HeightMap(_) | TaskJob::Dtm(_) | TaskJob::Products(_) | TaskJob::Diff(_) => &[],
    };
    Ok(images.iter().filter(|path| path.is_file()).flat_map(|path| formats::rpc::side_files(path)).collect())
}

/// Collects the files that the texts of a value name. A folder of a run stands for its surface
/// model.
fn collect(value: &Value, files: &mut BTreeSet<PathBuf>) {
    match value {
        Value::String(text) => {
            let path = Path::new(text);
            let inside = path.join("dsm/dsm.tif");
            files.extend([path.to_owned(), inside].into_iter().filter(|path| path.is_file()));
        }
        Value::Array(all) => all.iter().for_each(|value| collect(value, files)),
        Value::Object(all) => all.values().for_each(|value| collect(value, files)),
        _ => {}
    }
}
