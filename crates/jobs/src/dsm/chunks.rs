//! Scenes too large for the memory: the grid is cut into chunks, and each is swept with only the pixels that show it.
//!
//! Pointing, grid, height step and sources are those of the whole scene, and so are each image's noise and contrast. A chunk
//! has a rim of ground around its core, as wide as what decides a cell's content, and only the core is kept. Its windows
//! begin on whole pixels of all the levels used, and its hypotheses lie on the scene's lattice, so neighbouring chunks have the
//! same heights in their overlap but for what the aggregation's paths bring from further away.
//!
//! The heights of a chunk are found by a coarse sweep of it over all that the scene may hold (see `probe`), towers
//! included: a chunk in a plain does not pay for the mountains beside it. One that would still take more memory than the run
//! has is quartered.

use raster::Window;
use rayon::prelude::*;
use sweep::SweepView;

use crate::dsm::config::{DsmConfig, Tuning};
use crate::dsm::heights::{SweepPlan, sweep_scene};
use crate::dsm::output::Product;
use crate::dsm::prior::{CityPrior, Findings};
use crate::dsm::report::ChunksReport;
use crate::dsm::scene::{Opened, read_coarse_view, read_view};
use crate::dsm::setup::{self, OutputGrid, image_span};
use crate::dsm::surface::{Counts, SurfaceInput, make_surface, surroundings_m};
use crate::dsm::tie_windows::Character;
use crate::dsm::{memory, probe};
use crate::error::PipelineError;

/// Chunks are at most this wide and high, cells: larger ones save little.
const SIDE_MAX: usize = 8192;
/// Smaller ones are mostly rim.
const SIDE_MIN: usize = 256;
/// Pixels read around what shows a chunk with its rim: patches and the aggregation reach out, and what stands beyond the rim is
/// only looked at from the core.
const MARGIN_PX: usize = 32;
/// Windows begin and end on multiples of this, pixels: whole pixels of seven levels.
const ALIGNED: i64 = 64;
/// A part of an image less wide or high than this says nothing, pixels.
const PART_MIN: usize = 64;
/// Fewer sure pixels than this do not tell a chunk's heights.
const SURE_MIN: usize = 200;
/// Searched beyond what the coarse sweep is sure of, metres or a tenth of its span: what it does not resolve.
const MARGIN_M: f64 = 25.0;
/// Bytes per pixel while a chunk is read for the coarse sweep: samples, grey values, flags.
const BYTES_PER_COARSE_PIXEL: u64 = 14;

/// What all chunks of a scene share.
pub(crate) struct ChunkedScene<'a> {
    pub(crate) config: &'a DsmConfig,
    pub(crate) tuning: &'a Tuning,
    /// With corrected cameras.
    pub(crate) images: &'a [Opened],
    pub(crate) characters: &'a [Character],
    pub(crate) grid: &'a OutputGrid,
    pub(crate) useful: &'a [(usize, usize)],
    pub(crate) sources: &'a [Vec<usize>],
    /// Metres between hypotheses at full resolution.
    pub(crate) step_m: f64,
    /// The coarsest image's pixel, metres.
    pub(crate) gsd_m: f64,
    /// Heights of the whole scene as its ties or the user tell them.
    pub(crate) range_m: (f64, f64),
    pub(crate) prior: Option<&'a CityPrior>,
}

/// The core of a chunk.
pub(crate) struct Swept {
    pub(crate) product: Product,
    pub(crate) counts: Counts,
    pub(crate) evaluations: u64,
    /// What is said of the prior.
    pub(crate) findings: Findings,
    pub(crate) range_m: (f64, f64),
}

/// What the chunks done so far come to.
#[derive(Default)]
pub(crate) struct ChunkTotal {
    pub(crate) counts: Counts,
    pub(crate) evaluations: u64,
    /// Heights searched in any chunk.
    pub(crate) range_m: Option<(f64, f64)>,
    pub(crate) report: ChunksReport,
    pub(crate) findings: Findings,
    /// The first.
    pub(crate) error: Option<PipelineError>,
}

