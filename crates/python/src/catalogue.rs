//! Every job by its name in Python: from settings as JSON to a report as JSON.
//!
//! The settings of a job are the fields of its configuration, which its constructor fills with
//! defaults and serde overlays with what was given. So nothing of a configuration is written down a
//! second time. This file knows nothing of Python, so that tests without Python can use it.

use std::path::{Path, PathBuf};
use std::sync::Arc;

use camera_stand::{StandConfig, StandSource};
use jobs::align::{AlignJobConfig, AlignJobReport};
use jobs::batch::{BatchReport, read_batch};
use jobs::buildings::{BuildingMapConfig, BuildingMapReport};
use jobs::camera_stand;
use jobs::city::{CityConvertConfig, CityConvertReport, CityInfoConfig, CitySummary};
use jobs::classes::{ClassesConfig, ClassesReport};
use jobs::diff::{DiffConfig, DiffReport};
use jobs::dsm::{DsmConfig, DsmReport};
use jobs::dtm::{DtmConfig, DtmReport};
use jobs::eval::{
    EvalKind, GridEvalConfig, GridEvalReport, MapEvalConfig, MapEvalReport, SurfaceEvalConfig, SurfaceEvalReport,
    detect_kind,
};
use jobs::groundview::{ComposeConfig, ComposeReport, GroundCameras, GroundViewConfig, GroundViewReport};
use jobs::heightmap::{HeightMapConfig, HeightMapReport, UnprojectConfig, UnprojectReport};
use jobs::image_files::image_files;
use jobs::mesh::{DepthSource, MeshJobConfig, MeshJobReport};
use jobs::ortho::{OrthoConfig, OrthoReport};
use jobs::priors::{PriorsConfig, PriorsJobReport};
use jobs::production::{ChunkRunConfig, ChunkRunReport, MergeConfig, PlanFile};
use jobs::products::{ProductsConfig, ProductsReport};
use jobs::register::{RegisterConfig, RegisterModel, RegisterReport};
use jobs::rpc::{RpcConvertConfig, RpcConvertReport, RpcInfoConfig, RpcInfoReport};
use jobs::simulate::{SimulateConfig, SimulateReport};
use jobs::splats::{
    SplatConvertConfig, SplatConvertReport, SplatLabelConfig, SplatLabelReport, SplatRenderConfig, SplatRenderReport,
    SplatsConfig, SplatsReport,
};
use jobs::split::{SplitJobConfig, SplitJobReport};
use jobs::tiles::{TilesConfig, TilesReport};
use jobs::train::{TrainConfig, TrainReport};
use numeric::Progress;
use serde::de::DeserializeOwned;
use serde::{Deserialize, Serialize};
use serde_json::{Map, Value};
use simulate::SimulationConfig;

use crate::fault::Fault;

/// Settings or a report.
pub(crate) type Fields = Map<String, Value>;

/// A job that Python can call.
#[allow(dead_code, reason = "what describes the job is for the test that makes the Python functions")]
pub(crate) struct JobEntry {
    /// Name of the function.
    pub(crate) name: &'static str,
    /// What it does, in one sentence.
    pub(crate) summary: &'static str,
    /// Type of the configuration, whose fields are the keywords.
    pub(crate) config: &'static str,
    /// Type of the report, whose fields are the attributes of what the function returns.
    pub(crate) report: &'static str,
    /// Field whose own fields are keywords in its place.
    pub(crate) lifted: Option<&'static str>,
    /// Keywords that must be given, in the order of the positions.
    pub(crate) required: &'static [&'static str],
    /// The configuration with its defaults; required fields have a placeholder.
    pub(crate) base: fn() -> Fields,
    /// Runs the job.
    pub(crate) run: fn(Fields, &dyn Progress) -> Result<Value, Fault>,
}

/// Makes the entry of a job that is a function from a configuration to a report.
macro_rules! job {
    (
        $name:literal, $summary:literal, $config:ident => $report:ident, $run:path, [$($required:literal),+], $base:expr
        $(, lifted $lifted:literal)?
    ) => {
        JobEntry {
            name: $name,
            summary: $summary,
            config: stringify!($config),
            report: stringify!($report),
            lifted: [$(Some($lifted),)? None][0],
            required: &[$($required),+],
            base: || fields(&$base),
            run: |settings, progress| {
                let config: $config = configured(fields(&$base), settings, [$(Some($lifted),)? None][0])?;
                let report: $report = $run(&config, progress)?;
                Ok(value(&report))
            },
        }
    };
}

