//! The height hypotheses of each pixel.
//!
//! Heights lie on the lattice `k · step_m` above the ellipsoid. A pixel searches
//! `low..low + count`. Only these hypotheses are computed and stored, so that time and memory
//! follow the content of the scene and not its height range.

use raster::Grid;

/// Height hypotheses of every pixel of an image level.
///
/// ```
/// use sweep::ranges::Ranges;
///
/// let ranges = Ranges::uniform(100, 80, 0.5, (10.0, 14.0));
/// assert_eq!((ranges.low[(0, 0)], ranges.count[(0, 0)]), (20, 9));
/// assert_eq!(ranges.evaluations(), 100 * 80 * 9);
/// ```
#[derive(Debug, Clone)]
pub struct Ranges {
    /// Distance of neighbouring hypotheses, metres.
    pub step_m: f64,
    /// First hypothesis of each pixel.
    pub low: Grid<i32>,
    /// Number of hypotheses of each pixel, at least one.
    pub count: Grid<u16>,
    /// Hypothesis at which the coarser level found a steep surface; [`NOT_STEEP`] elsewhere.
    pub steep: Grid<i32>,
}

/// Reach around a coarse pixel within which heights enter its range, coarse pixels.
///
/// A patch that holds an edge sees the height of the upper surface up to two pixels beside it, and
/// the lower surface begins only there. Twice the reach gains little more.
pub const EDGE_REACH: usize = 2;

/// Distances around a coarse pixel from which heights to search are taken over, coarse pixels.
#[derive(Debug, Clone, Copy, PartialEq, Eq)]
pub struct Reach {
    /// That of greater heights. A roof at the edge of its image begins up to [`EDGE_REACH`] away.
    pub above: usize,
    /// That of lesser heights, as large or larger. A coarse level smooths narrow streets away: it
    /// takes them for the roofs beside them, and the ground is known only at the next crossing.
    pub below: usize,
}

impl Reach {
    /// Returns the same reach in both directions.
    pub const fn even(reach: usize) -> Self {
        Self { above: reach, below: reach }
    }
}

/// Largest reach of the search for known heights around unknown ones, coarse pixels. Farther inside
/// a larger void the heights of the whole map count.
const REACH_MAX: usize = 16;
/// Steps that a finer level searches beyond the heights of the coarser one. One coarse step is two
/// fine ones, and the coarser height is itself off by up to a step.
const MARGIN_STEPS: f64 = 3.0;

/// Value of [`Ranges::steep`] where no steep surface is expected.
pub const NOT_STEEP: i32 = i32::MIN;
/// Largest climb of one surface from pixel to pixel, hypotheses.
///
/// Three hypotheses are a slope of 1.5 pixels of parallax per pixel. On steeper slopes one view
/// hardly sees the surface that another one sees.
pub const CLIMB_MAX: i32 = 3;
/// Smallest climb of a steep surface, hypotheses per pixel. A gentler one pays for a step every
/// other pixel at most, which does less harm than the noise of coarse heights would.
const STEEP: f32 = 0.5;
/// A climb whose halves differ by this factor or more is a jump, or noise.
const UNEVEN: f32 = 2.0;

impl Ranges {
    /// Gives every pixel the same range of heights, from `lo_m` to `hi_m` metres above the
    /// ellipsoid.
    pub fn uniform(width: usize, height: usize, step_m: f64, (lo_m, hi_m): (f64, f64)) -> Self {
        let (low, count) = span(lo_m, hi_m, step_m);
        Self {
            step_m,
            low: Grid::filled(width, height, low),
            count: Grid::filled(width, height, count),
            steep: Grid::filled(width, height, NOT_STEEP),
        }
    }

