//! What stands outside the heights that the tie points show: towers, whose roofs seldom hold a tie point, and pits.
//!
//! One coarse sweep over a range that holds the tallest buildings. Where a patch of neighbouring pixels has heights outside
//! the range that the ties gave, confident ones on which another view agrees, the range is extended to hold them. The
//! sweep costs about two hypotheses per full-resolution pixel.
//!
//! For a chunk of a large scene the same sweep tells its whole range: see [`seen_range`].

use camera::ImagePoint;
use sweep::consistency::{ConsistencyConfig, Heights, count_agreeing};
use sweep::{HeightMap, SweepError, SweepView, source_from_reference};

use crate::dsm::heights::{SceneHeights, SweepPlan, sweep_scene};

/// Searched below the ties' heights, metres: the deepest quarries beside ground that has ties.
const BELOW_M: f64 = 150.0;
/// … and above them: all but a dozen buildings of the world.
const ABOVE_M: f64 = 450.0;
/// Pixels of up to this size are swept, metres: a slim tower is three of them wide. Images whose pixels are half a metre in name
/// have some that are a little more.
const PIXEL_M: f64 = 4.2;
/// The level swept keeps at least this many pixels on a side.
const SIDE_MIN: usize = 48;
/// Least confidence of a height that counts.
const CONFIDENCE_MIN: f32 = 0.2;
/// Least support around it: chance reaches 0.4 over so many heights.
const SUPPORT_MIN: f32 = 0.5;
/// A pixel counts where at least this many of its eight neighbours have its height.
const NEIGHBOURS_MIN: usize = 4;
/// Fewer pixels than this at one height over all views are chance.
const PIXELS_MIN: usize = 10;
/// What is found is searched this far beyond, metres: masts and the coarse sweep's own step.
const MARGIN_M: f64 = 20.0;

/// A range that was found.
#[derive(Debug, Clone, Copy, PartialEq)]
pub(crate) struct Extended {
    pub(crate) range_m: (f64, f64),
    /// How many pixels show it.
    pub(crate) pixels: usize,
}

/// The plan's range extended by what a coarse sweep finds outside it; `None` when nothing stands there. `gsd_m` is the pixel
/// of the full resolution, `sides` are the shortest sides of the views' levels.
///
/// # Errors
/// Those of the consistency check.
pub(crate) fn extended_range(
    views: &[SweepView],
    plan: &SweepPlan,
    gsd_m: f64,
    sides: &[usize],
) -> Result<Option<Extended>, SweepError> {
    let level = level_of(gsd_m, sides);
    let range = plan.range_m;
    let wide = widened(range);
    let coarse = SweepPlan { range_m: wide, ..plan.clone() };
    let found = sure_heights(views, &coarse, level, range, |h| h < range.0 || h > range.1)?;
    let (lo, hi) = extremes(&found);
    let range_m = ((lo - MARGIN_M).min(range.0), (hi + MARGIN_M).max(range.1));
    Ok((!found.is_empty()).then_some(Extended { range_m, pixels: found.len() }))
}

/// A range that holds towers and pits beside what lies in `range`.
pub(crate) fn widened(range: (f64, f64)) -> (f64, f64) {
    (range.0 - BELOW_M, range.1 + ABOVE_M)
}

/// The level that is swept, of levels whose shortest sides are `sides`.
pub(crate) fn level_of(gsd_m: f64, sides: &[usize]) -> usize {
    let fits = |(l, side): &(usize, &usize)| **side >= SIDE_MIN && gsd_m * f64::from(1u32 << l) <= PIXEL_M;
    sides.iter().enumerate().take_while(fits).count().saturating_sub(1)
}

/// Least and greatest height that a sweep of one level over the plan's range shows for sure, and how many pixels do;
/// `None` where nothing is sure. Most heights are within `usual_m`.
///
/// # Errors
/// Those of the consistency check.
pub(crate) fn seen_range(
    views: &[SweepView],
    plan: &SweepPlan,
    level: usize,
    usual_m: (f64, f64),
) -> Result<Option<Extended>, SweepError> {
    let found = sure_heights(views, plan, level, usual_m, |_| true)?;
    Ok((!found.is_empty()).then(|| Extended { range_m: extremes(&found), pixels: found.len() }))
}

fn extremes(heights: &[f64]) -> (f64, f64) {
    heights.iter().fold((f64::INFINITY, f64::NEG_INFINITY), |a, h| (a.0.min(*h), a.1.max(*h)))
}

