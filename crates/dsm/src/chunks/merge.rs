//! Last stage of a run: the results of the chunks become the files of the DSM and its report.

use std::path::PathBuf;

use numeric::Progress;
use raster::Window;
use reconstruct::{
    CellCounts, HeightRange, PriorFindings, ShadowSide, SurfaceCounts, SurfaceRasters, right_within_m, shadow_side,
};

use crate::chunks::chunk::{ChunkContent, ChunkResult, ChunkSummary, ChunkSurface};
use crate::error::DsmError;
use crate::memory;
use crate::notes::Notes;
use crate::planning::plan::Plan;
use crate::prior::findings_report::report_findings;
use crate::report::{ChunksReport, DsmReport, FailedChunk, StageTime, SurfaceReport};
use crate::writing::output::{self, ChunkedOutput, DsmFolder, FILES};
use job::error_text::with_causes;

/// Below this share of observed cells a warning is given. Good scenes of towers, forest and seasons
/// have 0.5 to 0.9, and images that do not belong together seldom more than this.
const OBSERVED_WEAK: f64 = 0.25;
/// From this share of cells on a warning says that streets were filled without their ground: less
/// is hardly seen in a surface.
const STREETS_WEAK: f64 = 0.01;
/// Below this share of heights that are expected to be right a warning is given. Of the places of
/// another simulator that promised less, most have more than a third of their heights wrong, and of
/// the others hardly any. `benches/evidence/places.py` puts what is right beside what was promised.
const RIGHT_WEAK: f64 = 0.6;

/// Last stage of a run: the files that were written, and the report.
#[derive(Debug, Clone)]
#[non_exhaustive]
pub struct Product {
    /// Files of the run.
    pub files: Vec<PathBuf>,
    /// Report, as it was written.
    pub report: DsmReport,
}

/// Merges results of chunks, in any order, each of which is dropped as soon as it is written.
pub(crate) struct Merger<'a> {
    plan: &'a Plan,
    progress: &'a dyn Progress,
    notes: Notes<'a>,
    target: Target<'a>,
    counts: SurfaceCounts,
    hypotheses: u64,
    /// Heights searched in any chunk.
    height_range: Option<HeightRange>,
    findings: PriorFindings,
    chunks: ChunksReport,
    /// First error of a chunk.
    error: Option<DsmError>,
    /// Identity of the plan, where it is a file.
    pub(crate) plan_id: Option<String>,
}

/// Place of the cells until the files are made.
enum Target<'a> {
    /// A scene that was computed at once stays in memory.
    Whole(DsmFolder, Option<Box<SurfaceRasters>>),
    /// The chunks of a large scene go to the disk.
    Chunked(ChunkedOutput<'a>),
}

impl<'a> Merger<'a> {
    /// Begins the results of a plan, whose files go to `folder`.
    ///
    /// # Errors
    /// [`DsmError::Output`], [`DsmError::Image`].
    pub(crate) fn begin(plan: &'a Plan, folder: DsmFolder, progress: &'a dyn Progress) -> Result<Self, DsmError> {
        let target = match plan.chunk_side {
            None => Target::Whole(folder, None),
            Some(_) => Target::Chunked(ChunkedOutput::begin(folder, &plan.config, &plan.grid)?),
        };
        Ok(Self {
            plan,
            progress,
            notes: Notes::resume(&plan.choices, &plan.warnings, progress),
            target,
            counts: SurfaceCounts::default(),
            hypotheses: 0,
            height_range: None,
            findings: PriorFindings::default(),
            chunks: ChunksReport { side: plan.chunk_side.unwrap_or_default(), ..ChunksReport::default() },
            error: None,
            plan_id: None,
        })
    }

    /// Adds the result of a chunk.
    ///
    /// # Errors
    /// [`DsmError::Image`], [`DsmError::Crs`].
    pub(crate) fn add(&mut self, result: ChunkResult) -> Result<(), DsmError> {
        let core = result.core;
        match result.content {
            ChunkContent::Unseen => {
                self.chunks.unseen += 1;
                self.leave_void(core);
            }
            ChunkContent::Failed { reason } => self.add_failed(core, reason),
            ChunkContent::Surface(surface) => {
                let ChunkSurface { rasters, summary } = *surface;
                let ChunkSummary { counts, hypotheses, height_range: range, findings } = summary;
                self.counts.add(&counts);
                self.hypotheses = self.hypotheses.saturating_add(hypotheses);
                self.height_range = Some(self.height_range.map_or(range, |all| all.union(range)));
                self.findings.extend(&findings);
                self.chunks.done += 1;
                match &mut self.target {
                    Target::Whole(_, place) => *place = Some(Box::new(rasters)),
                    Target::Chunked(output) => output.put(core, &rasters)?,
                }
            }
        }
        Ok(())
    }