fn nowhere() -> PathBuf {
    PathBuf::new()
}

fn stand() -> StandConfig {
    StandConfig::new(StandSource::Position { lon_deg: 0.0, lat_deg: 0.0 })
}

fn town() -> SimulationConfig {
    SimulationConfig::default()
}

/// The jobs in the order of the documentation.
pub(crate) const JOBS: [JobEntry; 37] = [
    job!(
        "dsm",
        "Make a surface model from satellite images with RPCs.",
        DsmConfig => DsmReport,
        surface_model,
        ["images", "output"],
        DsmConfig::new(Vec::new(), nowhere())
    ),
    job!(
        "plan_run",
        "Plan a surface model in parts into the run folder `output`.",
        DsmConfig => PlanFile,
        located_plan,
        ["images", "output"],
        DsmConfig::new(Vec::new(), nowhere())
    ),
    job!(
        "make_plan",
        "Plan a surface model in parts and write nothing.",
        DsmConfig => PlanFile,
        unwritten_plan,
        ["images", "output"],
        DsmConfig::new(Vec::new(), nowhere())
    ),
    job!(
        "read_plan",
        "Read the plan of a run folder.",
        PlanSettings => PlanFile,
        stored_plan,
        ["folder"],
        PlanSettings { folder: nowhere() }
    ),
    job!(
        "run_chunks",
        "Compute chunks of a planned run.",
        ChunkSettings => ChunkRunReport,
        chunks,
        ["folder"],
        ChunkSettings { folder: nowhere(), chunks: None, resume: false, threads: None, plan: None }
    ),
    job!(
        "merge_run",
        "Make the surface model of the computed chunks of a planned run.",
        MergeSettings => DsmReport,
        merged,
        ["folder"],
        MergeSettings { folder: nowhere(), partial: false, overwrite: false, threads: None, plan: None }
    ),
    job!(
        "batch",
        "Do the scenes and tasks that a batch file names.",
        BatchSettings => BatchReport,
        batch,
        ["file"],
        BatchSettings { file: nowhere(), only: Vec::new(), dry_run: false }
    ),
    job!(
        "dtm",
        "Find the bare ground under a surface model, and the heights above it.",
        DtmConfig => DtmReport,
        jobs::dtm::run,
        ["surface", "output"],
        DtmConfig::new(nowhere(), nowhere())
    ),
    job!(
        "classes",
        "Find ground, buildings and vegetation of a surface model.",
        ClassesConfig => ClassesReport,
        jobs::classes::run,
        ["surface", "output"],
        ClassesConfig::new(nowhere(), nowhere())
    ),
    job!(
        "buildings",
        "Make an index of buildings from one image, in its pixels or on a surface model.",
        BuildingMapConfig => BuildingMapReport,
        jobs::buildings::run,
        ["image", "output"],
        BuildingMapConfig::new(nowhere(), nowhere())
    ),
    job!(
        "diff",
        "Find what changed between two surface models, with volumes.",
        DiffConfig => DiffReport,
        jobs::diff::run,
        ["before", "after", "output"],
        DiffConfig::new(nowhere(), nowhere(), nowhere())
    ),
    job!(
        "products",
        "Make point clouds, terrain and other products of a surface model.",
        ProductsConfig => ProductsReport,
        jobs::products::run,
        ["run"],
        ProductsConfig::new(nowhere())
    ),
    job!(
        "ortho",
        "Lay satellite images on a surface model, hidden cells marked.",
        OrthoConfig => OrthoReport,
        jobs::ortho::run,
        ["images", "surface", "output"],
        OrthoConfig::new(Vec::new(), nowhere(), nowhere())
    ),
    job!(
        "register",
        "Correct the RPC of an image by a surface model or splats.",
        RegisterConfig => RegisterReport,
        jobs::register::run,
        ["image", "model", "output"],
        RegisterConfig::new(nowhere(), RegisterModel::Splats(nowhere()), nowhere())
    ),
    job!(
        "evaluate_grids",
        "Measure the errors of a surface model against a reference.",
        GridEvalConfig => GridEvalReport,
        jobs::eval::compare_grids,
        ["test", "reference"],
        GridEvalConfig::new(nowhere(), nowhere())
    ),
    job!(
        "evaluate_surfaces",
        "Measure how far meshes, city models or clouds are from one another.",
        SurfaceEvalConfig => SurfaceEvalReport,
        jobs::eval::evaluate_surfaces,
        ["test", "reference"],
        SurfaceEvalConfig::new(nowhere(), nowhere())
    ),
    job!(
        "evaluate_maps",
        "Compare depths, normals or masks in the pixels of one camera.",
        MapEvalConfig => MapEvalReport,
        jobs::eval::compare_maps,
        ["test", "reference"],
        MapEvalConfig::new(nowhere(), nowhere())
    ),
    job!(
        "kind_of_evaluation",
        "Name the evaluation for two files: grids, surfaces or maps.",
        KindSettings => String,
        kind,
        ["test", "reference"],
        KindSettings { test: nowhere(), reference: nowhere() }
    ),
    job!(
        "heightmap",
        "Make height maps seen from above around a camera, turned to its heading.",
        HeightMapConfig => HeightMapReport,
        jobs::heightmap::run,
        ["source", "output", "stand"],
        HeightMapConfig::new(nowhere(), nowhere(), stand())
    ),
    job!(
        "unproject",
        "Turn a height map into points or splats.",
        UnprojectConfig => UnprojectReport,
        jobs::heightmap::unproject,
        ["map", "output"],
        UnprojectConfig::new(nowhere(), nowhere())
    ),
    job!(
        "tiles",
        "Make a folder for each position with its height map, satellite picture and cameras.",
        TilesConfig => TilesReport,
        jobs::tiles::run,
        ["source", "output", "stand"],
        TilesConfig::new(HeightMapConfig::new(nowhere(), nowhere(), stand())),
        lifted "maps"
    ),
    job!(
        "groundview",
        "Make depths, normals and sky of cameras and panoramas on the ground.",
        GroundViewConfig => GroundViewReport,
        jobs::groundview::run,
        ["surface", "output", "cameras"],
        GroundViewConfig::new(nowhere(), nowhere(), GroundCameras::Model(nowhere()))
    ),
    job!(
        "compose",
        "Lay a rendered ground layer over a satellite layer.",
        ComposeConfig => ComposeReport,
        jobs::groundview::compose,
        ["ground", "alpha", "satellite", "output"],
        ComposeConfig::new(nowhere(), nowhere(), nowhere(), nowhere())
    ),
    job!(
        "priors",
        "Make depth, normal and mask priors of a city model for the cameras of a scene.",
        PriorsConfig => PriorsJobReport,
        jobs::priors::run,
        ["model", "cameras", "output"],
        PriorsConfig::new(nowhere(), Vec::new(), nowhere())
    ),
    job!(
        "splats",
        "Make Gaussian splats of a surface model and its images.",
        SplatsConfig => SplatsReport,
        jobs::splats::make,
        ["dsm", "images", "output"],
        SplatsConfig::new(nowhere(), Vec::new(), nowhere())
    ),
    job!(
        "render_splats",
        "Look at splats through satellite images and perspective cameras.",
        SplatRenderConfig => SplatRenderReport,
        jobs::splats::render,
        ["splats", "output"],
        SplatRenderConfig::new(nowhere(), nowhere())
    ),
    job!(
        "convert_splats",
        "Bring splats to another format: PLY of 3DGS or 2DGS, SPZ, SOG, binary glTF.",
        SplatConvertConfig => SplatConvertReport,
        jobs::splats::convert,
        ["splats", "output"],
        SplatConvertConfig::new(nowhere(), nowhere())
    ),
    job!(
        "label_splats",
        "Carry class and object of a city model onto splats.",
        SplatLabelConfig => SplatLabelReport,
        jobs::splats::label,
        ["splats", "city", "output"],
        SplatLabelConfig::new(nowhere(), nowhere(), nowhere())
    ),
    job!(
        "train",
        "Train flat Gaussian splats on the images of a dataset, with building priors.",
        TrainConfig => TrainReport,
        jobs::train::run,
        ["dataset", "output"],
        TrainConfig::new(nowhere(), nowhere())
    ),
    job!(
        "mesh",
        "Fuse the depth maps of a dataset, or its splats, to a mesh.",
        MeshJobConfig => MeshJobReport,
        jobs::mesh::run,
        ["dataset", "depths", "output"],
        MeshJobConfig::new(nowhere(), DepthSource::Maps(nowhere()), nowhere())
    ),
    job!(
        "align",
        "Bring a COLMAP model to the world by GPS or point pairs.",
        AlignJobConfig => AlignJobReport,
        jobs::align::run,
        ["model", "positions", "output"],
        AlignJobConfig::new(nowhere(), nowhere(), nowhere())
    ),
    job!(
        "split",
        "Choose context and target views of a COLMAP model by their overlap.",
        SplitJobConfig => SplitJobReport,
        jobs::split::run,
        ["model"],
        SplitJobConfig::narrow(nowhere())
    ),
    job!("city_info", "Describe a city model and its defects.", CityInfoConfig => CitySummary, jobs::city::info, ["file"],
        CityInfoConfig::new(nowhere()), lifted "input"),
    job!("city_convert", "Write a city model as triangles, footprints or objects.", CityConvertConfig => CityConvertReport,
        jobs::city::convert, ["file", "output"], CityConvertConfig::new(nowhere(), nowhere()), lifted "input"),
    job!(
        "rpc_info",
        "Describe the RPC of a file.",
        RpcInfoConfig => RpcInfoReport,
        jobs::rpc::info,
        ["file"],
        RpcInfoConfig::new(nowhere())
    ),
    job!(
        "rpc_convert",
        "Write the RPC of a file in another format.",
        RpcConvertConfig => RpcConvertReport,
        jobs::rpc::convert,
        ["file", "output"],
        RpcConvertConfig::new(nowhere(), nowhere())
    ),
    JobEntry {
        name: "simulate",
        summary: "Make a seeded scene seen through RPC cameras, with its exact surface. `scene` is a preset, \
                  a parameter file (TOML), or parameters that differ from those of the preset `town`.",
        config: "SimulateConfig",
        report: "SimulateReport",
        lifted: None,
        required: &["scene", "output"],
        base: || fields(&SimulateConfig::new(town(), nowhere())),
        run: |mut settings, progress| {
            let mut base = SimulateConfig::new(town(), nowhere());
            if let Some(Value::String(scene)) = settings.get("scene") {
                base.scene = named_scene(scene)?;
                settings.remove("scene");
            }
            let config: SimulateConfig = configured(fields(&base), settings, None)?;
            let report: SimulateReport = jobs::simulate::run(&config, progress)?;
            Ok(value(&report))
        },
    },
];

