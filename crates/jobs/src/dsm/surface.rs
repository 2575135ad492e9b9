//! From the views' heights to the surface on a grid: consistency, fusion, speckle, voids.
//!
//! A chunk of a large scene is made with a rim around its core, so that what stands at the core's border is judged with
//! its surroundings; only the core is counted and kept.

use raster::{Grid, Window};
use sweep::consistency::{ConsistencyConfig, Heights, count_agreeing};
use sweep::fusion::{
    FillConfig, FusionConfig, GridFrame, PlacedView, fill_voids, fuse_views, mark_cells, place_view, reliability,
    remove_speckle,
};
use sweep::{HeightMap, SweepView};

use crate::dsm::config::{DsmConfig, Fill};
use crate::dsm::heights::{SceneHeights, SweepPlan};
use crate::dsm::output::{FILLED, Product};
use crate::dsm::setup::OutputGrid;
use crate::error::PipelineError;

/// Isolated patches of less ground than a square of this side are speckle: smaller than a house, metres.
const SPECKLE_SIDE_M: f64 = 5.0;
/// … and never of fewer cells than this, whatever the grid.
const SPECKLE_CELLS_MIN: usize = 9;
/// Heights around a void are looked for within this many metres: the shadow side of a tower.
const FILL_REACH_M: f64 = 40.0;
/// … and this far where every void is to be closed: the middle of a pond or of a hall.
const FILL_REACH_ALL_M: f64 = 60.0;
/// Voids up to this many metres across are closed, whatever the images show there: the shadow side of a house.
const FILL_NARROW_M: f64 = 10.0;
/// A surface hides what is this many times its height away: views lean by up to 30°, and shadows reach further.
const FILL_HIDDEN: f64 = 1.0;
/// Heights around a void that differ by more than this per metre between them are two surfaces: steeper than streets.
const FILL_SLOPE: f64 = 0.05;
/// A facet steeper than this (rise over run) is a tear, not a surface: about 70°. Two hypotheses apart is no tear yet.
const TEAR_SLOPE: f64 = 2.75;

/// A height around which the views agree on less of the picture's contrast than this has no picture behind it: the best of
/// several unrelated pictures reaches nearly this.
const SUPPORT_MIN: f32 = 0.2;
/// A height that stands out from all others by less than this, of the worst cost, may be chance, as on water: what is known
/// around says more. Half of it and twice it are alike on simulated towns; JAX_068 gains in completeness with every set of its
/// views, and loses 0.02 m of MAE with one pair.
const CONFIDENCE_MIN: f32 = 0.1;

/// Ground around a cell that decides what it holds, metres: speckle is judged, then voids are filled from this far.
pub(crate) fn surroundings_m(fill: Fill) -> f64 {
    fill_reach_m(fill).unwrap_or(0.0) + 2.0 * SPECKLE_SIDE_M
}

/// How far heights around a void are looked for; `None` where it stays.
fn fill_reach_m(fill: Fill) -> Option<f64> {
    match fill {
        Fill::None => None,
        Fill::Justified => Some(FILL_REACH_M),
        Fill::All => Some(FILL_REACH_ALL_M),
    }
}

/// What the surface is made with.
#[derive(Clone, Copy)]
pub(crate) struct SurfaceInput<'a> {
    pub(crate) config: &'a DsmConfig,
    pub(crate) plan: &'a SweepPlan,
    /// Pairs of views that look from different directions.
    pub(crate) useful: &'a [(usize, usize)],
    pub(crate) grid: &'a OutputGrid,
    /// The coarsest image's pixel, metres.
    pub(crate) pixel_m: f64,
    /// The cells of the grid that count.
    pub(crate) core: Window,
}

/// What was counted on the way.
#[derive(Debug, Clone, Default)]
pub(crate) struct Counts {
    /// Cells with an observed height.
    pub(crate) observed: usize,
    /// Cells filled from their surroundings.
    pub(crate) filled: usize,
    /// Cells without a height.
    pub(crate) void: usize,
    /// Cells removed as speckle.
    pub(crate) speckle_removed: usize,
    /// For each view, its pixels that enough others agree with, and all; `(0, 0)` for a view without heights of its own.
    pub(crate) kept: Vec<(u64, u64)>,
}