impl ChunkTotal {
    pub(crate) fn add(&mut self, swept: &Swept) {
        self.counts.add(swept.counts.clone());
        self.evaluations += swept.evaluations;
        let range = swept.range_m;
        self.range_m = Some(self.range_m.map_or(range, |r| (r.0.min(range.0), r.1.max(range.1))));
        self.findings.extend(&swept.findings);
        self.report.done += 1;
    }

    /// A chunk that stays void.
    pub(crate) fn leave(&mut self, core: Window) {
        self.counts.void += core.width * core.height;
    }
}

/// What became of a chunk.
pub(crate) enum Outcome {
    Swept(Box<Swept>),
    /// No two images see it.
    Unseen,
    /// It takes too much memory and can be cut further.
    TooLarge,
}

/// The largest side of a chunk that the memory allows, cells, when its heights lie in `range_m`.
///
/// # Errors
/// [`PipelineError::Memory`] when it allows none, and those of the cameras in the middle of the grid.
pub(crate) fn choose_side(
    config: &DsmConfig,
    images: &[Opened],
    grid: &OutputGrid,
    range_m: (f64, f64),
) -> Result<usize, PipelineError> {
    let needed = |side: usize| {
        let chunk = Window {
            x: (grid.size.0 / 2) as i64 - (side / 2) as i64,
            y: (grid.size.1 / 2) as i64 - (side / 2) as i64,
            width: side,
            height: side,
        };
        let grown = grid.part(chunk.grown(rim(config, grid)))?;
        let windows = images.iter().map(|o| image_span(o, &grown, range_m, MARGIN_PX).map(aligned));
        Ok::<u64, PipelineError>(needed_mb(&windows.collect::<Result<Vec<_>, _>>()?, &grown))
    };
    if let Some(side) = config.chunk {
        return memory::check(config, needed(side)?).map(|()| side);
    }
    let smallest = needed(SIDE_MIN)?;
    memory::check(config, smallest)?;
    let mut side = SIDE_MIN;
    while side < SIDE_MAX && needed(side + SIDE_MIN)? <= memory::limit_mb(config) {
        side += SIDE_MIN;
    }
    Ok(side)
}

/// Cores of about equal size, at most `side` cells wide and high, row after row.
pub(crate) fn cores(size: (usize, usize), side: usize) -> Vec<Window> {
    let cuts = |length: usize| {
        let n = length.div_ceil(side).max(1);
        (0..n).map(move |i| (length * i / n, length * (i + 1) / n))
    };
    let window = |(x0, x1): (usize, usize), (y0, y1): (usize, usize)| Window {
        x: x0 as i64,
        y: y0 as i64,
        width: x1 - x0,
        height: y1 - y0,
    };
    cuts(size.1).flat_map(|y| cuts(size.0).map(move |x| window(x, y))).collect()
}

/// The quarters of a core.
pub(crate) fn quarters(core: Window) -> Vec<Window> {
    let half = core.width.max(core.height).div_ceil(2);
    let moved = |w: Window| Window { x: w.x + core.x, y: w.y + core.y, ..w };
    cores((core.width, core.height), half).into_iter().map(moved).collect()
}

