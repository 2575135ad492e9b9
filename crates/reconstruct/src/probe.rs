//! Towers and pits: heights outside those of the tie points, which seldom lie on the roof of a
//! tower.
//!
//! One level is swept over a height range that holds the tallest buildings. Where a patch of
//! neighbouring pixels has heights outside the range of the tie points, confident and shared by
//! another view, the range is extended to hold them. The sweep costs about two hypotheses per pixel
//! at full resolution.
//!
//! For a chunk of a large scene the same sweep determines the whole range, see [`seen_range`].

use camera::ImagePoint;
use numeric::Progress;
use sweep::consistency::{ConsistencyConfig, Heights, count_agreeing};
use sweep::{HeightMap, SweepView, source_from_reference};

use crate::error::ReconstructError;
use crate::planning::levels::SweepLevels;
use crate::scene_sweep::{SceneHeights, SceneSweep, sweep_scene};
use crate::values::HeightRange;

/// Searched below the heights of the tie points, metres: the deepest quarries beside ground with
/// tie points.
const BELOW_M: f64 = 150.0;
/// Searched above the heights of the tie points, metres: all but a dozen buildings of the world.
const ABOVE_M: f64 = 450.0;
/// Largest pixel of the level that is swept, metres: a slim tower is three of them wide. A little
/// more than four metres, because pixels of nominally half a metre are sometimes larger.
const PIXEL_M: f64 = 4.2;
/// The level that is swept keeps at least this many pixels on a side.
const SIDE_MIN: usize = 48;
/// Least confidence of a height that counts.
const CONFIDENCE_MIN: f32 = 0.2;
/// Least support of a height that counts. Chance reaches 0.4 over this many heights.
const SUPPORT_MIN: f32 = 0.5;
/// Least number of the eight neighbours of a pixel that must have its height.
const NEIGHBOURS_MIN: usize = 4;
/// Fewer pixels than this at one height over all views are chance.
const PIXELS_MIN: usize = 10;
/// Searched beyond the heights found, metres: masts, and the step of the coarse sweep.
const MARGIN_M: f64 = 20.0;

/// A height range found by a sweep.
#[derive(Debug, Clone, Copy, PartialEq)]
pub struct FoundRange {
    /// Heights, metres above the ellipsoid.
    pub range: HeightRange,
    /// Number of pixels with these heights.
    pub pixels: usize,
}

/// A height at a pixel of a view.
#[derive(Debug, Clone, Copy, PartialEq)]
struct ViewHeight {
    view: usize,
    height_m: f64,
}

/// Extends the range of a sweep by the heights outside it that are sure; `None` when there are
/// none.
///
/// `gsd_m` is a pixel at full resolution, and `sides` are the shortest sides of the views' levels.
/// The levels of `sweep` are not used.
///
/// # Errors
/// [`ReconstructError::Sweep`] from the consistency check, [`ReconstructError::Cancelled`].
pub fn extended_range(
    views: &[SweepView],
    sweep: &SceneSweep,
    gsd_m: f64,
    sides: &[usize],
    progress: &dyn Progress,
) -> Result<Option<FoundRange>, ReconstructError> {
    let range = sweep.range;
    let levels = SweepLevels::only(level_of(gsd_m, sides));
    let coarse = SceneSweep { range: widened(range), levels, ..sweep.clone() };
    let found = sure_heights(views, &coarse, range, |h| h < range.low_m || h > range.high_m, progress)?;
    let extended = extremes(&found).grown(MARGIN_M, MARGIN_M).union(range);
    Ok((!found.is_empty()).then_some(FoundRange { range: extended, pixels: found.len() }))
}

/// Returns a range that holds towers and pits beside what lies in `range`.
pub fn widened(range: HeightRange) -> HeightRange {
    range.grown(BELOW_M, ABOVE_M)
}

/// Returns the level that is swept. `gsd_m` is a pixel at full resolution, and `sides` are the
/// shortest sides of the levels.
pub fn level_of(gsd_m: f64, sides: &[usize]) -> usize {
    let fits = |(l, side): &(usize, &usize)| **side >= SIDE_MIN && gsd_m * f64::from(1u32 << l) <= PIXEL_M;
    sides.iter().enumerate().take_while(fits).count().saturating_sub(1)
}

/// Returns the least and greatest height that a sweep of one level finds for sure; `None` where
/// nothing is sure. Most heights are within `usual`.
///
/// # Errors
/// [`ReconstructError::Sweep`] from the consistency check, [`ReconstructError::Cancelled`].
pub fn seen_range(
    views: &[SweepView],
    sweep: &SceneSweep,
    usual: HeightRange,
    progress: &dyn Progress,
) -> Result<Option<FoundRange>, ReconstructError> {
    let found = sure_heights(views, sweep, usual, |_| true, progress)?;
    Ok((!found.is_empty()).then(|| FoundRange { range: extremes(&found), pixels: found.len() }))
}

fn extremes(heights: &[f64]) -> HeightRange {
    let nothing = HeightRange::new(f64::INFINITY, f64::NEG_INFINITY);
    heights.iter().fold(nothing, |all, h| all.union(HeightRange::at(*h)))
}