/// Where the plan of a run is.
#[derive(Serialize, Deserialize)]
#[serde(deny_unknown_fields)]
struct PlanSettings {
    /// Folder of a planned run.
    folder: PathBuf,
}

/// Chunks to compute.
#[derive(Serialize, Deserialize)]
#[serde(deny_unknown_fields)]
struct ChunkSettings {
    /// Folder of a planned run. Several processes may work in it at once.
    folder: PathBuf,
    /// Chunks to compute: numbers from 0 (`3,7`), or a share (`2/5` is the second of five); all
    /// that nobody else computes when `None`.
    chunks: Option<String>,
    /// Whether failed chunks are tried again, and what no longer fits is planned and computed
    /// again.
    resume: bool,
    /// Worker threads; all cores when `None`.
    threads: Option<usize>,
    /// Identity of the plan; another one is refused.
    plan: Option<String>,
}

/// A run to be merged.
#[derive(Serialize, Deserialize)]
#[serde(deny_unknown_fields)]
struct MergeSettings {
    /// Folder of a planned run whose chunks are computed.
    folder: PathBuf,
    /// Whether chunks without a result are left void. Otherwise they are an error.
    partial: bool,
    /// Whether existing products may be replaced.
    overwrite: bool,
    /// Worker threads; all cores when `None`.
    threads: Option<usize>,
    /// Identity of the plan; another one is refused.
    plan: Option<String>,
}

