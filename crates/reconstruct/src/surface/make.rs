//! The surface of a scene or chunk: consistency of the views' heights, fusion on the grid,
//! clean-up.
//!
//! A chunk is computed with a rim around its core, so that what stands at the border of the core is
//! judged with its surroundings. Only the core is counted and kept.

use numeric::Progress;
use raster::{Grid, Window};
use serde::{Deserialize, Serialize};
use sweep::consistency::{ConsistencyConfig, Heights, count_agreeing};
use sweep::fusion::{
    CellSource, FILLED, FusionConfig, GridFrame, OBSERVED, PlacedView, VOID, fuse_views, mark_cells, place_view,
};
use sweep::{HeightMap, SweepView};

use crate::error::ReconstructError;
use crate::grid::DsmGrid;
use crate::scene_sweep::{LatticeHeights, SceneHeights, SceneSweep};
use crate::surface::clean_up::{Lengths, Voids, clean_up};
use crate::surface::fill::Fill;
use crate::surface::grid_sight::{ViewPixels, grid_sights};
use crate::surface::ground_mask::GroundMask;
use crate::surface::overreach::ImagedHeights;
use crate::surface::rasters::SurfaceRasters;
use crate::surface::shadow_side::ShadowCounts;
use crate::values::{HeightRange, ImagePair};

/// A facet steeper than this (rise over run) is a tear and not a surface: about 70°. Two hypotheses
/// apart is not yet a tear.
const TEAR_SLOPE: f64 = 2.75;
/// Views whose heights a view is compared with, where there are more and those that it was matched
/// with are no more. The time of the comparison would grow with the square of the number of views.
const WITNESSES_MAX: usize = 12;
/// Parts of one that a probability is rounded to, a power of two: sums are the same in any order.
const PARTS: f64 = 1024.0;
/// Reach of the patch that the cost of a pixel sees, pixels.
const PATCH_REACH: usize = 2;

/// What is asked of a surface.
#[derive(Debug, Clone, Copy)]
pub struct SurfaceOptions {
    /// Voids that are closed.
    pub fill: Fill,
    /// Heights that were asked for: others are dropped. All when `None`.
    pub height_range: Option<HeightRange>,
    /// Side of the tiles that are fused at a time, cells. It changes the memory needed, never the
    /// result.
    pub tile: usize,
}

impl SurfaceOptions {
    /// Side of the tiles where none is given, cells.
    pub const USUAL_TILE: usize = 1024;
}

/// Everything but pixels and heights that a surface is made from.
#[derive(Clone, Copy)]
pub struct SurfaceInput<'a> {
    /// What is asked of the surface.
    pub options: SurfaceOptions,
    /// The sweep that found the heights.
    pub sweep: &'a SceneSweep,
    /// Pairs of views that look from different directions.
    pub useful: &'a [ImagePair],
    /// Grid of the core with its rim.
    pub grid: &'a DsmGrid,
    /// Side of a pixel of the coarsest image on the ground, metres.
    pub pixel_m: f64,
    /// Deviation of heights that the cameras leave, metres.
    pub camera_m: f64,
    /// Cells of the grid that are kept.
    pub core: Window,
    /// Cells of the grid that get no height.
    pub mask: Option<&'a GroundMask>,
}

/// Counts of cells.
#[derive(Debug, Clone, Copy, Default, PartialEq, Serialize, Deserialize)]
pub struct CellCounts {
    /// Number of cells with an observed height.
    pub observed: usize,
    /// Number of cells filled from their surroundings.
    pub filled: usize,
    /// Number of cells without a height.
    pub void: usize,
    /// Number of those of them that lie under a mask or outside the area.
    #[serde(default)]
    pub masked: usize,
    /// Number of filled cells between roofs, in quarters of which hardly any ground is known: they
    /// have the ground there as far as it is known, or that under the lowest heights around.
    #[serde(default)]
    pub streets: usize,
    /// Number of cells removed as speckle.
    pub speckle_removed: usize,
    /// Number of heights, observed and filled, that are expected to be right within 1 m, or within
    /// two cells where those are larger: the sum of their probabilities.
    pub expected_right: f64,
}

/// Counts of cells and pixels.
#[derive(Debug, Clone, Default, PartialEq, Serialize, Deserialize)]
#[serde(deny_unknown_fields)]
pub struct SurfaceCounts {
    /// Cells of the surface.
    pub cells: CellCounts,
    /// Pixels by view; no pixels for a view without heights of its own.
    pub views: Vec<KeptPixels>,
}

