//! The tasks of a batch: the configuration of a job from the settings of a scene, and the job
//! itself.

use std::path::{Path, PathBuf};

use numeric::Progress;
use serde::de::DeserializeOwned;
use serde::{Deserialize, Serialize};
use toml::{Table, Value};

use dsm::production::{PLAN, POINTING, make_or_resume};
use dsm::products::ProductsConfig;
use dsm::{DsmConfig, FILES, LayerArea, MapBounds, USED_CONFIG};
use job::error_text::with_causes;
use job::job_file::in_words;
use job::job_paths::resolved;
use job::path_variables::expanded;
use scenes::priors::PriorsConfig;
use surfaces::camera_stand::{StandConfig, StandSource};
use surfaces::classes::ClassesConfig;
use surfaces::diff::DiffConfig;
use surfaces::dtm::DtmConfig;
use surfaces::eval::{EvalTarget, GridEvalConfig};
use surfaces::heightmap::HeightMapConfig;
use surfaces::ortho::OrthoConfig;

/// What a batch can make of a scene, in the order in which it is made.
#[derive(Debug, Clone, Copy, PartialEq, Eq, PartialOrd, Ord, Serialize, Deserialize)]
#[serde(rename_all = "lowercase")]
#[non_exhaustive]
pub enum TaskKind {
    /// The surface model.
    Dsm,
    /// The images laid on it.
    Ortho,
    /// Its errors against a reference.
    Eval,
    /// Height maps of it.
    HeightMap,
    /// Priors of a city model for the images.
    Priors,
    /// The bare ground under it.
    Dtm,
    /// Ground, buildings and vegetation.
    Classes,
    /// Point cloud, mesh, contour lines and what else can be made of it.
    Products,
    /// What changed against the surface model of another date.
    Diff,
}

impl TaskKind {
    /// All tasks.
    pub const ALL: [Self; 9] = [
        Self::Dsm,
        Self::Ortho,
        Self::Eval,
        Self::HeightMap,
        Self::Priors,
        Self::Dtm,
        Self::Classes,
        Self::Products,
        Self::Diff,
    ];

    /// Returns the name that batch files have for the task.
    pub const fn name(self) -> &'static str {
        match self {
            Self::Dsm => "dsm",
            Self::Ortho => "ortho",
            Self::Eval => "eval",
            Self::HeightMap => "heightmap",
            Self::Priors => "priors",
            Self::Dtm => "dtm",
            Self::Classes => "classes",
            Self::Products => "products",
            Self::Diff => "diff",
        }
    }

    /// Settings that the batch itself makes.
    const fn made(self) -> &'static [&'static str] {
        match self {
            Self::Dsm => &["images", "output", "threads", "overwrite", "bounds", "area"],
            Self::Ortho => &["images", "surface", "output", "threads", "overwrite"],
            Self::Eval => &["test", "target", "page", "error_map", "threads", "overwrite"],
            Self::HeightMap => &["source", "output", "threads", "overwrite"],
            Self::Priors => &["cameras", "output", "threads", "overwrite"],
            Self::Dtm | Self::Classes => &["surface", "output", "threads", "overwrite"],
            Self::Products => &["run", "output", "threads", "overwrite"],
            Self::Diff => &["after", "output", "threads", "overwrite"],
        }
    }

    /// Settings that must be given.
    const fn needed(self) -> &'static [&'static str] {
        match self {
            Self::Dsm | Self::Ortho | Self::Dtm | Self::Classes | Self::Products => &[],
            Self::Eval => &["reference"],
            Self::HeightMap => &["stand"],
            Self::Priors => &["model"],
            Self::Diff => &["before"],
        }
    }

    /// Settings that are paths.
    const fn paths(self) -> &'static [&'static str] {
        match self {
            Self::Dsm => &["dem", "reference_dem", "prior", "control", "corrections", "masks", "image_masks"],
            Self::Ortho => &["report"],
            Self::Eval => &["reference", "classes", "mask", "terrain", "confidence", "objects"],
            Self::HeightMap => &["terrain", "raster", "list", "camera_file"],
            Self::Priors => &["model", "transform", "corrections"],
            Self::Dtm => &[],
            Self::Classes => &["vegetation_index", "multispectral", "building_index", "report"],
            Self::Products => &["ortho"],
            Self::Diff => &["before", "areas"],
        }
    }
}

/// Settings of one task: the defaults' and the scene's own.
#[derive(Debug, Clone, Copy)]
pub struct TaskSettings<'a> {
    /// Settings of all scenes.
    pub defaults: &'a Table,
    /// Settings of this scene, which go before.
    pub own: &'a Table,
}