impl ChunkedScene<'_> {
    /// Sweeps a chunk and keeps its core.
    ///
    /// # Errors
    /// An image that cannot be read, a camera that fails, and [`PipelineError::Memory`] for a chunk that cannot be cut further.
    pub(crate) fn sweep(&self, core: Window) -> Result<Outcome, PipelineError> {
        let whole = Window::whole(self.grid.size.0, self.grid.size.1);
        let grown = core.grown(rim(self.config, self.grid)).intersection(&whole).unwrap_or(core);
        let grid = self.grid.part(grown)?;
        let seen = self.seen(&grid)?;
        let own = |(i, sources): (usize, &Vec<usize>)| -> Vec<usize> {
            if seen[i] { sources.iter().copied().filter(|&s| seen[s]).collect() } else { Vec::new() }
        };
        let sources: Vec<Vec<usize>> = self.sources.iter().enumerate().map(own).collect();
        if sources.iter().all(Vec::is_empty) {
            return Ok(Outcome::Unseen);
        }
        let limit_mb = memory::limit_mb(self.config);
        let is_small = core.width.max(core.height) <= SIDE_MIN;
        let wide = self.windows(&grid, self.wide_range(), &seen)?;
        let pixels: u64 = wide.iter().flatten().map(area).fold(0, u64::saturating_add);
        let too_large = |needed_mb| {
            let error = PipelineError::Memory { needed_mb, limit_mb };
            if is_small { Err(error) } else { Ok(Outcome::TooLarge) }
        };
        let coarse_mb = pixels.saturating_mul(BYTES_PER_COARSE_PIXEL) / 1_000_000;
        if coarse_mb > limit_mb {
            return too_large(coarse_mb);
        }
        let range_m = self.heights(&wide, &sources)?;
        let windows = self.windows(&grid, range_m, &seen)?;
        let needed_mb = needed_mb(&windows.iter().copied().flatten().collect::<Vec<_>>(), &grid);
        if needed_mb > limit_mb {
            return too_large(needed_mb);
        }
        let views = self.views(&windows, |image, window| read_view(image, Some(window)))?;
        let sides = setup::smallest_sides(&views);
        let mut plan = setup::plan_sweep(range_m, self.step_m, sources, &sides, self.tuning);
        plan.priors = self.prior.map(|prior| prior.seen_from(&views, self.gsd_m)).transpose()?.unwrap_or_default();
        let heights = sweep_scene(&views, &plan, &|| ())?;
        let (evaluations, findings) = (heights.evaluations, heights.findings.clone());
        let core = Window { x: core.x - grown.x, y: core.y - grown.y, ..core };
        let input = SurfaceInput {
            config: self.config,
            plan: &plan,
            useful: self.useful,
            grid: &grid,
            pixel_m: self.gsd_m,
            core,
        };
        let (product, counts) = make_surface(input, views, heights, &|| ())?;
        Ok(Outcome::Swept(Box::new(Swept { product, counts, evaluations, findings, range_m })))
    }

    /// Which images may show the grid.
    fn seen(&self, grid: &OutputGrid) -> Result<Vec<bool>, PipelineError> {
        let sees = |o: &Opened| {
            let part = setup::image_window(o, grid, self.range_m, 0)?;
            Ok(part.is_some_and(|w| w.width.min(w.height) >= PART_MIN))
        };
        self.images.iter().map(sees).collect()
    }

    /// All heights that something in the scene may have: those given, or those of the ties and of what they miss.
    fn wide_range(&self) -> (f64, f64) {
        if self.config.height_range_m.is_some() {
            return self.range_m;
        }
        let half = 0.5 * (self.range_m.1 - self.range_m.0);
        probe::widened((self.range_m.0 - half, self.range_m.1 + half))
    }

    /// The window of each image that shows the grid at the heights of a range.
    fn windows(
        &self,
        grid: &OutputGrid,
        range_m: (f64, f64),
        seen: &[bool],
    ) -> Result<Vec<Option<Window>>, PipelineError> {
        let one = |(o, seen): (&Opened, &bool)| {
            if !*seen {
                return Ok(None);
            }
            // Pixels beyond the image would be voids, which on coarse levels reach into it.
            let inside = Window::whole(o.size.0, o.size.1);
            Ok(aligned(image_span(o, grid, range_m, MARGIN_PX)?).intersection(&inside))
        };
        self.images.iter().zip(seen).map(one).collect()
    }

    /// Views of the windows, with the noise and contrast of their images; an image without a window is absent.
    fn views(
        &self,
        windows: &[Option<Window>],
        read: impl Fn(&Opened, Window) -> Result<SweepView, PipelineError> + Sync,
    ) -> Result<Vec<SweepView>, PipelineError> {
        let one = |((o, w), character): ((&Opened, &Option<Window>), &Character)| {
            let Some(window) = w else { return Ok(SweepView::absent(o.camera.clone())) };
            let mut view = read(o, *window)?;
            character.lend(&mut view);
            Ok(view)
        };
        self.images.par_iter().zip(windows).zip(self.characters).map(one).collect()
    }

    /// The heights of a chunk, by a coarse sweep over all that the scene may hold.
    fn heights(&self, windows: &[Option<Window>], sources: &[Vec<usize>]) -> Result<(f64, f64), PipelineError> {
        let wide = self.wide_range();
        let side = windows.iter().flatten().map(|w| w.width.min(w.height)).min().unwrap_or(0);
        let sides: Vec<usize> = (0..ALIGNED.ilog2()).map(|level| side >> level).collect();
        let level = probe::level_of(self.gsd_m, &sides);
        let views = self.views(windows, |image, window| read_coarse_view(image, window, level))?;
        let plan = SweepPlan {
            range_m: wide,
            step_m: self.step_m,
            top_level: level,
            bottom_level: level,
            sources: sources.to_vec(),
            reach: self.tuning.reach,
            level: self.tuning.level,
            priors: Vec::new(),
        };
        let Some(found) = probe::seen_range(&views, &plan, level, self.range_m)? else { return Ok(self.range_m) };
        let (lo, hi) = found.range_m;
        let margin = MARGIN_M.max(0.1 * (hi - lo));
        let near = ((lo - margin).max(wide.0), (hi + margin).min(wide.1));
        let is_sure = found.pixels >= SURE_MIN;
        Ok(if is_sure { near } else { (near.0.min(self.range_m.0), near.1.max(self.range_m.1)) })
    }
}