/// Counts of the pixels of a view.
#[derive(Debug, Clone, Copy, Default, PartialEq, Eq, Serialize, Deserialize)]
#[serde(deny_unknown_fields)]
pub struct KeptPixels {
    /// Pixels with which enough other views agree.
    pub kept: u64,
    /// All pixels.
    pub all: u64,
    /// Dark pixels beside height jumps.
    #[serde(default)]
    pub shadows: ShadowCounts,
}

impl CellCounts {
    /// Counts the cells of rasters. What was removed from them is not known.
    pub fn of(rasters: &SurfaceRasters) -> Self {
        let count = |grid: &Grid<u8>, value: u8| grid.data().iter().filter(|v| **v == value).count();
        let right = rasters.confidence.data().iter().filter(|p| !p.is_nan());
        Self {
            observed: count(&rasters.filled, OBSERVED),
            filled: count(&rasters.filled, FILLED),
            void: count(&rasters.filled, VOID),
            masked: count(&rasters.source, CellSource::Masked.code()),
            streets: count(&rasters.source, CellSource::FilledStreet.code()),
            speckle_removed: 0,
            expected_right: right.map(|p| (f64::from(*p) * PARTS).round() / PARTS).sum(),
        }
    }

    /// Returns the share of the heights, observed and filled, that are expected to be right, 0 to
    /// 1; `None` without any height.
    pub fn expected_share(&self) -> Option<f64> {
        let heights = self.observed + self.filled;
        (heights > 0).then(|| self.expected_right / heights as f64)
    }

    fn add(&mut self, other: &Self) {
        self.observed += other.observed;
        self.filled += other.filled;
        self.void += other.void;
        self.masked += other.masked;
        self.streets += other.streets;
        self.speckle_removed = self.speckle_removed.saturating_add(other.speckle_removed);
        self.expected_right += other.expected_right;
    }
}

impl SurfaceCounts {
    /// Adds the counts of another part of the same scene.
    pub fn add(&mut self, other: &Self) {
        self.cells.add(&other.cells);
        self.views.resize(self.views.len().max(other.views.len()), KeptPixels::default());
        for (own, theirs) in self.views.iter_mut().zip(&other.views) {
            own.kept = own.kept.saturating_add(theirs.kept);
            own.all = own.all.saturating_add(theirs.all);
            own.shadows.add(&theirs.shadows);
        }
    }
}

/// Makes the surface; returns the cells of the core and their counts. It is a stage of `progress`,
/// of which each view, and the fusion, is a step.
///
/// # Errors
/// [`ReconstructError::Sweep`] for a camera that fails inside the scene, [`ReconstructError::Crs`],
/// [`ReconstructError::Cancelled`].
pub fn make_surface(
    input: SurfaceInput<'_>,
    mut views: Vec<SweepView>,
    heights: SceneHeights,
    progress: &dyn Progress,
) -> Result<(SurfaceRasters, SurfaceCounts), ReconstructError> {
    let SurfaceInput { options, sweep, useful, grid, .. } = input;
    progress.begin("fusing", 1 + sweep.sources.iter().filter(|sources| !sources.is_empty()).count());
    let finest = sweep.levels.finest;
    let projection = grid.projection()?;
    let map_from_ground = |g: geodesy::LonLatHeight| projection.map_from_lonlat(g.lon_deg, g.lat_deg).ok();
    let frame = GridFrame { geotransform: grid.geotransform, map_from_ground: &map_from_ground };
    let level = finest as u32;
    let jump_m = same_surface_m(sweep, grid);
    let (side_m, step_m) = (input.pixel_m * f64::from(1u32 << level), sweep.step_at(finest));
    views.iter_mut().for_each(|view| view.keep_level(finest));
    let SceneHeights { maps, shifted, .. } = heights;
    let origin_m = maps[0].origin_m;
    let mut lattices = vec![LatticeHeights { views, maps }];
    lattices.extend(shifted);
    let count = lattices[0].views.len();
    let mut placed = Vec::with_capacity(count * lattices.len());
    let mut pixels = Vec::with_capacity(count);
    let mut kept = vec![KeptPixels::default(); count];
    let mut blind = Grid::filled(grid.size.0, grid.size.1, false);
    for index in 0..count {
        if !sweep.sources[index].is_empty() {
            progress.check_cancelled()?;
            for (number, LatticeHeights { views, maps }) in lattices.iter().enumerate() {
                let all = with_heights(sweep, views, maps);
                let own = Heights { index, view: &views[index], map: &maps[index] };
                let blank = own.view.blank(finest);
                let mut keep = agreeing(own, &witnesses(own, &all, useful, &sweep.sources), level)?;
                drop_at_rim(&mut keep, own.map, sweep.range, step_m);
                ImagedHeights::of(own, finest, step_m).drop_overreach(&mut keep);
                if let Some(asked) = options.height_range {
                    drop_outside(&mut keep, own.map, asked);
                }
                if number == 0 {
                    mark_cells(own, level, &shows_nothing(own.map, &blank, options.height_range), &frame, &mut blind)?;
                    let data = keep.data();
                    kept[index] = KeptPixels {
                        kept: data.iter().filter(|k| **k).count() as u64,
                        all: data.len() as u64,
                        shadows: ShadowCounts::of(&own.view.levels[finest], own.map, &keep, side_m, step_m),
                    };
                }
                placed.push(place_view(own, level, &keep, &blank, jump_m, &frame)?);
            }
            progress.step();
        }
        // Images and height maps are the most of a run's memory. Of a view that is placed, the
        // others need its heights only, and the grid what its image shows.
        if is_matched(sweep, index) {
            pixels.push(ViewPixels::of(&lattices[0].views[index], finest));
        }
        for LatticeHeights { views, maps } in &mut lattices {
            views[index].keep_level(usize::MAX);
            maps[index].keep_heights();
        }
    }
    drop(lattices);
    let (rasters, cells) = fuse(input, placed, &blind, &pixels, origin_m)?;
    progress.step();
    Ok((rasters, SurfaceCounts { cells, views: kept }))
}

