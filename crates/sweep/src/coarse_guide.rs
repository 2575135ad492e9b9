//! Heights of coarse levels where the finest level matches at many heights.
//!
//! Stripes of a roof, rows of windows and parked cars match at heights that are a period apart, and
//! match well at each of them. On coarse levels the pattern is averaged away, and what is left is
//! the roof as a whole with the ground around it. Where the finest level fits well and is not
//! distinct, its search is therefore narrowed to the height of the finest coarse level that is
//! distinct. Costs that several scales decide together are the idea of Zhang et al. (2014,
//! "Cross-Scale Cost Aggregation for Stereo Matching").

use raster::Grid;

use crate::height_map::HeightMap;
use crate::ranges::Ranges;
use crate::window_sums::window_means;

/// Distinctness of a coarse height that is asked: no second height fits nearly as well.
const DISTINCT: f32 = 0.75;
/// Mean distinctness around a pixel below which a pattern repeats. Single pixels are ambiguous
/// everywhere.
const REPEATED: f64 = 0.15;
/// Distance around a pixel over which the distinctness is averaged, pixels: half a period of the
/// longest pattern that the coarse levels average away.
const REACH: usize = 4;
/// Share of the contrast that the views must agree on where a pattern repeats. Shadows, water and
/// trees have no distinct heights either, but match badly at all of them.
const SUPPORT_MIN: f32 = 0.65;

/// What was found in a view before it is swept once more on another lattice of pixels.
///
/// ```
/// use raster::Grid;
/// use sweep::ranges::Ranges;
/// use sweep::{CoarseGuide, HeightMap};
///
/// let map = |side: usize, height_m: f32, distinctness: f32| {
///     let mut map = HeightMap::empty(side, side, 100.0);
///     map.height_m = Grid::filled(side, side, height_m);
///     map.confidence = Grid::filled(side, side, distinctness);
///     map.support = Grid::filled(side, side, 0.8);
///     map
/// };
/// // Stripes match at many heights; the coarse level saw the roof at 108 m.
/// let (own, coarse) = (map(16, 3.0, 0.0), map(8, 8.0, 0.9));
/// let mut ranges = Ranges::uniform(16, 16, 0.5, (90.0, 130.0));
/// CoarseGuide { own: &own, coarser: vec![&coarse] }.narrow(&mut ranges);
/// assert_eq!((ranges.low[(5, 5)], ranges.count[(5, 5)]), (214, 5));
/// ```
#[derive(Debug, Clone)]
pub struct CoarseGuide<'a> {
    /// Heights of the view on the finest level.
    pub own: &'a HeightMap,
    /// Heights of the view on the coarser levels, each half as fine as the one before it, the next
    /// coarser one first.
    pub coarser: Vec<&'a HeightMap>,
}

impl CoarseGuide<'_> {
    /// Number of coarse levels that are worth asking: a pixel of the third one is as wide as the
    /// longest pattern that is taken for one.
    pub const LEVELS: usize = 3;

    /// Narrows the search of pixels where a pattern repeats: to one step of the coarse level on
    /// both sides of its height. The ranges are those of the finest level.
    ///
    /// Another lattice of pixels lies up to half a pixel further, which a coarse pixel does not
    /// tell apart.
    pub fn narrow(&self, ranges: &mut Ranges) {
        let distinctness = self.own.confidence.data();
        let width = self.own.height_m.width();
        let around = window_means(distinctness.len(), width, REACH, |i| f64::from(distinctness[i]));
        for (i, mean) in around.into_iter().enumerate() {
            let at = (i % width, i / width);
            let repeats = mean < REPEATED && self.own.support[at] >= SUPPORT_MIN;
            let Some((height_m, side)) = repeats.then(|| self.distinct_height_m(at)).flatten() else { continue };
            let reach_m = side as f64 * ranges.step_m;
            ranges.narrow(at, (height_m - reach_m, height_m + reach_m));
        }
    }

    /// Returns the height of the finest coarse level that is distinct at a pixel, metres above the
    /// ellipsoid, and how many pixels a pixel of that level is wide.
    fn distinct_height_m(&self, (x, y): (usize, usize)) -> Option<(f64, usize)> {
        self.coarser.iter().zip(1..).take(Self::LEVELS).find_map(|(map, doublings)| {
            let side = 1usize << doublings;
            let place = |grid: &Grid<f32>| ((x / side).min(grid.width() - 1), (y / side).min(grid.height() - 1));
            let at = place(&map.height_m);
            let is_known = map.confidence[at] >= DISTINCT && !map.height_m[at].is_nan();
            is_known.then(|| (map.origin_m + f64::from(map.height_m[at]), side))
        })
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    /// A view of `side` pixels that found one height everywhere.
    fn found(side: usize, height_m: f32, distinctness: f32) -> HeightMap {
        let mut map = HeightMap::empty(side, side, 100.0);
        map.height_m = Grid::filled(side, side, height_m);
        map.confidence = Grid::filled(side, side, distinctness);
        map.support = Grid::filled(side, side, 0.8);
        map
    }

    fn searched(own: &HeightMap, coarser: &[&HeightMap], at: (usize, usize)) -> (i32, u16) {
        let mut ranges = Ranges::uniform(32, 32, 0.5, (80.0, 130.0));
        CoarseGuide { own, coarser: coarser.to_vec() }.narrow(&mut ranges);
        (ranges.low[at], ranges.count[at])
    }

    #[test]
    fn a_repeated_pattern_is_searched_where_the_finest_distinct_level_found_it() {
        let whole = (160, 101);
        let mut own = found(32, 3.0, 0.1);
        // Level 1 is as ambiguous. Level 2 saw the roof at 112 m but for one pixel, level 3 at
        // 110 m.
        let (first, mut second, third) = (found(16, 4.0, 0.2), found(8, 12.0, 0.9), found(4, 10.0, 0.9));
        second.height_m[(7, 7)] = f32::NAN;
        let coarser = [&first, &second, &third];
        assert_eq!(searched(&own, &coarser, (5, 6)), (220, 9));
        assert_eq!(searched(&own, &coarser, (31, 31)), (212, 17));
        assert_eq!(searched(&own, &[], (8, 8)), whole);
        // Distinct surroundings are left as they are, and so is what fits badly.
        (0..12).for_each(|y| own.confidence.row_mut(y)[..12].fill(0.7));
        own.support[(20, 20)] = 0.3;
        assert_eq!([(5, 6), (20, 20)].map(|at| searched(&own, &coarser, at)), [whole; 2]);
        assert_eq!(searched(&own, &coarser, (22, 22)), (220, 9));
    }
}