/// A batch to be done.
#[derive(Serialize, Deserialize)]
#[serde(deny_unknown_fields)]
struct BatchSettings {
    /// Batch file (TOML).
    file: PathBuf,
    /// Scenes to work on, by name; all when empty. The others are reported as they stand.
    only: Vec<String>,
    /// Whether to say what would be done, and what would be refused, and do nothing.
    dry_run: bool,
}

/// Two files to be compared.
#[derive(Serialize, Deserialize)]
#[serde(deny_unknown_fields)]
struct KindSettings {
    /// File to evaluate.
    test: PathBuf,
    /// File that is believed.
    reference: PathBuf,
}

/// Folders and patterns among the images stand for the images in them.
fn with_images(config: &DsmConfig) -> Result<DsmConfig, Fault> {
    let mut whole = config.clone();
    whole.images = image_files(&config.images).map_err(|error| Fault::input(&error))?;
    Ok(whole)
}

fn surface_model(config: &DsmConfig, progress: &dyn Progress) -> Result<DsmReport, Fault> {
    Ok(jobs::dsm::run(&with_images(config)?, progress)?)
}

fn located_plan(config: &DsmConfig, progress: &dyn Progress) -> Result<PlanFile, Fault> {
    Ok(jobs::production::plan_run(&with_images(config)?, progress)?)
}

