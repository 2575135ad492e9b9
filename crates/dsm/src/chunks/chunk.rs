//! Fourth stage of a run: the surface of one chunk.

use numeric::{Muted, Progress};
use raster::Window;
use reconstruct::{
    CellCounts, HeightRange, PriorFindings, SceneSweep, SurfaceCounts, SurfaceInput, SurfaceOptions, SurfaceRasters,
    make_surface, sweep_scene,
};
use serde::{Deserialize, Serialize};
use sweep::SweepView;

use crate::error::DsmError;
use crate::images::image_pixels::read_view;
use crate::images::image_windows::GroundBox;
use crate::masks::ground_mask::mask_on;
use crate::planning::chunk_plan::{ChunkSweep, ChunkWork, read_chunk_views};
use crate::planning::chunk_side::FINEST_MARGIN_PX;
use crate::planning::plan::Plan;
use crate::session::Session;

/// Fourth stage of a run: the result of one chunk. [`ChunkResult::write`] and [`ChunkResult::read`]
/// keep it in a folder.
#[derive(Debug, Clone)]
#[non_exhaustive]
pub struct ChunkResult {
    /// Cells of the grid that the chunk contributes.
    pub core: Window,
    /// Surface on these cells, or the reason why they are void.
    pub content: ChunkContent,
}

/// What a chunk contributes to the surface.
#[derive(Debug, Clone)]
#[non_exhaustive]
pub enum ChunkContent {
    /// The chunk has a surface.
    Surface(Box<ChunkSurface>),
    /// No two images see the chunk.
    Unseen,
    /// The chunk could not be computed.
    Failed {
        /// Cause.
        reason: String,
    },
}

/// The surface of a chunk.
#[derive(Debug, Clone)]
#[non_exhaustive]
pub struct ChunkSurface {
    /// Rasters of the core.
    pub rasters: SurfaceRasters,
    /// What else is known of it.
    pub summary: ChunkSummary,
}

/// What is known of the surface of a chunk beside its rasters.
#[derive(Debug, Clone, Serialize, Deserialize)]
#[serde(deny_unknown_fields)]
#[non_exhaustive]
pub struct ChunkSummary {
    /// Counts of cells and pixels.
    pub counts: SurfaceCounts,
    /// Number of pixel-hypothesis pairs evaluated.
    pub hypotheses: u64,
    /// Heights that were searched.
    pub height_range: HeightRange,
    /// Agreement with the buildings of the city model; empty without a model.
    pub findings: PriorFindings,
}

impl ChunkSurface {
    /// Makes the surface of a chunk of which no cell gets a height.
    fn masked(core: Window, height_range: HeightRange) -> Self {
        let rasters = SurfaceRasters::masked((core.width, core.height));
        let counts = SurfaceCounts { cells: CellCounts::of(&rasters), views: Vec::new() };
        let summary = ChunkSummary { counts, hypotheses: 0, height_range, findings: PriorFindings::default() };
        Self { rasters, summary }
    }
}

/// Computes the chunk with number `index` (counted from 0) of a plan.
///
/// # Errors
/// [`DsmError::NoSuchChunk`], [`DsmError::Image`], [`DsmError::Prior`], [`DsmError::Reconstruct`],
/// [`DsmError::Crs`], [`DsmError::Cancelled`].
pub fn run_chunk(plan: &Plan, index: usize, session: &mut Session<'_>) -> Result<ChunkResult, DsmError> {
    session.progress.check_cancelled()?;
    let count = plan.chunks.len();
    let chunk = plan.chunks.get(index).ok_or(DsmError::NoSuchChunk { index, count })?;
    let content = match &chunk.work {
        ChunkWork::Sweep(work) => ChunkContent::Surface(Box::new(sweep_chunk(plan, chunk.core, work, session)?)),
        ChunkWork::Unseen => ChunkContent::Unseen,
        ChunkWork::Failed { reason } => ChunkContent::Failed { reason: reason.clone() },
    };
    Ok(ChunkResult { core: chunk.core, content })
}

/// Sets the pixels of the finest level to NaN that only the coarser levels need, whose patches and
/// paths reach farther: no height is searched for there.
fn void_surplus(plan: &Plan, work: &ChunkSweep, views: &mut [SweepView]) -> Result<(), DsmError> {
    let finest = work.levels.finest;
    let margin = FINEST_MARGIN_PX << finest;
    let ground = GroundBox::new(&plan.grid.part(work.extent), &plan.grid.projection()?, work.height_range)?;
    for ((image, window), view) in plan.images.iter().zip(&work.windows).zip(views) {
        let Some(window) = window.filter(|window| *window != image.whole()) else { continue };
        let needed = ground.span_in(image, margin)?;
        let inside = Window { x: needed.x - window.x, y: needed.y - window.y, ..needed };
        view.void_outside(finest, inside);
    }
    Ok(())
}

fn sweep_chunk(
    plan: &Plan,
    core: Window,
    work: &ChunkSweep,
    session: &mut Session<'_>,
) -> Result<ChunkSurface, DsmError> {
    let grid = plan.grid.part(work.extent);
    let core = Window { x: core.x - work.extent.x, y: core.y - work.extent.y, ..core };
    let mask = mask_on(&plan.config, &grid)?;
    if mask.as_ref().is_some_and(|mask| mask.excludes_all(core)) {
        return Ok(ChunkSurface::masked(core, work.height_range));
    }
    // A scene that is computed at once shows its own stages. A chunk of several is one step of the
    // caller's stage.
    let is_whole = plan.chunk_side.is_none();
    let watcher = session.progress;
    let muted = Muted(watcher);
    let progress: &dyn Progress = if is_whole { watcher } else { &muted };
    let views = match session.views.take().filter(|_| is_whole) {
        Some(views) => views,
        None => {
            let mut views = read_chunk_views(&plan.images, &plan.radiometry, &work.windows, read_view)?;
            void_surplus(plan, work, &mut views)?;
            views
        }
    };
    let mut sweep = SceneSweep::new(work.height_range, plan.step_m, work.levels, work.sources.clone(), &plan.tuning);
    sweep.lattices_px = plan.tuning.lattices_px();
    let mut ids: &[String] = &[];
    if let Some(path) = &plan.config.prior {
        let prior = session.prior(path)?;
        sweep.priors = prior.seen_from(&views, plan.pixel_m)?;
        ids = &prior.ids;
    }
    let heights = sweep_scene(&views, &sweep, progress)?;
    let (hypotheses, findings) = (heights.hypotheses, heights.findings.clone().named(ids));
    if is_whole {
        session.lap("sweep");
    }
    let input = SurfaceInput {
        options: SurfaceOptions {
            fill: plan.config.fill,
            height_range: plan.config.height_range_m,
            tile: plan.config.tile,
        },
        sweep: &sweep,
        useful: &plan.useful,
        grid: &grid,
        pixel_m: plan.pixel_m,
        camera_m: plan.camera_deviation_m(),
        core,
        mask: mask.as_ref(),
    };
    let (rasters, counts) = make_surface(input, views, heights, progress)?;
    if is_whole {
        session.lap("fusion");
    }
    let summary = ChunkSummary { counts, hypotheses, height_range: work.height_range, findings };
    Ok(ChunkSurface { rasters, summary })
}