    /// Leaves a chunk void that could not be computed.
    pub(crate) fn add_error(&mut self, core: Window, error: DsmError) {
        self.add_failed(core, with_causes(&error));
        self.error.get_or_insert(error);
    }

    /// Leaves a chunk void for a reason.
    pub(crate) fn add_failed(&mut self, core: Window, reason: String) {
        let bounds = self.plan.grid.part(core).bounds();
        self.notes.warn(format!("the chunk {:.1?} is left void: {reason}", bounds.to_array()));
        self.chunks.failed.push(FailedChunk { bounds, reason });
        self.leave_void(core);
    }

    fn leave_void(&mut self, core: Window) {
        self.counts.cells.void += core.width * core.height;
    }

    /// Writes the files. `times` are the wall times of the stages.
    ///
    /// # Errors
    /// [`DsmError::NoSurface`], or the error of the first chunk that failed, when no cell has an
    /// observed height; [`DsmError::Output`], [`DsmError::Image`], [`DsmError::Crs`],
    /// [`DsmError::Cancelled`]. Nothing stays behind.
    pub(crate) fn finish(mut self, times: &[StageTime]) -> Result<Product, DsmError> {
        self.progress.check_cancelled()?;
        let plan = self.plan;
        if self.counts.cells.observed == 0 {
            return Err(self.error.unwrap_or(DsmError::NoSurface { range: plan.height_range }));
        }
        warn_of_share(plan, &self.counts.cells, &mut self.notes);
        warn_of_streets(plan, &self.counts.cells, &mut self.notes);
        warn_of_doubts(plan, &self.counts.cells, &mut self.notes);
        warn_of_shadows(plan, &self.counts, &mut self.notes);
        let prior = plan.config.prior.clone().map(|model| report_findings(&self.findings, model, &mut self.notes));
        self.progress.begin("writing", 1);
        let scene = &plan.report;
        let report = DsmReport {
            version: plan.version.clone(),
            plan: self.plan_id,
            images: scene.images.clone(),
            pairs: scene.pairs.clone(),
            pointing: scene.pointing.clone(),
            height_range_m: self.height_range.unwrap_or(plan.height_range),
            hypotheses: self.hypotheses,
            surface: surface_report(plan, &self.counts),
            chunks: plan.chunk_side.map(|_| self.chunks),
            prior,
            choices: self.notes.choices,
            warnings: self.notes.warnings,
            stages: times.to_vec(),
            peak_memory_mb: memory::peak_mb(),
        };
        match self.target {
            Target::Whole(folder, rasters) => {
                let rasters = rasters.ok_or(DsmError::ChunksMissing { found: 0, count: 1 })?;
                output::write_whole(&folder, &plan.config, &plan.grid, &rasters, &report)?;
            }
            Target::Chunked(output) => output.finish(&report)?,
        }
        self.progress.step();
        Ok(Product { files: FILES.iter().map(|f| plan.config.output.join(f)).collect(), report })
    }
}

/// Merges the results of all chunks of a plan, in any order, and writes the files of the run.
///
/// # Errors
/// [`DsmError::ChunksMissing`] when a chunk has no result or more than one, the errors of
/// `results`, [`DsmError::ChunkContent`] for a result that cannot be one of the plan,
/// [`DsmError::NoSurface`] when no cell has an observed height, [`DsmError::Exists`],
/// [`DsmError::Output`], [`DsmError::Image`], [`DsmError::Crs`], [`DsmError::Cancelled`]. Nothing
/// stays behind.
pub fn merge(
    plan: &Plan,
    results: impl IntoIterator<Item = Result<ChunkResult, DsmError>>,
    progress: &dyn Progress,
) -> Result<Product, DsmError> {
    let folder = DsmFolder::take(&plan.config)?;
    let mut merger = Merger::begin(plan, folder, progress)?;
    let count = plan.chunks.len();
    let mut missing: Vec<usize> = (0..count).collect();
    for result in results {
        progress.check_cancelled()?;
        let result = result?;
        let place = missing.iter().position(|index| plan.chunks[*index].core == result.core);
        let place = place.ok_or(DsmError::ChunksMissing { found: count - missing.len(), count })?;
        result.check(plan, missing.swap_remove(place))?;
        merger.add(result)?;
    }
    if !missing.is_empty() {
        return Err(DsmError::ChunksMissing { found: count - missing.len(), count });
    }
    merger.finish(&[])
}

/// Warns when hardly any cell has an observed height, and when fewer have one than are filled.
fn warn_of_share(plan: &Plan, counts: &CellCounts, notes: &mut Notes<'_>) {
    let (columns, rows) = plan.grid.size;
    if let Some(doubt) = doubt_of_share((columns * rows).saturating_sub(counts.masked), counts) {
        notes.warn(format!("{doubt}: {}", image_names(plan)));
    }
}

