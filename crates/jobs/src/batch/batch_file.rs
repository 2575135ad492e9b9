//! Batch files: TOML with `[defaults]`, `[limits]` and one `[[scene]]` for each scene.

use std::path::{Path, PathBuf};

use serde::{Deserialize, Serialize};
use toml::Table;

use crate::batch::error::BatchError;
use crate::batch::task::{TaskKind, TaskSettings};
use dsm::{LayerArea, MapBounds};
use job::error::JobError;
use job::files::read_text;
use job::job_file;
use job::job_paths::resolved;

/// A batch: scenes and what is to be made of them.
#[derive(Debug, Clone, PartialEq, Default, Serialize, Deserialize)]
#[serde(deny_unknown_fields, default)]
#[non_exhaustive]
pub struct BatchConfig {
    /// Folder of the results, with a folder for each scene.
    pub output: PathBuf,
    /// Limits of the whole batch.
    pub limits: BatchLimits,
    /// Tasks and settings of scenes that have none of their own.
    pub defaults: BatchDefaults,
    /// The scenes.
    #[serde(rename = "scene")]
    pub scenes: Vec<BatchScene>,
    /// Folder that paths in the settings are relative to.
    #[serde(skip)]
    pub(crate) folder: PathBuf,
    /// Names of the scenes that are worked on; all when empty.
    #[serde(skip)]
    only: Vec<String>,
}

/// Limits of the whole batch.
#[derive(Debug, Clone, PartialEq, Eq, Serialize, Deserialize)]
#[serde(deny_unknown_fields, default)]
#[non_exhaustive]
pub struct BatchLimits {
    /// Worker threads of all tasks together; all cores when `None`.
    pub threads: Option<usize>,
    /// Memory of all surface models that are computed at a time together, megabytes.
    pub memory_mb: Option<u64>,
    /// Scenes that are computed at a time.
    pub parallel: usize,
    /// Times that a failed task is tried again.
    pub retries: usize,
}

impl Default for BatchLimits {
    fn default() -> Self {
        Self { threads: None, memory_mb: None, parallel: 1, retries: 0 }
    }
}

/// Tasks and settings of scenes that have none of their own.
#[derive(Debug, Clone, PartialEq, Default, Serialize, Deserialize)]
#[serde(deny_unknown_fields, default)]
#[non_exhaustive]
pub struct BatchDefaults {
    /// Tasks of each scene.
    pub tasks: Option<Vec<String>>,
    /// Settings of surface models.
    pub dsm: Table,
    /// Settings of orthos.
    pub ortho: Table,
    /// Settings of evaluations.
    pub eval: Table,
    /// Settings of height maps.
    pub heightmap: Table,
    /// Settings of priors.
    pub priors: Table,
    /// Settings of terrain models.
    pub dtm: Table,
    /// Settings of classes.
    pub classes: Table,
    /// Settings of products.
    pub products: Table,
    /// Settings of changes.
    pub diff: Table,
}

/// A scene of a batch.
#[derive(Debug, Clone, PartialEq, Default, Serialize, Deserialize)]
#[serde(deny_unknown_fields)]
#[non_exhaustive]
pub struct BatchScene {
    /// Name, which is that of its folder.
    pub name: String,
    /// Images: files, or patterns with `*`, `?` and `[…]`.
    pub images: Vec<String>,
    /// Area of the surface model, in its CRS.
    pub bounds: Option<MapBounds>,
    /// Area of the surface model: a polygon of a layer, in place of bounds. Its name is the scene's
    /// unless it is given.
    pub area: Option<LayerArea>,
    /// What is to be made; the defaults' when `None`.
    pub tasks: Option<Vec<String>>,
    /// Settings of the surface model that differ from the defaults.
    #[serde(default)]
    pub dsm: Table,
    /// Settings of the ortho that differ from the defaults.
    #[serde(default)]
    pub ortho: Table,
    /// Settings of the evaluation that differ from the defaults.
    #[serde(default)]
    pub eval: Table,
    /// Settings of the height maps that differ from the defaults.
    #[serde(default)]
    pub heightmap: Table,
    /// Settings of the priors that differ from the defaults.
    #[serde(default)]
    pub priors: Table,
    /// Settings of the terrain model that differ from the defaults.
    #[serde(default)]
    pub dtm: Table,
    /// Settings of the classes that differ from the defaults.
    #[serde(default)]
    pub classes: Table,
    /// Settings of the products that differ from the defaults.
    #[serde(default)]
    pub products: Table,
    /// Settings of the change that differ from the defaults.
    #[serde(default)]
    pub diff: Table,
}