/// The heights of pixels that nothing speaks against, among those that are asked for. An unusual height says nothing where the
/// other view does not show what the pixel would be at a usual one: a likeness is then the best that there is.
fn sure_heights(
    views: &[SweepView],
    plan: &SweepPlan,
    level: usize,
    usual_m: (f64, f64),
    is_asked: impl Fn(f64) -> bool,
) -> Result<Vec<f64>, SweepError> {
    let coarse = SweepPlan { top_level: level, bottom_level: level, ..plan.clone() };
    // A camera that fails far from the scene says nothing about what stands there.
    let Ok(SceneHeights { maps, .. }) = sweep_scene(views, &coarse, &|| ()) else { return Ok(Vec::new()) };
    let step_m = plan.step_at(level) as f32;
    let mut asked: Vec<(usize, f64)> = Vec::new();
    for (index, map) in maps.iter().enumerate().filter(|(i, _)| !plan.sources[*i].is_empty()) {
        let heights = |index: usize, map| Heights { index, view: &views[index], map };
        let others: Vec<Heights<'_>> = plan.sources[index].iter().map(|&s| heights(s, &maps[s])).collect();
        let counts = count_agreeing(heights(index, map), &others, level as u32, &ConsistencyConfig::default())?;
        // A third view, where there is one, tells a tower from a likeness between two.
        let needed = others.len().min(2) as u8;
        let counts_for = |h: f32, at: (usize, usize)| {
            let height_m = map.origin_m + f64::from(h);
            let is_sure = map.confidence[at] >= CONFIDENCE_MIN && map.support[at] >= SUPPORT_MIN;
            let is_usual = || (usual_m.0..=usual_m.1).contains(&height_m);
            let sees = |other: &&Heights<'_>| shows(&views[index], other, level, at, usual_m);
            is_asked(height_m)
                && is_sure
                && counts[at] >= needed
                && (is_usual() || others.iter().filter(sees).count() >= usize::from(needed))
        };
        asked.extend(patches(map, step_m, counts_for).into_iter().map(|h| (index, h)));
    }
    Ok(shared(asked, 2.0 * f64::from(step_m)))
}

/// Whether another view shows what a pixel of a level sees, if that is at any height of a range.
fn shows(view: &SweepView, other: &Heights<'_>, level: usize, (x, y): (usize, usize), range_m: (f64, f64)) -> bool {
    let (width, height) = (other.map.height_m.width(), other.map.height_m.height());
    let is_within = |at: f64, size: usize| (0.0..=size as f64 - 1.0).contains(&at);
    let is_inside = |h: f64| {
        source_from_reference(&view.camera, &other.view.camera, level as u32, ImagePoint::new(x as f64, y as f64), h)
            .is_ok_and(|q| is_within(q.sample, width) && is_within(q.line, height))
    };
    is_inside(range_m.0) && is_inside(range_m.1)
}

/// The heights that pixels of at least two views have, to a tolerance, and enough pixels in all.
fn shared(mut pixels: Vec<(usize, f64)>, tolerance_m: f64) -> Vec<f64> {
    pixels.sort_by(|a, b| a.1.total_cmp(&b.1).then(a.0.cmp(&b.0)));
    let near = |h: f64| {
        let from = pixels.partition_point(|p| p.1 < h - tolerance_m);
        let to = pixels.partition_point(|p| p.1 <= h + tolerance_m);
        &pixels[from..to]
    };
    let is_shared = |(view, h): &&(usize, f64)| {
        let same = near(*h);
        same.len() >= PIXELS_MIN && same.iter().any(|p| p.0 != *view)
    };
    pixels.iter().filter(is_shared).map(|p| p.1).collect()
}

/// Heights of the pixels that count and have enough neighbours that count at the same height, to two steps.
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
            // The pixel itself is among them.
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
        let tower = |view| [330.0, 330.0, 331.0, 331.0, 331.5].map(|h| (view, h));
        let alone = [500.0; 12].map(|h| (0, h));
        let all: Vec<_> = tower(0).into_iter().chain(tower(2)).chain(alone).collect();
        let found = shared(all, 2.0);
        assert!(found.len() == 10 && found.iter().all(|h| *h < 332.0), "{found:?}");
        assert!(shared(tower(1).to_vec(), 2.0).is_empty());
    }
}