/// Returns what the share of observed heights among `cells` says against a surface.
fn doubt_of_share(cells: usize, counts: &CellCounts) -> Option<String> {
    let share = |part: usize| part as f64 / cells.max(1) as f64;
    let observed = share(counts.observed);
    if observed < OBSERVED_WEAK {
        return Some(format!(
            "only {:.1} % of the cells have an observed height: the images may not show the same ground, or its heights \
             lie outside those that were searched",
            100.0 * observed
        ));
    }
    (counts.filled > counts.observed).then(|| {
        format!(
            "{:.0} % of the cells are filled from their surroundings, and only {:.0} % are observed; between high \
             houses, in shadows and after months images agree on little, and more images, or images of one pass, show \
             more; source.tif tells which cells were filled",
            100.0 * share(counts.filled),
            100.0 * observed
        )
    })
}

/// Warns when streets were filled without their ground.
fn warn_of_streets(plan: &Plan, counts: &CellCounts, notes: &mut Notes<'_>) {
    let (columns, rows) = plan.grid.size;
    let share = counts.streets as f64 / (columns * rows).max(1) as f64;
    if share >= STREETS_WEAK {
        notes.warn(format!(
            "{:.0} % of the cells lie between roofs in quarters of which hardly any ground was seen; they were filled \
             with the ground there as far as it is known, which may be off by metres; source.tif has 5 there: {}",
            100.0 * share,
            image_names(plan)
        ));
    }
}

/// Warns when many heights are expected to be wrong.
fn warn_of_doubts(plan: &Plan, counts: &CellCounts, notes: &mut Notes<'_>) {
    if let Some(doubt) = doubt_of_heights(counts, right_within_m(plan.grid.gsd_m)) {
        notes.warn(format!("{doubt}: {}", image_names(plan)));
    }
}

/// Returns what the probabilities of the heights say against a surface.
fn doubt_of_heights(counts: &CellCounts, within_m: f64) -> Option<String> {
    let share = counts.expected_share().filter(|share| *share < RIGHT_WEAK)?;
    Some(format!(
        "only {:.0} % of the heights, filled ones included, are expected to be right within {within_m:.1} m; \
         confidence.tif tells where the others are",
        100.0 * share
    ))
}

/// Returns the files of the images in the order in which they were given.
fn image_names(plan: &Plan) -> String {
    let mut images: Vec<_> = plan.images.iter().collect();
    images.sort_by_key(|image| image.number);
    let names: Vec<String> = images.iter().map(|image| image.path.display().to_string()).collect();
    names.join(", ")
}

/// Warns when shadows lie on what stands higher.
fn warn_of_shadows(plan: &Plan, counts: &SurfaceCounts, notes: &mut Notes<'_>) {
    if shadow_side(counts.views.iter().map(|view| &view.shadows)) == Some(ShadowSide::High) {
        notes.warn(format!(
            "shadows lie on the higher side of height jumps: the relief seems to be upside down, as it is when images \
             are turned by 180° against their RPCs or two images exchanged theirs; check that the RPCs belong to the \
             pixels: {}",
            image_names(plan)
        ));
    }
}

fn surface_report(plan: &Plan, counts: &SurfaceCounts) -> SurfaceReport {
    let mut views: Vec<_> = plan.images.iter().zip(&counts.views).collect();
    views.sort_by_key(|(image, _)| image.number);
    let kept = views.into_iter().map(|(_, view)| (view.all > 0).then(|| view.kept as f64 / view.all as f64));
    let kept_by_image: Vec<Option<f64>> = kept.collect();
    SurfaceReport {
        cells: plan.grid.size.0 * plan.grid.size.1,
        counts: counts.cells,
        right_within_m: right_within_m(plan.grid.gsd_m),
        kept_by_view: kept_by_image.iter().copied().flatten().collect(),
        kept_by_image,
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn a_surface_that_is_filled_rather_than_observed_is_doubted() {
        let doubt = |observed, filled, void| {
            let counts = CellCounts { observed, filled, void, ..CellCounts::default() };
            doubt_of_share(observed + filled + void, &counts)
        };
        assert_eq!(doubt(60, 40, 0), None);
        assert_eq!(doubt(40, 30, 30), None);
        assert!(doubt(40, 46, 14).unwrap().starts_with("46 % of the cells are filled"));
        assert!(doubt(20, 70, 10).unwrap().starts_with("only 20.0 % of the cells have an observed height"));
    }

    #[test]
    fn heights_that_are_expected_to_be_wrong_are_doubted() {
        let doubt = |observed, filled, expected_right| {
            doubt_of_heights(&CellCounts { observed, filled, expected_right, ..CellCounts::default() }, 1.0)
        };
        assert_eq!(doubt(80, 10, 60.0), None);
        assert!(doubt(50, 50, 55.0).unwrap().starts_with("only 55 % of the heights"));
        assert_eq!(doubt(0, 0, 0.0), None);
    }
}