    /// Derives the ranges of a level from the heights of the next coarser one.
    ///
    /// `coarse` holds metres above `origin_m`, NaN where unknown. A pixel searches from the least
    /// height among the coarse neighbours up to `reach.below` pixels away to the greatest among
    /// those up to `reach.above` away, with a margin, inside `full` (metres above the ellipsoid).
    /// Where all of them are unknown, the nearest known ones count; where the whole map is unknown,
    /// all of `full` is searched.
    pub fn from_coarser(
        width: usize,
        height: usize,
        step_m: f64,
        coarse: &Grid<f32>,
        origin_m: f64,
        full: (f64, f64),
        reach: Reach,
    ) -> Self {
        let least = known_extreme(coarse, f32::INFINITY, f32::min, reach.below);
        let greatest = known_extreme(coarse, f32::NEG_INFINITY, f32::max, reach.above);
        let mut out = Self::uniform(width, height, step_m, full);
        let margin = MARGIN_STEPS * step_m;
        // The pixels below one coarse pixel share a range.
        let extremes = least.data().iter().zip(greatest.data());
        let spans = extremes.map(|(lo, hi)| {
            let (lo, hi) = (f64::from(*lo), f64::from(*hi));
            (lo <= hi).then(|| span((origin_m + lo - margin).max(full.0), (origin_m + hi + margin).min(full.1), step_m))
        });
        let spans: Vec<Option<(i32, u16)>> = spans.collect();
        for y in 0..height {
            let row = &spans[(y / 2).min(coarse.height() - 1) * coarse.width()..][..coarse.width()];
            let own = out.low.row_mut(y).iter_mut().zip(out.count.row_mut(y));
            for (x, (low, count)) in own.enumerate() {
                if let Some(span) = row[(x / 2).min(coarse.width() - 1)] {
                    (*low, *count) = span;
                }
            }
        }
        out.expect_steep(coarse, origin_m);
        out
    }

    /// Notes the coarser level's surface where it is steep.
    fn expect_steep(&mut self, coarse: &Grid<f32>, origin_m: f64) {
        let (width, height) = (self.steep.width(), self.steep.height());
        let steps = |height_m: f32| height_m / self.step_m as f32;
        // At the border of the map slopes lack a side.
        for y in 2..coarse.height().saturating_sub(2) {
            let rows = [y - 2, y - 1, y, y + 1, y + 2].map(|y| coarse.row(y));
            for x in 2..coarse.width().saturating_sub(2) {
                let own = rows[2][x];
                let lines = [[rows[2][x - 2], own, rows[2][x + 2]], [rows[0][x], own, rows[4][x]]];
                let slopes = lines.map(|line| steps(slope(line)));
                if slopes[0].hypot(slopes[1]) <= STEEP {
                    continue;
                }
                for (dy, fine_y) in (0..2).map(|dy| (dy, 2 * y + dy)).filter(|(_, y)| *y < height) {
                    for (dx, fine_x) in (0..2).map(|dx| (dx, 2 * x + dx)).filter(|(_, x)| *x < width) {
                        // Bilinear interpolation with the coarse pixels in the direction of the
                        // fine one. A height across a jump belongs to another surface and is
                        // replaced.
                        let (row, column) = (rows[1 + 2 * dy], x + 2 * dx - 1);
                        let near = |height_m: f32| {
                            if steps((height_m - own).abs()) <= 2.0 * CLIMB_MAX as f32 { height_m } else { own }
                        };
                        let sides = near(rows[2][column]) + near(row[x]);
                        let height_m = (9.0 * own + 3.0 * sides + near(row[column])) / 16.0;
                        let hypothesis = (origin_m + f64::from(height_m)) / self.step_m;
                        self.steep[(fine_x, fine_y)] = hypothesis.round() as i32;
                    }
                }
            }
        }
    }

    /// Gives one hypothesis, whose result is not used, to pixels where the image is NaN.
    #[must_use]
    pub fn without_voids(mut self, image: &Grid<f32>) -> Self {
        for (n, _) in self.count.data_mut().iter_mut().zip(image.data()).filter(|(_, v)| v.is_nan()) {
            *n = 1;
        }
        self
    }

    /// Narrows the search of a pixel to the heights from `lo_m` to `hi_m`, metres above the
    /// ellipsoid. A pixel that searches none of them keeps its range.
    pub fn narrow(&mut self, at: (usize, usize), (lo_m, hi_m): (f64, f64)) {
        let (low, count) = span(lo_m, hi_m, self.step_m);
        let end = |low: i32, count: u16| low + i32::from(count);
        let first = low.max(self.low[at]);
        let number = end(low, count).min(end(self.low[at], self.count[at])) - first;
        if let Some(number) = u16::try_from(number).ok().filter(|number| *number > 0) {
            (self.low[at], self.count[at]) = (first, number);
        }
    }

