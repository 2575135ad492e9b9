//! The division of a large scene into chunks, each with the pixels that show it.
//!
//! Pointing, grid and height step are those of the whole scene, and so are each image's noise and
//! contrast. Each chunk chooses its own sources among the images that show it. The windows of a
//! chunk begin on whole pixels of all the levels used, their tiles are those of the whole images,
//! and its hypotheses lie on the scene's lattice. Neighbouring chunks therefore have the same
//! heights in their overlap, but for what the paths of the aggregation bring from further away.
//!
//! The heights of a chunk are found by a coarse sweep of it over all heights that the scene may
//! have (see `probe`), towers included: a chunk in a plain does not pay for the mountains beside
//! it. Chunks narrower than their rim share the coarse sweep of a block of them, because each of
//! their own sweeps would mostly be one of the rim. A chunk that would still take more memory than
//! the run has is divided into quarters.

use crs::MapProjection;
use geo::Polygon;
use numeric::{Muted, Progress};
use raster::Window;
use rayon::prelude::*;
use reconstruct::{
    DsmGrid, HeightRange, Parts, SceneSweep, SourceCandidates, SweepLevels, SweepTuning, ViewGeometry, choose_levels,
    probe, shared_part, smallest_sides,
};
use serde::{Deserialize, Serialize};
use sweep::SweepView;

use crate::config::DsmConfig;
use crate::error::DsmError;
use crate::images::image_pixels::read_coarse_view;
use crate::images::image_windows::GroundBox;
use crate::images::radiometry::ImageRadiometry;
use crate::images::scene_image::SceneImage;
use crate::memory;
use crate::planning::chunk_side::{ALIGNED, MARGIN_PX, SIDE_MIN, aligned, blocks, needed_mb, quarters, with_rim};
use job::error_text::with_causes;

/// A part of an image less wide or high than this holds nothing to match, pixels.
const PART_MIN: usize = 64;
/// Fewer sure pixels than this do not determine the heights of a chunk.
const SURE_MIN: usize = 200;
/// Searched beyond the sure heights of the coarse sweep, metres, or a tenth of their span: what the
/// sweep does not resolve.
const MARGIN_M: f64 = 25.0;
/// A chunk is swept through its own heights if these take so many pyramid levels less than those of
/// the scene. Where few levels are saved, the same heights for all chunks make them agree.
const LEVELS_SAVED: u32 = 2;
/// Bytes per pixel while a chunk is read for the coarse sweep: samples, grey values, flags.
const BYTES_PER_COARSE_PIXEL: u64 = 14;

/// One chunk of a plan.
#[derive(Debug, Clone, PartialEq, Serialize, Deserialize)]
#[serde(deny_unknown_fields)]
#[non_exhaustive]
pub struct ChunkPlan {
    /// Cells of the grid that the chunk contributes.
    pub core: Window,
    /// Work to do for these cells.
    pub work: ChunkWork,
}

/// The work of a chunk.
#[derive(Debug, Clone, PartialEq, Serialize, Deserialize)]
#[serde(rename_all = "lowercase")]
#[non_exhaustive]
pub enum ChunkWork {
    /// The chunk is swept.
    Sweep(ChunkSweep),
    /// No two images see the chunk. Its cells are void.
    Unseen,
    /// The chunk cannot be planned. Its cells are void.
    Failed {
        /// Cause.
        reason: String,
    },
}

/// Parameters of the sweep of a chunk.
#[derive(Debug, Clone, PartialEq, Serialize, Deserialize)]
#[serde(deny_unknown_fields)]
#[non_exhaustive]
pub struct ChunkSweep {
    /// Cells of the grid that are computed: the core with its rim.
    pub extent: Window,
    /// Pixels of each image that are read; `None` for an image that does not show the chunk.
    pub windows: Vec<Option<Window>>,
    /// For each image, the positions of the images it is compared with.
    pub sources: Vec<Vec<usize>>,
    /// Heights to search, metres above the ellipsoid.
    pub height_range: HeightRange,
    /// Pyramid levels.
    pub levels: SweepLevels,
    /// Estimate of the memory needed, megabytes.
    pub needed_mb: u64,
}