fn fuse(
    input: SurfaceInput<'_>,
    placed: Vec<PlacedView>,
    blind: &Grid<bool>,
    pixels: &[ViewPixels],
    origin_m: f64,
) -> Result<(SurfaceRasters, CellCounts), ReconstructError> {
    let SurfaceInput { options, sweep, grid, core, mask, .. } = input;
    // Heights and their places are as coarse as the level that they come from.
    let coarser = f64::from(1u32 << sweep.levels.finest);
    let step_m = sweep.step_at(sweep.levels.finest);
    let fusion = FusionConfig {
        same_surface_m: same_surface_m(sweep, grid),
        tear_m: (TEAR_SLOPE * input.pixel_m * coarser).max(2.0 * step_m) as f32,
        step_m,
        origin_m,
        tile: options.tile,
    };
    let mut fused = fuse_views(&placed, grid.size, &fusion);
    drop(placed);
    if let Some(mask) = mask {
        // They are not trusted, and must not fill what is beside them.
        fused.height_m.void_where(|i| mask.masked.data()[i]);
    }
    let sights = grid_sights(pixels, grid, &fused.height_m, origin_m)?;
    let lengths = Lengths { gsd_m: grid.gsd_m, step_m, camera_m: input.camera_m };
    let voids = Voids { blind, sights: &sights, fill: options.fill };
    let (mut source, speckle_removed) = clean_up(&mut fused, voids, lengths, core);
    if let Some(mask) = mask {
        for cell in (0..source.data().len()).filter(|cell| mask.excludes(*cell)) {
            fused.height_m.data_mut()[cell] = f32::NAN;
            fused.confidence.data_mut()[cell] = f32::NAN;
            source.data_mut()[cell] = CellSource::Masked;
        }
    }
    let rasters = SurfaceRasters::new(fused, &source, origin_m).cropped(core);
    let cells = CellCounts { speckle_removed, ..CellCounts::of(&rasters) };
    Ok((rasters, cells))
}

/// Marks the pixels that show no height: blank ones, and those whose best height lies outside the
/// range that was asked for.
fn shows_nothing(map: &HeightMap, blank: &Grid<bool>, asked: Option<HeightRange>) -> Grid<bool> {
    let mut out = blank.clone();
    if let Some(asked) = asked {
        out.data_mut().iter_mut().zip(map.height_m.data()).for_each(|(m, h)| *m |= is_outside(map, *h, asked));
    }
    out
}

/// Returns the views that have heights of their own.
fn with_heights<'a>(sweep: &SceneSweep, views: &'a [SweepView], maps: &'a [HeightMap]) -> Vec<Heights<'a>> {
    let all = maps.iter().zip(views).enumerate().filter(|(i, _)| !sweep.sources[*i].is_empty());
    all.map(|(index, (map, view))| Heights { index, view, map }).collect()
}

/// Returns whether a view was compared with others.
fn is_matched(sweep: &SceneSweep, view: usize) -> bool {
    !sweep.sources[view].is_empty() || sweep.sources.iter().any(|s| s.contains(&view))
}

