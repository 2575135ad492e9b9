//! The comparison of meshes, city models and point clouds.

use std::path::PathBuf;

use cityfiles::surfaces::SurfaceFile;
use eval::{SurfaceComparison, SurfaceComparisonConfig, compare_surfaces};
use numeric::Progress;
use serde::Serialize;

use super::error::EvalJobError;
use super::report_folder::{REPORT_JSON, check_ours};
use super::requirements::EvalRequirements;
use super::surface_config::SurfaceEvalConfig;
use super::surface_inputs::SurfaceInputs;
use job::error::JobError;
use job::output_folder::OutputFolder;
use job::{files, threads};

/// Fewer points under a normal than this are worth a note: the normal of ten noisy points differs
/// by several degrees from the normal of ten others.
const POINTS_PER_NORMAL: usize = 10;

/// A finished comparison of two surfaces.
#[derive(Debug, Clone, Serialize)]
#[non_exhaustive]
pub struct SurfaceEvalReport {
    generator: String,
    kind: &'static str,
    /// What was compared, and how.
    pub protocol: SurfaceProtocol,
    /// All distances and scores.
    pub result: SurfaceComparison,
    /// The JSON report, if a folder was given.
    #[serde(skip)]
    pub written: Option<PathBuf>,
}

/// What a comparison of surfaces compared, and how.
#[derive(Debug, Clone, Serialize)]
#[non_exhaustive]
pub struct SurfaceProtocol {
    /// The evaluated surface, by name.
    pub test: String,
    /// The reference, by name.
    pub reference: String,
    /// Format and size of the test, in words.
    pub test_format: String,
    /// Format and size of the reference, in words.
    pub reference_format: String,
    /// Coordinate reference system of both.
    pub crs: Option<String>,
    /// Vertical datum of both.
    pub vertical: Option<String>,
    /// Position that local coordinates are counted from, metres.
    pub local_origin: [f64; 3],
    /// Always `none`.
    pub alignment: &'static str,
    /// Settings of the comparison.
    pub config: SurfaceComparisonConfig,
    /// Choices and doubts that a reader must know.
    pub notes: Vec<String>,
    /// Requirements that are not met.
    pub missed: Vec<String>,
}

/// Compares two surfaces and writes the report if the configuration names a folder.
///
/// # Errors
/// [`JobError`]: files that cannot be read or compared, coordinates that are not in metres, a
/// report that exists.
///
/// ```
/// use surfaces::eval::{SurfaceEvalConfig, evaluate_surfaces};
/// use numeric::Silent;
///
/// let model = concat!(env!("CARGO_MANIFEST_DIR"), "/../../data-samples/town/truth/buildings.city.json");
/// let mut config = SurfaceEvalConfig::new(model.into(), model.into());
/// config.samples_per_m2 = 0.1;
/// let report = evaluate_surfaces(&config, &Silent)?;
/// assert!(report.result.chamfer_m < 1e-6);
/// # Ok::<(), job::error::JobError>(())
/// ```
pub fn evaluate_surfaces(config: &SurfaceEvalConfig, progress: &dyn Progress) -> Result<SurfaceEvalReport, JobError> {
    config.validate()?;
    Ok(threads::install(config.threads, || evaluate(config, None, progress))??)
}

/// Compares a surface in memory with the reference of a configuration, as [`evaluate_surfaces`]
/// does with the file that the configuration calls the test.
///
/// # Errors
/// As [`evaluate_surfaces`].
pub fn evaluate_surface(
    test: SurfaceFile,
    config: &SurfaceEvalConfig,
    progress: &dyn Progress,
) -> Result<SurfaceEvalReport, JobError> {
    config.validate()?;
    Ok(threads::install(config.threads, || evaluate(config, Some(test), progress))??)
}

fn evaluate(
    config: &SurfaceEvalConfig,
    test: Option<SurfaceFile>,
    progress: &dyn Progress,
) -> Result<SurfaceEvalReport, EvalJobError> {
    if let Some(folder) = &config.output {
        check_ours(folder, &[folder.join(REPORT_JSON)], config.overwrite)?;
        OutputFolder::check(folder)?;
    }
    progress.begin("evaluation", 2);
    let settings = config.surface_config();
    let inputs = SurfaceInputs::read(config, test)?;
    progress.step();
    progress.check_cancelled()?;
    let result = compare_surfaces(&inputs.test, &inputs.reference, &settings)?;
    progress.step();
    progress.check_cancelled()?;
    let [test_format, reference_format] = inputs.formats;
    let mut notes = inputs.notes;
    let scale = settings.normal_scale_m;
    match result.m3c2 {
        Some(m3c2) if m3c2.points_per_normal < POINTS_PER_NORMAL => notes.push(format!(
            "M3C2: the normals rest on {} points each (median), so the distances along them are uncertain by several \
             percent; a larger scale of the normals, {scale} m now, or a denser reference gives more",
            m3c2.points_per_normal
        )),
        Some(_) => {}
        None => notes.push(format!(
            "M3C2: no distances, because no point has both a normal (scale {scale} m) and points of both surfaces in \
             its cylinder ({} m across, {} m long to each side); give larger sizes",
            settings.cylinder_m, settings.cylinder_reach_m
        )),
    }
    let protocol = SurfaceProtocol {
        test: config.test.display().to_string(),
        reference: config.reference.display().to_string(),
        test_format,
        reference_format,
        crs: inputs.crs,
        vertical: inputs.vertical.map(|datum| datum.to_string()),
        local_origin: inputs.origin,
        alignment: "none",
        config: settings,
        notes,
        missed: missed(&config.requirements, &result),
    };
    let generator = format!("skysweep eval {}", env!("CARGO_PKG_VERSION"));
    let mut report = SurfaceEvalReport { generator, kind: "surfaces", protocol, result, written: None };
    if let Some(folder) = &config.output {
        let _taken = OutputFolder::take(folder)?;
        let path = folder.join(REPORT_JSON);
        files::write_json(&path, &report, true)?;
        report.written = Some(path);
    }
    Ok(report)
}

/// Lists the requirements that are not met.
fn missed(requirements: &EvalRequirements, found: &SurfaceComparison) -> Vec<String> {
    let mean = found.accuracy.mean_m;
    let far = requirements.max_mae.filter(|&most| mean > most);
    let far = far.map(|most| format!("the mean distance of the test is {mean:.3} m, allowed are {most} m"));
    let few = requirements.min_completeness.iter().filter_map(|least| {
        let score = found.scores.iter().find(|score| score.threshold_m == least.threshold_m)?;
        let (recall, t, needed) = (score.recall, least.threshold_m, least.share);
        (recall < needed).then(|| format!("recall_{t} is {recall:.4}, required are {needed}"))
    });
    far.into_iter().chain(few).collect()
}