/// What all chunks of a scene share while they are planned.
pub(crate) struct ChunkPlanner<'a> {
    pub(crate) config: &'a DsmConfig,
    pub(crate) tuning: &'a SweepTuning,
    /// Images with corrected cameras.
    pub(crate) images: &'a [SceneImage],
    pub(crate) radiometry: &'a [ImageRadiometry],
    pub(crate) grid: &'a DsmGrid,
    pub(crate) projection: &'a MapProjection,
    pub(crate) candidates: SourceCandidates<'a>,
    /// Geometry of the corrected cameras.
    pub(crate) geometry: &'a ViewGeometry,
    /// Distance of two hypotheses at full resolution, metres.
    pub(crate) step_m: f64,
    /// Side of a pixel of the coarsest image on the ground, metres.
    pub(crate) pixel_m: f64,
    /// Heights of the whole scene, from its tie points or as given.
    pub(crate) range: HeightRange,
    pub(crate) progress: &'a dyn Progress,
}

/// For each image, the images that it is compared with over a chunk.
struct ChunkSources {
    /// In the sweep.
    all: Vec<Vec<usize>>,
    /// In the coarse sweep that finds the heights.
    probing: Vec<Vec<usize>>,
}

/// Returns which images have sources or are some.
fn used(sources: &[Vec<usize>]) -> Vec<bool> {
    let mut used: Vec<bool> = sources.iter().map(|own| !own.is_empty()).collect();
    sources.iter().flatten().for_each(|source| used[*source] = true);
    used
}

/// Result of planning a chunk.
enum Planned {
    Work(ChunkWork),
    /// The chunk takes too much memory and can be divided.
    TooLarge,
}

/// Result of the coarse sweep of a part of the grid.
enum Probed {
    Heights(HeightRange),
    /// The images of the part take this much memory, megabytes: more than the run has.
    TooLarge(u64),
}