/// Cells around a core.
fn rim(config: &DsmConfig, grid: &OutputGrid) -> usize {
    (surroundings_m(config.fill) / grid.gsd_m).ceil() as usize
}

fn aligned(w: Window) -> Window {
    let (x, y) = (w.x.div_euclid(ALIGNED) * ALIGNED, w.y.div_euclid(ALIGNED) * ALIGNED);
    let length = |from: i64, start: i64, length: usize| {
        let all = (start - from) as usize + length;
        all.next_multiple_of(ALIGNED as usize)
    };
    Window { x, y, width: length(x, w.x, w.width), height: length(y, w.y, w.height) }
}

fn area(w: &Window) -> u64 {
    (w.width as u64).saturating_mul(w.height as u64)
}

fn needed_mb(windows: &[Window], grid: &OutputGrid) -> u64 {
    let pixels: Vec<u64> = windows.iter().map(area).collect();
    memory::needed_mb(&pixels, (grid.size.0 * grid.size.1) as u64)
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn cores_cover_every_cell_once() {
        for (size, side, n) in [((1000, 700), 300, 12), ((256, 256), 256, 1), ((257, 10), 256, 2)] {
            let cores = cores(size, side);
            assert_eq!(cores.len(), n);
            let cells: usize = cores.iter().map(|c| c.width * c.height).sum();
            assert_eq!(cells, size.0 * size.1);
            assert!(cores.iter().all(|c| c.width <= side && c.height <= side));
            let apart = |a: &Window, b: &Window| a.intersection(b).is_none();
            assert!((0..n).all(|i| (0..i).all(|j| apart(&cores[i], &cores[j]))));
            let parts: Vec<Window> = cores.iter().flat_map(|c| quarters(*c)).collect();
            assert_eq!(parts.iter().map(|c| c.width * c.height).sum::<usize>(), cells);
            assert!(parts.iter().all(|p| cores.iter().filter(|c| c.intersection(p) == Some(*p)).count() == 1));
        }
    }

    #[test]
    fn windows_are_widened_to_whole_pixels_of_all_levels() {
        let window = aligned(Window { x: -5, y: 70, width: 100, height: 58 });
        assert_eq!(window, Window { x: -64, y: 64, width: 192, height: 64 });
    }
}
