//! The comparison of two height grids: co-registration, errors, and the report with its page and
//! error map.

use std::path::PathBuf;

use eval::{EvalConfig, EvalInput, Evaluation, MetresFromCells, evaluate};
use formats::raster::Dem;
use numeric::Progress;
use raster::Grid;
use report::{EvaluationReport, Protocol};
use serde::Serialize;

use super::error::EvalJobError;
use super::grid_config::GridEvalConfig;
use super::grid_inputs::GridInputs;
use super::grid_output;
use super::on_reference::metres_per_unit;
use super::requirements::EvalRequirements;
use super::surface_doubts::offset_cause;
use job::error::JobError;
use job::threads;

/// Below this ratio of the NMADs at the edge and at the middle of the search, the NMAD hardly
/// depends on the shift.
const FLAT: f64 = 1.02;

/// Least absolute error that a right height may have, metres.
const RIGHT_M: f64 = 1.0;
/// The same in cells of the test.
const RIGHT_CELLS: f64 = 2.0;

/// A finished comparison of two height grids. It serializes as the JSON report.
#[derive(Debug, Clone)]
#[non_exhaustive]
pub struct GridEvalReport {
    /// What was compared, and how; with notes and missed requirements.
    pub protocol: Protocol,
    /// All errors and metrics.
    pub evaluation: Evaluation,
    /// Heights of the reference, metres.
    pub reference: Grid<f32>,
    /// The error map that was asked for.
    pub error_map: Option<PathBuf>,
    /// The page that was asked for.
    pub page: Option<PathBuf>,
    /// The page in the folder of the report, if one was written.
    pub report_page: Option<PathBuf>,
    /// Reason why no report was written in the folder of the run.
    pub report_failure: Option<String>,
}

/// Compares two height grids and writes what the configuration asks for.
///
/// # Errors
/// [`JobError`]: files that cannot be read or compared, unknown vertical datums, outputs that
/// exist.
///
/// ```
/// use surfaces::eval::{EvalTarget, GridEvalConfig, compare_grids};
/// use numeric::Silent;
///
/// let town = concat!(env!("CARGO_MANIFEST_DIR"), "/../../data-samples/town");
/// let truth = std::path::PathBuf::from(town).join("truth/dsm.tif");
/// let mut config = GridEvalConfig::new(truth.clone(), truth);
/// config.alignment = eval::AlignmentMethod::Z;
/// config.target = EvalTarget::Nowhere;
/// let report = compare_grids(&config, &Silent)?;
/// assert_eq!(report.evaluation.overall.errors.map(|errors| errors.mae), Some(0.0));
/// # Ok::<(), job::error::JobError>(())
/// ```
pub fn compare_grids(config: &GridEvalConfig, progress: &dyn Progress) -> Result<GridEvalReport, JobError> {
    config.validate()?;
    let config = &config.with_surfaces_of_runs();
    Ok(threads::install(config.threads, || compare(config, progress))??)
}

fn compare(config: &GridEvalConfig, progress: &dyn Progress) -> Result<GridEvalReport, EvalJobError> {
    let target = grid_output::Target::of(config);
    grid_output::check(config, target.as_ref())?;
    progress.begin("evaluation", 3);
    let inputs = GridInputs::read(config)?;
    progress.step();
    progress.check_cancelled()?;
    let input = EvalInput {
        classes: inputs.classes.as_ref().map(|(classes, _)| classes),
        mask: inputs.mask.as_ref(),
        terrain: inputs.terrain.as_ref(),
        confidence: inputs.layers.confidence.as_ref(),
        sigma_m: inputs.layers.sigma_m.as_ref(),
        origins: inputs.layers.origins.as_ref(),
        objects: inputs.objects.as_ref(),
        ..EvalInput::new(
            &inputs.test.heights,
            &inputs.reference.heights,
            &inputs.test_from_reference,
            inputs.metres_from_cells,
        )
    };
    let settings = config.eval_config(right_below_m(&inputs.test)?);
    let evaluation = evaluate(&input, &settings)?;
    progress.step();
    progress.check_cancelled()?;
    let protocol = protocol(config, settings, &inputs, &evaluation);
    let view = EvaluationReport { protocol: &protocol, found: &evaluation, reference: &inputs.reference.heights };
    let written = grid_output::write(config, target.as_ref(), &inputs, &view, progress)?;
    progress.step();
    Ok(GridEvalReport {
        error_map: config.error_map.clone(),
        page: config.page.clone(),
        report_page: written.page,
        report_failure: written.failure,
        protocol,
        evaluation,
        reference: inputs.reference.heights,
    })
}