impl ChunkPlanner<'_> {
    /// Plans the chunks of the given cores, in their order. Cores that take too much memory are
    /// divided into quarters. A chunk that cannot be planned stays void.
    ///
    /// # Errors
    /// The first error when no chunk can be planned, [`DsmError::Cancelled`].
    pub(crate) fn chunks(&self, cores: Vec<Window>) -> Result<Vec<ChunkPlan>, DsmError> {
        self.progress.begin("planning chunks", cores.len());
        let mut chunks = Vec::new();
        let mut first_error = None;
        let blocks = blocks(self.grid, &cores);
        let mut shared = vec![None; blocks.windows.len()];
        let mut waiting: Vec<(Window, Option<usize>)> = cores.into_iter().zip(blocks.of_core).collect();
        waiting.reverse();
        while let Some((core, block)) = waiting.pop() {
            self.progress.check_cancelled()?;
            let known = match block {
                None => None,
                Some(block) => match shared[block] {
                    Some(known) => known,
                    None => *shared[block].insert(self.block_heights(blocks.windows[block])?),
                },
            };
            let work = match self.plan(core, known) {
                Ok(Planned::TooLarge) => {
                    waiting.extend(quarters(core).into_iter().rev().map(|quarter| (quarter, None)));
                    continue;
                }
                Ok(Planned::Work(work)) => work,
                Err(DsmError::Cancelled) => return Err(DsmError::Cancelled),
                Err(error) => {
                    let reason = with_causes(&error);
                    first_error.get_or_insert(error);
                    ChunkWork::Failed { reason }
                }
            };
            chunks.push(ChunkPlan { core, work });
            self.progress.step();
        }
        let is_possible = chunks.iter().any(|chunk| matches!(chunk.work, ChunkWork::Sweep(_)));
        match first_error {
            Some(error) if !is_possible => Err(error),
            _ => Ok(chunks),
        }
    }

    /// Plans a chunk. `known` are its heights where a block that holds it has been swept.
    fn plan(&self, core: Window, known: Option<HeightRange>) -> Result<Planned, DsmError> {
        let extent = with_rim(self.grid, core);
        let grid = self.grid.part(extent);
        let ChunkSources { all: sources, probing } = self.sources(&grid)?;
        if sources.iter().all(Vec::is_empty) {
            return Ok(Planned::Work(ChunkWork::Unseen));
        }
        let limit_mb = memory::limit_mb(self.config);
        let is_small = core.width.max(core.height) <= SIDE_MIN;
        let too_large = |needed_mb| {
            let error = DsmError::Memory { needed_mb, limit_mb };
            if is_small { Err(error) } else { Ok(Planned::TooLarge) }
        };
        let height_range = match known {
            Some(known) => known,
            None => match self.probed(&grid, probing)? {
                Probed::Heights(range) => range,
                Probed::TooLarge(coarse_mb) => return too_large(coarse_mb),
            },
        };
        let windows = self.windows(&grid, height_range, &used(&sources))?;
        let needed_mb = needed_mb(self.config, &windows.iter().copied().flatten().collect::<Vec<_>>(), &grid);
        if needed_mb > limit_mb {
            return too_large(needed_mb);
        }
        let sides = smallest_sides(windows.iter().flatten());
        let levels = choose_levels(height_range, self.step_m, &sides, self.tuning);
        let sweep = ChunkSweep { extent, windows, sources, height_range, levels, needed_mb };
        Ok(Planned::Work(ChunkWork::Sweep(sweep)))
    }

    /// Returns the heights of a block of chunks; `None` where they cannot be found for all of it,
    /// and each chunk has to find its own.
    fn block_heights(&self, block: Window) -> Result<Option<HeightRange>, DsmError> {
        let grid = self.grid.part(with_rim(self.grid, block));
        let probed = self.sources(&grid).and_then(|sources| self.probed(&grid, sources.probing));
        match probed {
            Ok(Probed::Heights(range)) => Ok(Some(range)),
            Err(DsmError::Cancelled) => Err(DsmError::Cancelled),
            Ok(Probed::TooLarge(_)) | Err(_) => Ok(None),
        }
    }

    /// Finds the heights of a part of the grid by a coarse sweep of the images that show it.
    fn probed(&self, grid: &DsmGrid, probing: Vec<Vec<usize>>) -> Result<Probed, DsmError> {
        let wide = self.windows(grid, self.wide_range(), &used(&probing))?;
        let pixels: u64 = wide.iter().flatten().map(memory::area).fold(0, u64::saturating_add);
        let coarse_mb = pixels.saturating_mul(BYTES_PER_COARSE_PIXEL) / 1_000_000;
        if coarse_mb > memory::limit_mb(self.config) {
            return Ok(Probed::TooLarge(coarse_mb));
        }
        Ok(Probed::Heights(self.heights(&wide, probing)?))
    }

    /// Returns which images may show the grid.
    fn seen(&self, grid: &DsmGrid) -> Result<Vec<bool>, DsmError> {
        let ground = GroundBox::new(grid, self.projection, self.range)?;
        let sees = |image: &SceneImage| {
            let part = ground.window_in(image, 0)?;
            Ok(part.is_some_and(|w| w.width.min(w.height) >= PART_MIN))
        };
        self.images.iter().map(sees).collect()
    }

    /// Chooses the images that are used over the grid, and the sources of each.
    fn sources(&self, grid: &DsmGrid) -> Result<ChunkSources, DsmError> {
        let seen = self.seen(grid)?;
        let ground = GroundBox::new(grid, self.projection, self.range)?.outline(&self.geometry.frame);
        let part = |(seen, outline): (&bool, &Polygon<f64>)| {
            if *seen { shared_part(outline, &ground) } else { None }
        };
        let parts: Parts = seen.iter().zip(&self.geometry.outlines).map(part).collect();
        let parts = self.candidates.best_views(&ground, parts);
        let all = self.candidates.choose(&parts);
        let probing = self.candidates.choose(&self.candidates.probing_views(&ground, parts));
        // The best views may be those that were matched with none of each other.
        let probing = if probing.iter().all(Vec::is_empty) { all.clone() } else { probing };
        Ok(ChunkSources { all, probing })
    }

    /// Returns all heights that something in the scene may have: those given, or those of the tie
    /// points with towers and pits.
    fn wide_range(&self) -> HeightRange {
        if self.config.height_range_m.is_some() {
            return self.range;
        }
        let half = 0.5 * self.range.span_m();
        probe::widened(self.range.grown(half, half))
    }

    /// Returns the window of each image that shows the grid at the heights of a range.
    fn windows(&self, grid: &DsmGrid, range: HeightRange, seen: &[bool]) -> Result<Vec<Option<Window>>, DsmError> {
        let ground = GroundBox::new(grid, self.projection, range)?;
        let one = |(image, seen): (&SceneImage, &bool)| {
            if !*seen {
                return Ok(None);
            }
            // Pixels beyond the image would be voids, which on coarse levels reach into it.
            Ok(aligned(ground.span_in(image, MARGIN_PX)?).intersection(&image.whole()))
        };
        self.images.iter().zip(seen).map(one).collect()
    }

    /// Returns the heights of windows, from a coarse sweep over all heights that the scene may
    /// have: those of the scene if all that was found lies among them, and otherwise those found.
    /// Where the scene's are so many that they take [`LEVELS_SAVED`] pyramid levels more, those
    /// found are used as well, because small things are lost on coarse levels.
    fn heights(&self, windows: &[Option<Window>], sources: Vec<Vec<usize>>) -> Result<HeightRange, DsmError> {
        let wide = self.wide_range();
        // What a sweep finds is at least a margin high after it was cut, so it saves no levels of
        // so few given heights, and the sweep, which takes nearly all time, changes nothing.
        if self.config.height_range_m.is_some() && f64::from(1u32 << LEVELS_SAVED) * MARGIN_M > self.range.span_m() {
            return Ok(self.range);
        }
        let side = windows.iter().flatten().map(|w| w.width.min(w.height)).min().unwrap_or(0);
        let sides: Vec<usize> = (0..ALIGNED.ilog2()).map(|level| side >> level).collect();
        let level = probe::level_of(self.pixel_m, &sides);
        let views = read_chunk_views(self.images, self.radiometry, windows, |image, window| {
            read_coarse_view(image, window, level)
        })?;
        let sweep = SceneSweep::new(wide, self.step_m, SweepLevels::only(level), sources, self.tuning);
        let found = probe::seen_range(&views, &sweep, self.range, &Muted(self.progress))?;
        let Some(found) = found else { return Ok(self.range) };
        let margin = MARGIN_M.max(0.1 * found.range.span_m());
        let near = found.range.grown(margin, margin).cut_to(wide);
        if found.pixels < SURE_MIN {
            return Ok(near.union(self.range));
        }
        let is_usual = near.span_m() * f64::from(1u32 << LEVELS_SAVED) > self.range.span_m();
        let is_inside = self.range.contains(found.range.low_m) && self.range.contains(found.range.high_m);
        Ok(match (is_usual, is_inside) {
            (false, _) => near,
            (true, true) => self.range,
            (true, false) => near.union(self.range),
        })
    }
}

/// Reads views of windows by `read`, with the noise and contrast of their images. An image without
/// a window gives an absent view.
///
/// # Errors
/// Those of `read`.
pub(crate) fn read_chunk_views(
    images: &[SceneImage],
    radiometry: &[ImageRadiometry],
    windows: &[Option<Window>],
    read: impl Fn(&SceneImage, Window) -> Result<SweepView, DsmError> + Sync,
) -> Result<Vec<SweepView>, DsmError> {
    let one = |((image, window), radiometry): ((&SceneImage, &Option<Window>), &ImageRadiometry)| {
        let Some(window) = window else { return Ok(SweepView::absent(image.camera.clone())) };
        let mut view = read(image, *window)?;
        radiometry.give_to(&mut view);
        Ok(view)
    };
    images.par_iter().zip(windows).zip(radiometry).map(one).collect()
}