/// Sweeps one level and returns the sure heights among those for which `is_asked` holds.
///
/// A height outside `usual` does not count where another view does not show what the pixel would be
/// at a usual height. The best match is then only the best of what the view shows.
fn sure_heights(
    views: &[SweepView],
    sweep: &SceneSweep,
    usual: HeightRange,
    is_asked: impl Fn(f64) -> bool,
    progress: &dyn Progress,
) -> Result<Vec<f64>, ReconstructError> {
    let level = sweep.levels.finest;
    let maps = match sweep_scene(views, sweep, progress) {
        Ok(SceneHeights { maps, .. }) => maps,
        Err(ReconstructError::Cancelled) => return Err(ReconstructError::Cancelled),
        // A camera that fails far from the scene is no evidence about what stands there.
        Err(_) => return Ok(Vec::new()),
    };
    let step_m = sweep.step_at(level) as f32;
    let mut sure: Vec<ViewHeight> = Vec::new();
    for (index, map) in maps.iter().enumerate().filter(|(i, _)| !sweep.sources[*i].is_empty()) {
        let heights = |index: usize, map| Heights { index, view: &views[index], map };
        let others: Vec<Heights<'_>> = sweep.sources[index].iter().map(|&s| heights(s, &maps[s])).collect();
        let counts = count_agreeing(heights(index, map), &others, level as u32, &ConsistencyConfig::default())?;
        // A third view, where there is one, distinguishes a tower from a chance likeness of two.
        let needed = others.len().min(2) as u8;
        let counts_for = |h: f32, at: (usize, usize)| {
            let height_m = map.origin_m + f64::from(h);
            let is_sure = map.confidence[at] >= CONFIDENCE_MIN && map.support[at] >= SUPPORT_MIN;
            let pixel = ImagePoint::new(at.0 as f64, at.1 as f64);
            let sees = |other: &&Heights<'_>| shows(&views[index], other, level, pixel, usual);
            is_asked(height_m)
                && is_sure
                && counts.agreeing[at] >= needed
                && (usual.contains(height_m) || others.iter().filter(sees).count() >= usize::from(needed))
        };
        sure.extend(patches(map, step_m, counts_for).into_iter().map(|height_m| ViewHeight { view: index, height_m }));
    }
    Ok(shared(sure, 2.0 * f64::from(step_m)))
}

/// Returns whether another view shows what a pixel of a level sees, at both ends of a height range.
fn shows(view: &SweepView, other: &Heights<'_>, level: usize, pixel: ImagePoint, range: HeightRange) -> bool {
    let (width, height) = (other.map.height_m.width(), other.map.height_m.height());
    let is_within = |at: f64, size: usize| (0.0..=size as f64 - 1.0).contains(&at);
    let is_inside = |h: f64| {
        source_from_reference(&view.camera, &other.view.camera, level as u32, pixel, h)
            .is_ok_and(|q| is_within(q.sample, width) && is_within(q.line, height))
    };
    is_inside(range.low_m) && is_inside(range.high_m)
}

/// Returns the heights that pixels of at least two views have, to a tolerance, and enough pixels in
/// all.
fn shared(mut pixels: Vec<ViewHeight>, tolerance_m: f64) -> Vec<f64> {
    pixels.sort_by(|a, b| a.height_m.total_cmp(&b.height_m).then(a.view.cmp(&b.view)));
    let near = |h: f64| {
        let from = pixels.partition_point(|p| p.height_m < h - tolerance_m);
        let to = pixels.partition_point(|p| p.height_m <= h + tolerance_m);
        &pixels[from..to]
    };
    let is_shared = |own: &&ViewHeight| {
        let same = near(own.height_m);
        same.len() >= PIXELS_MIN && same.iter().any(|p| p.view != own.view)
    };
    pixels.iter().filter(is_shared).map(|p| p.height_m).collect()
}

/// Returns the heights of the pixels that count and have enough neighbours that count at the same
/// height, to two steps.
fn patches(map: &HeightMap, step_m: f32, counts: impl Fn(f32, (usize, usize)) -> bool) -> Vec<f64> {
    let grid = &map.height_m;
    let mut out = Vec::new();
    for y in 1..grid.height().saturating_sub(1) {
        for x in 1..grid.width().saturating_sub(1) {
            let own = grid[(x, y)];
            if own.is_nan() || !counts(own, (x, y)) {
                continue;
            }
            let around = (y - 1..=y + 1).flat_map(|v| (x - 1..=x + 1).map(move |u| (u, v)));
            let alike = around.filter(|at| (grid[*at] - own).abs() <= 2.0 * step_m && counts(grid[*at], *at)).count();
            // The pixel itself is among those counted.
            if alike > NEIGHBOURS_MIN {
                out.push(map.origin_m + f64::from(own));
            }
        }
    }
    out
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn a_patch_counts_and_a_lone_pixel_or_a_rim_does_not() {
        let mut map = HeightMap::empty(20, 20, 100.0);
        map.height_m.data_mut().fill(0.0);
        (5..8).for_each(|y| (5..8).for_each(|x| map.height_m[(x, y)] = 130.0));
        map.height_m[(15, 15)] = 90.0;
        let found = patches(&map, 1.0, |h, _| h > 50.0);
        // The corners of the 3 × 3 patch have three neighbours, the others five or eight.
        assert_eq!(found, [230.0; 5]);
    }

    #[test]
    fn a_height_needs_two_views() {
        let tower = |view| [330.0, 330.0, 331.0, 331.0, 331.5].map(|height_m| ViewHeight { view, height_m });
        let alone = [500.0; 12].map(|height_m| ViewHeight { view: 0, height_m });
        let all: Vec<_> = tower(0).into_iter().chain(tower(2)).chain(alone).collect();
        let found = shared(all, 2.0);
        assert!(found.len() == 10 && found.iter().all(|h| *h < 332.0), "{found:?}");
        assert!(shared(tower(1).to_vec(), 2.0).is_empty());
    }
}