fn unwritten_plan(config: &DsmConfig, progress: &dyn Progress) -> Result<PlanFile, Fault> {
    Ok(jobs::production::make_plan(&with_images(config)?, progress)?)
}

fn stored_plan(settings: &PlanSettings, _: &dyn Progress) -> Result<PlanFile, Fault> {
    Ok(Arc::unwrap_or_clone(PlanFile::read(&settings.folder)?))
}

fn chunks(settings: &ChunkSettings, progress: &dyn Progress) -> Result<ChunkRunReport, Fault> {
    let mut config = ChunkRunConfig::new(settings.folder.clone());
    if let Some(text) = &settings.chunks {
        config.chunks = text.parse().map_err(|e| Fault::input(&e))?;
    }
    (config.resume, config.threads, config.plan) = (settings.resume, settings.threads, settings.plan.clone());
    Ok(jobs::production::run_chunks(&config, progress)?)
}

fn merged(settings: &MergeSettings, progress: &dyn Progress) -> Result<DsmReport, Fault> {
    let mut config = MergeConfig::new(settings.folder.clone());
    (config.partial, config.overwrite, config.threads) = (settings.partial, settings.overwrite, settings.threads);
    config.plan.clone_from(&settings.plan);
    Ok(jobs::production::merge_run(&config, progress)?.report)
}

fn batch(settings: &BatchSettings, progress: &dyn Progress) -> Result<BatchReport, Fault> {
    let mut batch = read_batch(&settings.file)?;
    batch.select(&settings.only)?;
    Ok(if settings.dry_run { jobs::batch::look(&batch)? } else { jobs::batch::run(&batch, progress)? })
}

fn kind(settings: &KindSettings, _: &dyn Progress) -> Result<String, Fault> {
    let kind = match detect_kind(&settings.test, &settings.reference) {
        EvalKind::Maps => "maps",
        EvalKind::Surfaces => "surfaces",
        _ => "grids",
    };
    Ok(kind.to_owned())
}

/// Returns a preset by its name, or the parameters of a TOML file.
fn named_scene(scene: &str) -> Result<SimulationConfig, Fault> {
    let is_file = Path::new(scene).extension().is_some_and(|extension| extension.eq_ignore_ascii_case("toml"));
    if is_file {
        return Ok(jobs::simulate::read_scene(Path::new(scene))?);
    }
    SimulationConfig::preset(scene).map_err(|error| Fault::input(&error))
}

/// Returns the job called `name`.
pub(crate) fn job(name: &str) -> Option<&'static JobEntry> {
    static ALL: [JobEntry; 37] = JOBS;
    ALL.iter().find(|entry| entry.name == name)
}

fn value(report: &impl Serialize) -> Value {
    // Reports and configurations are trees of named fields, which JSON can hold.
    serde_json::to_value(report).unwrap_or(Value::Null)
}

fn fields(config: &impl Serialize) -> Fields {
    match value(config) {
        Value::Object(fields) => fields,
        _ => Fields::new(),
    }
}

/// Overlays the defaults of a configuration with settings.
///
/// # Errors
/// [`Fault`] that names the setting which is unknown or has a value of the wrong type.
fn configured<T: DeserializeOwned>(mut base: Fields, settings: Fields, lifted: Option<&str>) -> Result<T, Fault> {
    for (name, value) in settings {
        let inner = lifted.and_then(|lifted| base.get_mut(lifted)).and_then(Value::as_object_mut);
        match inner {
            Some(inner) if inner.contains_key(&name) => overlay(inner, name, value),
            _ => overlay(&mut base, name, value),
        }
    }
    serde_path_to_error::deserialize(Value::Object(base)).map_err(|error| {
        let place = error.path().to_string();
        let text = error.inner().to_string();
        // The path of an unknown field ends at the structure around it, and is `.` at the top.
        Fault::setting(if place == "." { text } else { format!("{place}: {text}") })
    })
}

/// Sets a field. Settings of a structure in it leave the other fields of the structure alone; what
/// has another shape (the variant of an enumeration) replaces the field.
fn overlay(base: &mut Fields, name: String, value: Value) {
    match (base.get_mut(&name), value) {
        (Some(Value::Object(old)), Value::Object(new)) if new.keys().all(|key| old.contains_key(key)) => {
            for (key, value) in new {
                overlay(old, key, value);
            }
        }
        (_, value) => {
            base.insert(name, value);
        }
    }
}