impl BatchConfig {
    /// Works on the scenes of these names alone; the others are reported as they stand.
    ///
    /// # Errors
    /// [`JobError`] for a scene that the batch does not have.
    pub fn select(&mut self, names: &[String]) -> Result<(), JobError> {
        let is_known = |name: &String| self.scenes.iter().any(|scene| scene.name == *name);
        if let Some(name) = names.iter().find(|name| !is_known(name)) {
            let known = self.scenes.iter().map(|scene| scene.name.as_str()).collect::<Vec<_>>().join(", ");
            return Err(BatchError::UnknownScene { name: name.clone(), known }.into());
        }
        self.only = names.to_vec();
        Ok(())
    }

    /// Whether a scene is worked on.
    pub(super) fn is_selected(&self, scene: &BatchScene) -> bool {
        self.only.is_empty() || self.only.contains(&scene.name)
    }

    /// Returns the settings of a task of a scene.
    pub(super) fn settings<'a>(&'a self, scene: &'a BatchScene, task: TaskKind) -> TaskSettings<'a> {
        let (defaults, own) = match task {
            TaskKind::Dsm => (&self.defaults.dsm, &scene.dsm),
            TaskKind::Ortho => (&self.defaults.ortho, &scene.ortho),
            TaskKind::Eval => (&self.defaults.eval, &scene.eval),
            TaskKind::HeightMap => (&self.defaults.heightmap, &scene.heightmap),
            TaskKind::Priors => (&self.defaults.priors, &scene.priors),
            TaskKind::Dtm => (&self.defaults.dtm, &scene.dtm),
            TaskKind::Classes => (&self.defaults.classes, &scene.classes),
            TaskKind::Products => (&self.defaults.products, &scene.products),
            TaskKind::Diff => (&self.defaults.diff, &scene.diff),
        };
        TaskSettings { defaults, own }
    }

    /// Returns the tasks of a scene, in the order in which they are done.
    ///
    /// # Errors
    /// [`BatchError::UnknownTask`].
    pub(super) fn tasks(&self, scene: &BatchScene) -> Result<Vec<TaskKind>, BatchError> {
        let fallback = || vec![TaskKind::Dsm.name().to_owned()];
        let names = scene.tasks.clone().or_else(|| self.defaults.tasks.clone()).unwrap_or_else(fallback);
        let one = |name: &String| {
            TaskKind::ALL.into_iter().find(|task| task.name() == name).ok_or_else(|| BatchError::UnknownTask {
                scene: scene.name.clone(),
                task: name.clone(),
                known: TaskKind::ALL.map(TaskKind::name).join(", "),
            })
        };
        let mut tasks = names.iter().map(one).collect::<Result<Vec<_>, _>>()?;
        tasks.sort_unstable();
        tasks.dedup();
        Ok(tasks)
    }

    fn validate(&self, path: &Path) -> Result<(), BatchError> {
        if self.output.as_os_str().is_empty() {
            return Err(BatchError::NoOutput { path: path.to_owned() });
        }
        if self.scenes.is_empty() {
            return Err(BatchError::NoScene { path: path.to_owned() });
        }
        let limits = [("parallel", self.limits.parallel), ("threads", self.limits.threads.unwrap_or(1))];
        if let Some((name, _)) = limits.into_iter().find(|(_, value)| *value == 0) {
            return Err(BatchError::Limit { name });
        }
        for (i, scene) in self.scenes.iter().enumerate() {
            let name = scene.name.clone();
            let is_plain = |c: char| c.is_alphanumeric() || matches!(c, '-' | '_' | '.' | ' ');
            if name.is_empty() || name.starts_with(['.', ' ']) || !name.chars().all(is_plain) {
                return Err(BatchError::SceneName { name });
            }
            if scene.bounds.is_some() && scene.area.is_some() {
                return Err(BatchError::TwoAreas { name });
            }
            if self.scenes[..i].iter().any(|other| other.name == name) {
                return Err(BatchError::SameName { name });
            }
        }
        Ok(())
    }
}

/// Reads a batch file.
///
/// # Errors
/// [`JobError`]: unknown keys, no scene or output folder, names that cannot be those of folders or
/// are given twice. Tasks and their settings are checked when the batch begins.
pub fn read_batch(path: &Path) -> Result<BatchConfig, JobError> {
    Ok(parsed(path)?)
}

fn parsed(path: &Path) -> Result<BatchConfig, BatchError> {
    let mut batch: BatchConfig = job_file::parse(&read_text(path)?, path)?;
    batch.validate(path)?;
    path.parent().unwrap_or(Path::new("")).clone_into(&mut batch.folder);
    let with_variables = |named: &Path| job_file::with_variables(named, path);
    batch.output = resolved(&with_variables(&batch.output)?, &batch.folder);
    for scene in &mut batch.scenes {
        for image in &mut scene.images {
            *image = with_variables(Path::new(image))?.to_string_lossy().into_owned();
        }
        if let Some(area) = &mut scene.area {
            area.file = resolved(&with_variables(&area.file)?, &batch.folder);
        }
    }
    Ok(batch)
}