impl Counts {
    /// Adds those of another part of the same scene.
    pub(crate) fn add(&mut self, other: Self) {
        self.observed += other.observed;
        self.filled += other.filled;
        self.void += other.void;
        self.speckle_removed += other.speckle_removed;
        self.kept.resize(self.kept.len().max(other.kept.len()), (0, 0));
        for (own, (kept, all)) in self.kept.iter_mut().zip(other.kept) {
            *own = (own.0 + kept, own.1 + all);
        }
    }
}

/// Consistency, fusion and clean-up; the core's cells and their counts. `done` is told after each view.
///
/// # Errors
/// A camera that fails inside the scene.
pub(crate) fn make_surface(
    input: SurfaceInput<'_>,
    views: Vec<SweepView>,
    heights: SceneHeights,
    done: &dyn Fn(),
) -> Result<(Product, Counts), PipelineError> {
    let SurfaceInput { config, plan, useful, grid, .. } = input;
    let all: Vec<Heights<'_>> = heights
        .maps
        .iter()
        .enumerate()
        .filter(|(i, _)| !plan.sources[*i].is_empty())
        .map(|(index, map)| Heights { index, view: &views[index], map })
        .collect();
    let map_from_ground = |g: geodesy::LonLatHeight| grid.projection.map_from_lonlat(g.lon_deg, g.lat_deg).ok();
    let frame = GridFrame { geotransform: grid.geotransform, map_from_ground: &map_from_ground };
    let level = plan.bottom_level as u32;
    let jump_m = same_surface_m(plan, grid);
    let mut placed = Vec::with_capacity(all.len());
    let mut kept = vec![(0, 0); views.len()];
    let mut blind = Grid::filled(grid.size.0, grid.size.1, false);
    for own in &all {
        let unseen = unseen(*own, plan.bottom_level, config.height_range_m);
        mark_cells(*own, level, &unseen, &frame, &mut blind)?;
        let mut keep = agreeing(*own, &all, useful, level)?;
        if let Some(asked) = config.height_range_m {
            drop_outside(&mut keep, own.map, asked);
        }
        kept[own.index] = (keep.data().iter().filter(|k| **k).count() as u64, keep.data().len() as u64);
        placed.push(place_view(*own, level, &keep, jump_m, &frame)?);
        done();
    }
    let origin_m = heights.maps[0].origin_m;
    // Images and height maps are the most of a run's memory, and what follows takes some of its own.
    drop(all);
    drop(heights);
    drop(views);
    let (product, counts) = fuse(input, placed, &blind, origin_m);
    done();
    Ok((product, Counts { kept, ..counts }))
}

fn fuse(input: SurfaceInput<'_>, placed: Vec<PlacedView>, blind: &Grid<bool>, origin_m: f64) -> (Product, Counts) {
    let SurfaceInput { config, plan, grid, core, .. } = input;
    let gsd = grid.gsd_m;
    // Heights and their places are as coarse as the level that they come from.
    let coarser = f64::from(1u32 << plan.bottom_level);
    let step_m = plan.step_at(plan.bottom_level);
    let fusion = FusionConfig {
        same_surface_m: same_surface_m(plan, grid),
        tear_m: (TEAR_SLOPE * input.pixel_m * coarser).max(2.0 * step_m) as f32,
        tile: config.tile,
    };
    let mut fused = fuse_views(&placed, grid.size, &fusion);
    drop(placed);
    let before = known(&fused.height_m, core);
    let speckle_cells = ((SPECKLE_SIDE_M / gsd).powi(2) as usize).max(SPECKLE_CELLS_MIN);
    remove_speckle(&mut fused.height_m, (2.0 * step_m).max(2.0 * gsd) as f32, speckle_cells);
    let observed = known(&fused.height_m, core);
    let agreement = fused.confidence.data_mut().iter_mut().zip(fused.height_m.data());
    agreement.filter(|(_, h)| h.is_nan()).for_each(|(agreement, _)| *agreement = 0.0);
    let filled = match fill_config(config.fill, gsd) {
        Some(fill) => fill_voids(&mut fused.height_m, blind, &fill),
        None => fused.height_m.map(|_| false),
    };
    let reach = (0.5 * SPECKLE_SIDE_M / gsd).round().max(1.0) as usize;
    fused.confidence = reliability(&fused.height_m, &fused.confidence, reach, 2.0 * gsd);
    let product = Product::new(fused, filled, origin_m).cropped(core);
    let filled = product.filled.data().iter().filter(|f| **f == FILLED).count();
    let cells = core.width * core.height;
    let counts = Counts {
        observed,
        filled,
        void: cells - observed - filled,
        speckle_removed: before - observed,
        kept: Vec::new(),
    };
    (product, counts)
}