impl GridEvalReport {
    /// Returns the evaluation as the `report` crate shows it.
    fn view(&self) -> EvaluationReport<'_> {
        EvaluationReport { protocol: &self.protocol, found: &self.evaluation, reference: &self.reference }
    }

    /// Returns the protocol and all metrics as a table, which ends in a line break.
    pub fn table(&self) -> String {
        self.view().table()
    }

    /// Returns the files that were written, a line for each.
    pub fn files(&self) -> String {
        let named = [("error map", &self.error_map), ("page", &self.page), ("report", &self.report_page)];
        let line = |(name, path): (&str, &Option<PathBuf>)| Some(format!("{name:<11}{}\n", path.as_ref()?.display()));
        named.into_iter().filter_map(line).collect()
    }

    /// Returns the requirements that are not met, in words.
    pub fn missed(&self) -> &[String] {
        &self.protocol.missed
    }
}

impl Serialize for GridEvalReport {
    fn serialize<S: serde::Serializer>(&self, serializer: S) -> Result<S::Ok, S::Error> {
        self.view().json().serialize(serializer)
    }
}

/// Returns the absolute error below which a height is right: what the confidence of a surface model
/// promises.
fn right_below_m(test: &Dem) -> Result<f64, EvalJobError> {
    let (along_columns, along_rows) = MetresFromCells::new(&test.geotransform, metres_per_unit(test)?).cell_size_m();
    Ok(RIGHT_M.max(RIGHT_CELLS * along_columns.max(along_rows)))
}

/// Describes the comparison: inputs, settings, notes, missed requirements.
fn protocol(config: &GridEvalConfig, settings: EvalConfig, inputs: &GridInputs, found: &Evaluation) -> Protocol {
    let reference = &inputs.reference;
    let crs = match (reference.horizontal_epsg, &reference.crs_wkt) {
        (Some(code), _) => format!("EPSG:{code}"),
        (None, Some(_)) => "a coordinate system without an EPSG code".into(),
        (None, None) => "no coordinate system".into(),
    };
    let name = |path: &PathBuf| path.display().to_string();
    Protocol {
        test: name(&config.test),
        reference: name(&config.reference),
        size: (reference.heights.width(), reference.heights.height()),
        cell_m: inputs.metres_from_cells.cell_size_m(),
        crs,
        horizontal_epsg: reference.horizontal_epsg,
        vertical: inputs.vertical.clone(),
        classes: inputs.classes.as_ref().map(|(_, source)| source.clone()),
        mask: config.mask.as_ref().map(name),
        terrain: config.terrain.as_ref().map(name),
        objects: config.objects.as_ref().map(name),
        layers: inputs.layers.names.clone(),
        notes: (inputs.notes.iter().cloned())
            .chain(offset_cause(&reference.heights, found))
            .chain(notes(found, &settings))
            .collect(),
        missed: missed(&config.requirements, found),
        config: settings,
    }
}

/// Collects what a reader must know about the result.
fn notes(found: &Evaluation, config: &EvalConfig) -> Vec<String> {
    let mut notes = Vec::new();
    if let Some(search) = found.search {
        if search.at_edge {
            notes.push(format!(
                "the best shift is at the edge of the search ({} m): the true one may be outside, search a larger radius",
                search.radius_m
            ));
        }
        if search.contrast < FLAT {
            notes.push(
                "the ground is too flat for a horizontal shift to be found: the one reported is arbitrary".into(),
            );
        }
    }
    if let Some(nk) = found.nuth_kaab.filter(|nk| !nk.converged) {
        notes.push(format!(
            "nuth-kaab did not settle (last correction {:.3} m, NMAD {:.3} m before and {:.3} m after): compare with the alignment xyz",
            nk.last_step_m, nk.nmad_before_m, nk.nmad_after_m
        ));
    }
    if !config.skip.is_empty() && found.skipped_cells == 0 {
        notes.push("no valid reference cell has a skipped class".into());
    }
    notes
}

/// Lists the requirements that are not met.
fn missed(requirements: &EvalRequirements, found: &Evaluation) -> Vec<String> {
    let mae = found.overall.errors.map_or(f64::INFINITY, |errors| errors.mae);
    let too_far = requirements.max_mae.filter(|&most| mae > most);
    let too_far = too_far.map(|most| format!("mae is {mae:.3} m, allowed are {most} m"));
    let too_few = requirements.min_completeness.iter().filter_map(|least| {
        let (threshold_m, needed) = (least.threshold_m, least.share);
        let share = found.overall.completeness(threshold_m).unwrap_or(0.0);
        (share < needed).then(|| format!("completeness_{threshold_m} is {share:.4}, required are {needed}"))
    });
    too_far.into_iter().chain(too_few).collect()
}