    /// Returns the number of hypotheses of all pixels.
    pub fn evaluations(&self) -> u64 {
        self.count.data().iter().map(|&n| u64::from(n)).sum()
    }
}

/// Returns by how many hypotheses a steep surface climbs from one pixel to the next, given where it
/// is expected at each. Returns 0 where no steep surface is expected, or where one ends and another
/// begins.
#[inline(always)]
pub(crate) fn climb_of(from: i32, to: i32) -> i32 {
    let climb = to.wrapping_sub(from);
    if climb.wrapping_add(CLIMB_MAX) as u32 <= 2 * CLIMB_MAX as u32 { climb } else { 0 }
}

/// Returns by how much the surface climbs per fine pixel, from a coarse height and those two pixels
/// before and behind it; 0 where the climb is uneven or a height is NaN.
fn slope([before, own, behind]: [f32; 3]) -> f32 {
    let (before, behind) = (own - before, behind - own);
    let (less, more) = (before.abs().min(behind.abs()), before.abs().max(behind.abs()));
    if before * behind > 0.0 && more < UNEVEN * less { (before + behind) / 8.0 } else { 0.0 }
}

/// Returns the lattice indices that cover a height interval: the first one and their number.
fn span(lo_m: f64, hi_m: f64, step_m: f64) -> (i32, u16) {
    let low = (lo_m / step_m).floor() as i32;
    let high = (hi_m / step_m).ceil() as i32;
    (low, (high - low + 1).clamp(1, i32::from(u16::MAX)) as u16)
}

/// Returns the least or the greatest known height around every cell: `pick` is the minimum with
/// `start` +∞, or the maximum with −∞.
///
/// The neighbours up to `reach` away count. Where all are unknown, the smallest of a few growing
/// squares with a known height counts, or else the whole map. Without any height the result is
/// `start`.
fn known_extreme(g: &Grid<f32>, start: f32, pick: impl Fn(f32, f32) -> f32 + Copy, reach: usize) -> Grid<f32> {
    let mut out = extremes(g, start, pick, reach);
    // The reach of each round adds to that of the rounds before.
    let (mut reach, mut wide) = (reach + 1, out.clone());
    while reach <= REACH_MAX && out.data().iter().any(|v| v.is_infinite()) {
        wide = extremes(&wide, start, pick, reach);
        out.data_mut().iter_mut().zip(wide.data()).filter(|(o, _)| o.is_infinite()).for_each(|(o, w)| *o = *w);
        reach *= 2;
    }
    let all = g.data().iter().filter(|v| v.is_finite()).copied().fold(start, pick);
    out.data_mut().iter_mut().filter(|v| v.is_infinite()).for_each(|v| *v = all);
    out
}