/// How voids are filled on cells of `gsd` metres, if at all.
fn fill_config(fill: Fill, gsd: f64) -> Option<FillConfig> {
    let narrow_m = if fill == Fill::All { f64::INFINITY } else { FILL_NARROW_M };
    Some(FillConfig {
        reach_cells: (fill_reach_m(fill)? / gsd).ceil() as usize,
        narrow_cells: (narrow_m / gsd) as f32,
        island_cells: (FILL_NARROW_M / gsd).powi(2) as usize,
        hidden_cells_per_m: (FILL_HIDDEN / gsd) as f32,
        same_surface_m: (2.0 * gsd) as f32,
        slope_m: (FILL_SLOPE * gsd) as f32,
    })
}

/// Number of cells of a window that have a height.
fn known(height_m: &Grid<f32>, core: Window) -> usize {
    let columns = core.x as usize..core.x as usize + core.width;
    let row = |y: usize| height_m.row(core.y as usize + y)[columns.clone()].iter().filter(|h| !h.is_nan()).count();
    (0..core.height).map(row).sum()
}

/// Heights on the grid closer than this may belong to one surface.
fn same_surface_m(plan: &SweepPlan, grid: &OutputGrid) -> f32 {
    (2.0 * plan.step_at(plan.bottom_level)).max(1.5 * grid.gsd_m) as f32
}

/// Which pixels enough other views agree with: a third of the views that see this one's ground from another direction,
/// so that a chance agreement of two among many does not put a height on the map, and at least one. A single reference
/// view has nobody to agree with: its heights stand.
fn agreeing(
    own: Heights<'_>,
    all: &[Heights<'_>],
    useful: &[(usize, usize)],
    level: u32,
) -> Result<Grid<bool>, PipelineError> {
    let partner = |h: &Heights<'_>| useful.contains(&(own.index.min(h.index), own.index.max(h.index)));
    let others: Vec<Heights<'_>> = all.iter().copied().filter(partner).collect();
    if others.is_empty() {
        return Ok(own.map.height_m.map(|h| !h.is_nan()));
    }
    let counts = count_agreeing(own, &others, level, &ConsistencyConfig::default())?;
    let needed = ((others.len() + 1) / 3).clamp(1, usize::from(u8::MAX)) as u8;
    let mut keep = counts.map(|n| *n >= needed);
    let reliability = own.map.support.data().iter().zip(own.map.confidence.data());
    for (keep, (support, confidence)) in keep.data_mut().iter_mut().zip(reliability) {
        *keep = *keep && *support >= SUPPORT_MIN && *confidence >= CONFIDENCE_MIN;
    }
    Ok(keep)
}

/// Pixels that cannot tell what they show: blank ones, and those whose best height lies outside the range that was asked for.
fn unseen(own: Heights<'_>, level: usize, asked: Option<(f64, f64)>) -> Grid<bool> {
    let mut out = own.view.blank(level);
    if let Some(asked) = asked {
        for (unseen, h) in out.data_mut().iter_mut().zip(own.map.height_m.data()) {
            *unseen = *unseen || is_outside(own.map, *h, asked);
        }
    }
    out
}

/// Leaves out what lies outside the heights that were asked for.
fn drop_outside(keep: &mut Grid<bool>, map: &HeightMap, asked: (f64, f64)) {
    for (keep, h) in keep.data_mut().iter_mut().zip(map.height_m.data()) {
        *keep = *keep && !is_outside(map, *h, asked);
    }
}

fn is_outside(map: &HeightMap, height_m: f32, (lo, hi): (f64, f64)) -> bool {
    !(lo..=hi).contains(&(map.origin_m + f64::from(height_m)))
}