/// What a job that ran to its end left.
#[derive(Debug, Default)]
pub(super) struct TaskOutcome {
    /// What is missing from the result; `None` when it is whole.
    pub(super) missing: Option<String>,
    /// Warnings that the report of the result holds.
    pub(super) warnings: Vec<String>,
}

impl TaskOutcome {
    fn whole_unless(missing: Option<String>) -> Self {
        Self { missing, warnings: Vec::new() }
    }
}

/// The scene that a task works on.
#[derive(Debug, Clone)]
pub(super) struct TaskScene<'a> {
    /// Folder of the batch file.
    pub(super) base: &'a Path,
    /// Images.
    pub(super) images: Vec<PathBuf>,
    /// Folder of the scene.
    pub(super) folder: PathBuf,
    /// Whether a surface model is made before the other tasks.
    pub(super) has_surface: bool,
    /// Area of the surface model.
    pub(super) bounds: Option<MapBounds>,
    /// Polygons in which the surface model lies.
    pub(super) area: Option<LayerArea>,
}

/// The job of a task, ready to run.
#[derive(Debug, Clone, Serialize)]
#[serde(rename_all = "lowercase")]
pub(super) enum TaskJob {
    Dsm(Box<DsmConfig>),
    Ortho(OrthoConfig),
    Eval(Box<GridEvalConfig>),
    HeightMap(Box<HeightMapConfig>),
    Priors(Box<PriorsConfig>),
    Dtm(DtmConfig),
    Classes(Box<ClassesConfig>),
    Products(ProductsConfig),
    Diff(Box<DiffConfig>),
}

impl TaskJob {
    /// Makes the job of a task from the settings of a scene.
    ///
    /// # Errors
    /// A text for settings that the job does not have, or that the batch makes itself.
    pub(super) fn new(kind: TaskKind, settings: TaskSettings<'_>, scene: &TaskScene<'_>) -> Result<Self, String> {
        let mut given = settings.defaults.clone();
        lay_over(&mut given, settings.own);
        if let Some(key) = kind.made().iter().find(|key| given.contains_key(**key)) {
            return Err(format!("`{key}` is set by the batch itself; leave it out"));
        }
        if let Some(key) = kind.needed().iter().find(|key| !given.contains_key(**key)) {
            return Err(format!("`{key}` is missing"));
        }
        resolve_paths(&mut given, kind.paths(), scene.base)?;
        let (images, folder) = (scene.images.clone(), scene.folder.clone());
        Ok(match kind {
            TaskKind::Dsm => {
                let mut base = DsmConfig::new(images, folder);
                base.bounds = scene.bounds;
                base.area.clone_from(&scene.area);
                Self::Dsm(Box::new(with(&base, &given)?))
            }
            TaskKind::Ortho => {
                let output = folder.join("ortho/ortho.tif");
                Self::Ortho(with(&OrthoConfig::new(images, folder, output), &given)?)
            }
            TaskKind::Eval => {
                let mut base = GridEvalConfig::new(folder.join("dsm/dsm.tif"), PathBuf::new());
                // A report that is asked for is an error when it cannot be written.
                base.target = EvalTarget::Folder(folder.join("eval"));
                Self::Eval(Box::new(with(&base, &given)?))
            }
            TaskKind::HeightMap => Self::HeightMap(Box::new(height_map(&folder, &given)?)),
            TaskKind::Priors => {
                let mut base = PriorsConfig::new(PathBuf::new(), images, folder.join("priors"));
                base.corrections = scene.has_surface.then(|| folder.join("report/report.json"));
                Self::Priors(Box::new(with(&base, &given)?))
            }
            TaskKind::Dtm => Self::Dtm(with(&DtmConfig::new(folder.clone(), folder.join("dtm")), &given)?),
            TaskKind::Classes => {
                let base = ClassesConfig::new(folder.clone(), folder.join("classes"));
                Self::Classes(Box::new(with(&base, &given)?))
            }
            TaskKind::Products => Self::Products(with(&ProductsConfig::new(folder), &given)?),
            TaskKind::Diff => {
                let base = DiffConfig::new(PathBuf::new(), folder.clone(), folder.join("diff"));
                Self::Diff(Box::new(with(&base, &given)?))
            }
        })
    }

    /// Keeps the memory of a surface model within a limit, megabytes.
    pub(super) fn limited(mut self, memory_mb: u64) -> Self {
        if let Self::Dsm(config) = &mut self {
            config.memory_mb = Some(config.memory_mb.unwrap_or(memory_mb).min(memory_mb));
        }
        self
    }