/// Applies `pick` (minimum or maximum) over the square of half width `reach` around every cell, NaN
/// cells left out.
pub(crate) fn extremes(g: &Grid<f32>, start: f32, pick: impl Fn(f32, f32) -> f32, reach: usize) -> Grid<f32> {
    let (w, h) = (g.width(), g.height());
    let mut rows = Grid::filled(w, h, start);
    for y in 0..h {
        let (from, to) = (g.row(y), rows.row_mut(y));
        // For a NaN `f32::min` and `f32::max` return the other operand.
        for shift in 0..=reach.min(w.saturating_sub(1)) {
            to.iter_mut().zip(&from[shift..]).for_each(|(to, v)| *to = pick(*to, *v));
            to[shift..].iter_mut().zip(from).for_each(|(to, v)| *to = pick(*to, *v));
        }
    }
    let mut out = Grid::filled(w, h, start);
    for y in 0..h {
        for v in y.saturating_sub(reach)..(y + reach + 1).min(h) {
            out.row_mut(y).iter_mut().zip(rows.row(v)).for_each(|(to, v)| *to = pick(*to, *v));
        }
    }
    out
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn a_thin_tower_widens_the_range_around_it_and_nowhere_else() {
        let mut coarse = Grid::filled(20, 20, 0.0f32);
        coarse[(10, 10)] = 130.0;
        let r = Ranges::from_coarser(40, 40, 0.5, &coarse, 100.0, (0.0, 400.0), Reach::even(1));
        assert_eq!((r.low[(2, 2)], r.count[(2, 2)]), (197, 7));
        assert_eq!((r.low[(19, 19)], r.count[(19, 19)]), (197, 267));
    }

    #[test]
    fn the_ground_is_searched_from_farther_away_than_roofs() {
        let mut coarse = Grid::filled(30, 5, 20.0f32);
        (0..5).for_each(|y| (coarse[(0, y)], coarse[(29, y)]) = (5.0, 40.0));
        let r = Ranges::from_coarser(60, 10, 1.0, &coarse, 0.0, (-100.0, 100.0), Reach { above: 2, below: 8 });
        let searched = |x: usize| (r.low[(x, 4)], r.low[(x, 4)] + i32::from(r.count[(x, 4)]) - 1);
        assert_eq!([searched(17), searched(18), searched(54), searched(53)], [(2, 23), (17, 23), (17, 43), (17, 23)]);
    }

    #[test]
    fn an_unknown_stretch_takes_what_is_known_next_to_it() {
        let mut coarse = Grid::filled(30, 30, f32::NAN);
        (0..30).for_each(|y| coarse[(0, y)] = 7.0);
        let r = Ranges::from_coarser(60, 60, 1.0, &coarse, 0.0, (-100.0, 100.0), Reach::even(1));
        assert_eq!((r.low[(50, 30)], r.count[(50, 30)]), (4, 7));
        let none = Ranges::from_coarser(4, 4, 1.0, &Grid::filled(2, 2, f32::NAN), 0.0, (-100.0, 100.0), Reach::even(1));
        assert_eq!((none.low[(0, 0)], none.count[(0, 0)]), (-100, 201));
    }

    #[test]
    fn steep_surfaces_are_expected_where_they_go_on_and_gentle_ones_and_walls_are_not() {
        let map = |of: &dyn Fn(f32, f32) -> f32| {
            Grid::from_vec(12, 12, (0..144).map(|i| of((i % 12) as f32, (i / 12) as f32)).collect()).unwrap()
        };
        let steep =
            |coarse: &Grid<f32>| Ranges::from_coarser(24, 24, 0.5, coarse, 100.125, (0.0, 400.0), Reach::even(1)).steep;
        // A metre per coarse pixel is a hypothesis per fine pixel. The centre of a fine pixel lies
        // a quarter of a coarse pixel beside that of the coarse one.
        let [right, down] = [steep(&map(&|x, _| x)), steep(&map(&|_, y| y))];
        for (x, y) in (4..20).flat_map(|y| (4..20).map(move |x| (x, y))) {
            assert_eq!((right[(x, y)], down[(x, y)]), (200 + x as i32, 200 + y as i32), "at ({x}, {y})");
        }
        // At the foot of a wall beside a slope the slope is expected.
        let beside = steep(&map(&|x, y| if x < 6.0 { y } else { y + 40.0 }));
        assert!((4..20).all(|y| beside[(11, y)] == 200 + y as i32 && beside[(12, y)] == 280 + y as i32));
        assert_eq!(climb_of(beside[(11, 8)], beside[(12, 8)]), 0);
        let none = |map: Grid<f32>| steep(&map).data().iter().all(|h| *h == NOT_STEEP);
        assert!(none(map(&|x, _| 0.4 * x)) && none(map(&|x, _| if x < 6.0 { 0.0 } else { 9.0 })));
        assert!(none(map(&|_, _| f32::NAN)));
        assert_eq!((climb_of(NOT_STEEP, 5), climb_of(5, NOT_STEEP), climb_of(NOT_STEEP, NOT_STEEP)), (0, 0, 0));
        assert_eq!((climb_of(5, 8), climb_of(8, 5), climb_of(5, 9)), (3, -3, 0));
    }
}