/// Returns the distance up to which heights on the grid may belong to one surface, metres.
fn same_surface_m(sweep: &SceneSweep, grid: &DsmGrid) -> f32 {
    (2.0 * sweep.step_at(sweep.levels.finest)).max(1.5 * grid.gsd_m) as f32
}

/// Returns the views whose heights a view is compared with: those that see the ground from another
/// direction. Of many, those that it was matched with come first.
fn witnesses<'a>(
    own: Heights<'_>,
    all: &[Heights<'a>],
    useful: &[ImagePair],
    sources: &[Vec<usize>],
) -> Vec<Heights<'a>> {
    let is_partner = |h: &Heights<'_>| useful.contains(&ImagePair::new(own.index, h.index).ordered());
    let mut others: Vec<Heights<'a>> = all.iter().copied().filter(is_partner).collect();
    if others.len() > WITNESSES_MAX {
        let is_matched =
            |h: &Heights<'_>| sources[own.index].contains(&h.index) || sources[h.index].contains(&own.index);
        others.sort_by_key(|h| !is_matched(h));
        others.truncate(WITNESSES_MAX.max(others.iter().filter(|h| is_matched(h)).count()));
    }
    others
}

/// Marks the pixels with which enough other views agree: a third of the views that show the place
/// from another direction, and at least one. With a third, a chance agreement of two views among
/// many does not put a height on the map. A single reference view has no other view to agree with,
/// and keeps all its heights.
fn agreeing(own: Heights<'_>, others: &[Heights<'_>], level: u32) -> Result<Grid<bool>, ReconstructError> {
    if others.is_empty() {
        return Ok(own.map.height_m.map(|h| !h.is_nan()));
    }
    let counts = count_agreeing(own, others, level, &ConsistencyConfig::default())?;
    let mut keep = counts.agreeing.map(|_| false);
    let numbers = counts.agreeing.data().iter().zip(counts.showing.data());
    for (keep, (agreeing, showing)) in keep.data_mut().iter_mut().zip(numbers) {
        *keep = *agreeing >= (showing.saturating_add(1) / 3).max(1);
    }
    Ok(keep)
}

/// Drops the pixels whose height is the first or the last hypothesis of the searched range: a least
/// cost without costs on both sides of it is no minimum. A range of fewer than `HYPOTHESES_MIN`
/// hypotheses is all rim, and is what was asked for.
fn drop_at_rim(keep: &mut Grid<bool>, map: &HeightMap, searched: HeightRange, step_m: f64) {
    const HYPOTHESES_MIN: f64 = 8.0;
    if searched.span_m() < HYPOTHESES_MIN * step_m {
        return;
    }
    let inside = searched.grown(-step_m, -step_m);
    for (keep, height_m) in keep.data_mut().iter_mut().zip(map.height_m.data()) {
        *keep &= inside.contains(map.origin_m + f64::from(*height_m));
    }
}

/// Drops the pixels whose best height lies outside the range that was asked for, and those whose
/// patch may hold one.
fn drop_outside(keep: &mut Grid<bool>, map: &HeightMap, asked: HeightRange) {
    let (width, height) = (keep.width(), keep.height());
    for y in 0..height {
        for x in 0..width {
            let own = map.height_m[(x, y)];
            if !own.is_nan() && is_outside(map, own, asked) {
                for v in y.saturating_sub(PATCH_REACH)..(y + PATCH_REACH + 1).min(height) {
                    keep.row_mut(v)[x.saturating_sub(PATCH_REACH)..(x + PATCH_REACH + 1).min(width)].fill(false);
                }
            }
        }
    }
}

fn is_outside(map: &HeightMap, height_m: f32, asked: HeightRange) -> bool {
    !asked.contains(map.origin_m + f64::from(height_m))
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn heights_at_the_rim_of_the_range_are_dropped() {
        // Relative to an origin of 150 m, in a range of 100 to 200 m.
        let heights = vec![-50.0, -49.6, -48.9, 0.0, 49.1, 49.6, 50.2, f32::NAN];
        let mut map = HeightMap::empty(8, 1, 150.0);
        map.height_m = Grid::from_vec(8, 1, heights).unwrap();
        let kept = |range: HeightRange| {
            let mut keep = Grid::filled(8, 1, true);
            drop_at_rim(&mut keep, &map, range, 0.5);
            keep.data().to_vec()
        };
        assert_eq!(kept(HeightRange::new(100.0, 200.0)), [false, false, true, true, true, false, false, false]);
        assert_eq!(kept(HeightRange::new(149.0, 151.0)), [true; 8]);
    }
}