    /// Returns why the task must not begin: a product that no earlier run of the batch made.
    pub(super) fn refused(&self) -> Option<String> {
        let may_replace = match self {
            Self::Dsm(config) => config.overwrite,
            Self::Ortho(config) => config.overwrite,
            Self::Eval(config) => config.overwrite,
            Self::HeightMap(config) => config.overwrite,
            Self::Priors(config) => config.overwrite,
            Self::Dtm(config) => config.overwrite,
            Self::Classes(config) => config.overwrite,
            Self::Products(config) => config.overwrite,
            Self::Diff(config) => config.overwrite,
        };
        let foreign = self.results().into_iter().find(|path| !may_replace && path.symlink_metadata().is_ok())?;
        Some(format!("a result is there that the batch did not make: {}", foreign.display()))
    }

    /// Every file or folder that the task would replace. A configuration alone is no result.
    fn results(&self) -> Vec<PathBuf> {
        match self {
            Self::Dsm(config) => {
                let names = FILES.into_iter().filter(|name| *name != USED_CONFIG).chain([PLAN, POINTING]);
                names.map(|name| config.output.join(name)).collect()
            }
            Self::Ortho(config) => vec![config.output.clone(), config.mask()],
            _ => vec![self.product()],
        }
    }

    /// Files and folders without which the task is not done.
    pub(super) fn needed(&self) -> Vec<PathBuf> {
        match self {
            Self::Dsm(config) => FILES.iter().map(|name| config.output.join(name)).collect(),
            Self::Ortho(config) => vec![config.output.clone(), config.mask()],
            Self::Eval(_) | Self::Dtm(_) | Self::Classes(_) | Self::Products(_) | Self::Diff(_) => {
                vec![self.product(), self.product().with_extension("html")]
            }
            _ => vec![self.product()],
        }
    }

    /// Files and folders that hold all that the task makes.
    pub(super) fn places(&self) -> Vec<PathBuf> {
        match self {
            Self::Dsm(config) => {
                let products = (!config.products.is_empty()).then_some("products");
                let names = FILES.into_iter().chain([PLAN, POINTING]).chain(products);
                names.map(|name| config.output.join(name)).collect()
            }
            Self::Eval(_) | Self::Dtm(_) | Self::Classes(_) | Self::Products(_) | Self::Diff(_) => {
                self.product().parent().map(Path::to_owned).into_iter().collect()
            }
            _ => self.needed(),
        }
    }

    /// The kind of the task.
    pub(super) const fn kind(&self) -> TaskKind {
        match self {
            Self::Dsm(_) => TaskKind::Dsm,
            Self::Ortho(_) => TaskKind::Ortho,
            Self::Eval(_) => TaskKind::Eval,
            Self::HeightMap(_) => TaskKind::HeightMap,
            Self::Priors(_) => TaskKind::Priors,
            Self::Dtm(_) => TaskKind::Dtm,
            Self::Classes(_) => TaskKind::Classes,
            Self::Products(_) => TaskKind::Products,
            Self::Diff(_) => TaskKind::Diff,
        }
    }

    /// The file or folder that is there when the task is done.
    pub(super) fn product(&self) -> PathBuf {
        match self {
            Self::Dsm(config) => config.output.join("report/report.json"),
            Self::Ortho(config) => config.output.clone(),
            Self::Eval(config) => {
                let run = config.test.parent().and_then(Path::parent).unwrap_or(Path::new(""));
                run.join("eval/report.json")
            }
            Self::HeightMap(config) => config.output.clone(),
            Self::Priors(config) => config.output.clone(),
            Self::Dtm(config) => config.output.join("dtm.json"),
            Self::Classes(config) => config.output.join("classes.json"),
            Self::Products(config) => config.folder().join("products.json"),
            Self::Diff(config) => config.output.join("diff.json"),
        }
    }

    /// Sets what does not change the result: threads, and whether files may be replaced.
    pub(super) fn set_running(&mut self, threads: Option<usize>, overwrite: bool) {
        let (own_threads, own_overwrite) = match self {
            Self::Dsm(config) => (&mut config.threads, &mut config.overwrite),
            Self::Ortho(config) => (&mut config.threads, &mut config.overwrite),
            Self::Eval(config) => (&mut config.threads, &mut config.overwrite),
            Self::HeightMap(config) => (&mut config.threads, &mut config.overwrite),
            Self::Priors(config) => (&mut config.threads, &mut config.overwrite),
            Self::Dtm(config) => (&mut config.threads, &mut config.overwrite),
            Self::Classes(config) => (&mut config.threads, &mut config.overwrite),
            Self::Products(config) => (&mut config.threads, &mut config.overwrite),
            Self::Diff(config) => (&mut config.threads, &mut config.overwrite),
        };
        (*own_threads, *own_overwrite) = (threads, overwrite);
    }

    /// Runs the job.
    ///
    /// # Errors
    /// The reason why there is no result.
    pub(super) fn run(&self, progress: &dyn Progress) -> Result<TaskOutcome, String> {
        let missing = match self {
            Self::Dsm(config) => {
                let report = make_or_resume(config, progress).map_err(|e| with_causes(&e))?;
                let failed = report.chunks.map_or(0, |chunks| chunks.failed.len());
                let missing = (failed > 0).then(|| format!("{failed} chunks could not be computed and are void"));
                return Ok(TaskOutcome { missing, warnings: report.warnings });
            }
            Self::Ortho(config) => {
                let folder = config.output.parent().unwrap_or(Path::new(""));
                job::guarded::check_folder(folder).map_err(|e| with_causes(&e))?;
                job::files::create_folder(folder).map_err(|e| with_causes(&e))?;
                surfaces::ortho::run(config, progress).map_err(|e| with_causes(&e))?;
                None
            }
            Self::Eval(config) => {
                let report = surfaces::eval::compare_grids(config, progress).map_err(|e| with_causes(&e))?;
                let missed = report.missed();
                (!missed.is_empty()).then(|| missed.join("; "))
            }
            Self::HeightMap(config) => {
                let report = surfaces::heightmap::run(config, progress).map_err(|e| with_causes(&e))?;
                match report {
                    surfaces::heightmap::HeightMapReport::List(list) if list.failed > 0 => {
                        Some(format!("{} height maps could not be made", list.failed))
                    }
                    _ => None,
                }
            }
            Self::Priors(config) => {
                let report = scenes::priors::run(config, progress).map_err(|e| with_causes(&e))?;
                (!report.is_whole()).then(|| "objects of the model cannot be used or are not seen".to_owned())
            }
            Self::Dtm(config) => surfaces::dtm::run(config, progress).map(|_| None).map_err(|e| with_causes(&e))?,
            Self::Classes(config) => {
                surfaces::classes::run(config, progress).map(|_| None).map_err(|e| with_causes(&e))?
            }
            Self::Products(config) => {
                dsm::products::run(config, progress).map(|_| None).map_err(|e| with_causes(&e))?
            }
            Self::Diff(config) => surfaces::diff::run(config, progress).map(|_| None).map_err(|e| with_causes(&e))?,
        };
        Ok(TaskOutcome::whole_unless(missing))
    }
}

/// Makes the configuration of height maps: a folder for a list of cameras, else one file.
fn height_map(folder: &Path, given: &Table) -> Result<HeightMapConfig, String> {
    let mut given = given.clone();
    let own: StandConfig = match given.remove("stand") {
        Some(Value::Table(own)) => {
            let source = own.get("source").ok_or("`stand.source` is missing")?.clone();
            let source = StandSource::deserialize(source).map_err(|e| in_words(e.message()))?;
            with(&StandConfig::new(source), &own)?
        }
        _ => return Err("`stand` is no table".to_owned()),
    };
    let output = match own.source {
        StandSource::List(_) => folder.join("heightmaps"),
        _ => folder.join("heightmap.tif"),
    };
    with(&HeightMapConfig::new(folder.to_owned(), output, own), &given)
}

/// Returns a configuration with the settings of a table.
fn with<T: Serialize + DeserializeOwned>(base: &T, given: &Table) -> Result<T, String> {
    let mut all = Table::try_from(base).map_err(|e| e.to_string())?;
    lay_over(&mut all, given);
    T::deserialize(all).map_err(|error| in_words(error.message()))
}

/// Replaces the values of a table by those of another, key by key.
fn lay_over(table: &mut Table, over: &Table) {
    for (key, value) in over {
        match (table.get_mut(key), value) {
            // A choice with a value, such as { epsg = 1 }, is one value and not two.
            (Some(Value::Table(inner)), Value::Table(own)) if inner.keys().any(|key| own.contains_key(key)) => {
                lay_over(inner, own);
            }
            _ => drop(table.insert(key.clone(), value.clone())),
        }
    }
}

/// Makes the paths of a table relative to the folder of the file absolute.
///
/// # Errors
/// A text that names an environment variable that is not set.
fn resolve_paths(table: &mut Table, paths: &[&str], folder: &Path) -> Result<(), String> {
    for (key, value) in table.iter_mut() {
        let named = match value {
            Value::Table(inner) => {
                resolve_paths(inner, paths, folder)?;
                continue;
            }
            _ if !paths.contains(&key.as_str()) => continue,
            Value::Array(several) => several.as_mut_slice(),
            single => std::slice::from_mut(single),
        };
        for value in named {
            if let Value::String(text) = value {
                *text = resolved(&expanded(Path::new(text.as_str()))?, folder).to_string_lossy().into_owned();
            }
        }
    }
    Ok(())
}
