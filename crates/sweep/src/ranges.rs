//! Which height hypotheses each pixel is given.
//!
//! Heights live on the lattice `k · step_m`. A pixel searches `[low, low + count)`; its hypotheses are stored one
//! after the other, so cost and memory follow the scene's content and not its height range.

use raster::Grid;

/// The hypotheses of every pixel of an image level.
#[derive(Debug, Clone)]
pub struct Ranges {
    /// Metres between neighbouring hypotheses.
    pub step_m: f64,
    /// First hypothesis of each pixel.
    pub low: Grid<i32>,
    /// Number of hypotheses of each pixel, at least one.
    pub count: Grid<u16>,
    /// The hypothesis at which the coarser level found a steep surface; [`NOT_STEEP`] elsewhere.
    pub steep: Grid<i32>,
}

/// How far around a coarse pixel heights count, coarse pixels: a patch that holds an edge sees the upper surface's height up to
/// two pixels beside it, and the lower one begins only there. Twice as far gains little more.
pub const EDGE_REACH: usize = 2;
/// Squares of unknown heights wider than about four times this take the whole map's heights.
const REACH_MAX: usize = 16;
/// Steps that a finer level searches beyond what the coarser one found: one coarse step is two fine ones, and the
/// coarser height is itself off by up to a step.
const MARGIN_STEPS: f64 = 3.0;

/// No steep surface is expected.
pub const NOT_STEEP: i32 = i32::MIN;
/// Surfaces that climb by more hypotheses than this from pixel to pixel are two: three are a slope of 1.5 pixels of parallax per
/// pixel, at which a view hardly sees the surface that another one sees.
pub const CLIMB_MAX: i32 = 3;
/// Climbs beyond this are steep, hypotheses per pixel: gentler surfaces cost a step every other pixel, less than the noise of a
/// coarse height handed down would do harm.
const STEEP: f32 = 0.5;
/// A climb whose halves differ by this factor is a jump, or noise.
const UNEVEN: f32 = 2.0;

impl Ranges {
    /// The same range of heights for every pixel.
    pub fn uniform(width: usize, height: usize, step_m: f64, (lo_m, hi_m): (f64, f64)) -> Self {
        let (low, count) = span(lo_m, hi_m, step_m);
        Self {
            step_m,
            low: Grid::filled(width, height, low),
            count: Grid::filled(width, height, count),
            steep: Grid::filled(width, height, NOT_STEEP),
        }
    }

    /// Ranges of a level from the heights of the next coarser one (metres, NaN where unknown): the least and greatest
    /// height among the coarse neighbours up to `reach` away, with a margin. Where all of them are unknown, the nearest known
    /// ones around count; `full` where the whole map is unknown.
    pub fn from_coarser(
        width: usize,
        height: usize,
        step_m: f64,
        coarse: &Grid<f32>,
        origin_m: f64,
        full: (f64, f64),
        reach: usize,
    ) -> Self {
        let (least, greatest) = known_extremes(coarse, reach);
        let mut out = Self::uniform(width, height, step_m, full);
        let margin = MARGIN_STEPS * step_m;
        // All pixels of a coarse one search alike.
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

    /// Takes over the coarser level's surface where it is steep.
    fn expect_steep(&mut self, coarse: &Grid<f32>, origin_m: f64) {
        let (width, height) = (self.steep.width(), self.steep.height());
        let steps = |height_m: f32| height_m / self.step_m as f32;
        // Along the map's border no slope has two sides.
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
                        // The next coarse pixels in the direction of the fine one; what is across a jump is another surface.
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

    /// One hypothesis, which is never looked at, for the pixels where the image has no value.
    #[must_use]
    pub fn without_voids(mut self, image: &Grid<f32>) -> Self {
        for (n, _) in self.count.data_mut().iter_mut().zip(image.data()).filter(|(_, v)| v.is_nan()) {
            *n = 1;
        }
        self
    }

    /// Number of pixel × hypothesis pairs.
    pub fn evaluations(&self) -> u64 {
        self.count.data().iter().map(|&n| u64::from(n)).sum()
    }
}

/// By how many hypotheses a surface climbs from one pixel to the next, by where it is expected at each; by none where it is not
/// steep, or the one ends and another begins.
#[inline(always)]
pub(crate) fn climb_of(from: i32, to: i32) -> i32 {
    let climb = to.wrapping_sub(from);
    if climb.wrapping_add(CLIMB_MAX) as u32 <= 2 * CLIMB_MAX as u32 { climb } else { 0 }
}

/// A coarse height and those two pixels before and behind it say by how much the surface climbs per fine pixel; 0 where it is
/// uneven or one is not known.
fn slope([before, own, behind]: [f32; 3]) -> f32 {
    let (before, behind) = (own - before, behind - own);
    let (less, more) = (before.abs().min(behind.abs()), before.abs().max(behind.abs()));
    if before * behind > 0.0 && more < UNEVEN * less { (before + behind) / 8.0 } else { 0.0 }
}

/// Lattice indices that cover a height interval: first, and how many.
fn span(lo_m: f64, hi_m: f64, step_m: f64) -> (i32, u16) {
    let low = (lo_m / step_m).floor() as i32;
    let high = (hi_m / step_m).ceil() as i32;
    (low, (high - low + 1).clamp(1, i32::from(u16::MAX)) as u16)
}

/// Least and greatest known height around every cell: of its neighbours up to `reach` away or, where all are unknown, of the
/// smallest of a few growing squares that holds a known one, or else of the whole map. (+inf, −inf) when nothing is.
fn known_extremes(g: &Grid<f32>, reach: usize) -> (Grid<f32>, Grid<f32>) {
    let (mut least, mut greatest) =
        (extremes(g, f32::INFINITY, f32::min, reach), extremes(g, f32::NEG_INFINITY, f32::max, reach));
    // Each round adds its reach to that of the rounds before it.
    let mut reach = reach + 1;
    let (mut wide_least, mut wide_greatest) = (least.clone(), greatest.clone());
    while reach <= REACH_MAX && least.data().iter().any(|v| v.is_infinite()) {
        wide_least = extremes(&wide_least, f32::INFINITY, f32::min, reach);
        wide_greatest = extremes(&wide_greatest, f32::NEG_INFINITY, f32::max, reach);
        let known = |out: &mut Grid<f32>, wide: &Grid<f32>| {
            out.data_mut().iter_mut().zip(wide.data()).filter(|(o, _)| o.is_infinite()).for_each(|(o, w)| *o = *w);
        };
        known(&mut least, &wide_least);
        known(&mut greatest, &wide_greatest);
        reach *= 2;
    }
    let known = |v: &&f32| v.is_finite();
    let all_least = g.data().iter().filter(known).copied().fold(f32::INFINITY, f32::min);
    let all_greatest = g.data().iter().filter(known).copied().fold(f32::NEG_INFINITY, f32::max);
    least.data_mut().iter_mut().filter(|v| v.is_infinite()).for_each(|v| *v = all_least);
    greatest.data_mut().iter_mut().filter(|v| v.is_infinite()).for_each(|v| *v = all_greatest);
    (least, greatest)
}

/// `pick` over the square of half width `reach` around every cell, NaN cells left out.
pub(crate) fn extremes(g: &Grid<f32>, start: f32, pick: impl Fn(f32, f32) -> f32, reach: usize) -> Grid<f32> {
    let (w, h) = (g.width(), g.height());
    let mut rows = Grid::filled(w, h, start);
    for y in 0..h {
        let (from, to) = (g.row(y), rows.row_mut(y));
        // `f32::min` and `max` return the other operand for a NaN.
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
        let r = Ranges::from_coarser(40, 40, 0.5, &coarse, 100.0, (0.0, 400.0), 1);
        assert_eq!((r.low[(2, 2)], r.count[(2, 2)]), (197, 7));
        assert_eq!((r.low[(19, 19)], r.count[(19, 19)]), (197, 267));
    }

    #[test]
    fn an_unknown_stretch_takes_what_is_known_next_to_it() {
        let mut coarse = Grid::filled(30, 30, f32::NAN);
        (0..30).for_each(|y| coarse[(0, y)] = 7.0);
        let r = Ranges::from_coarser(60, 60, 1.0, &coarse, 0.0, (-100.0, 100.0), 1);
        assert_eq!((r.low[(50, 30)], r.count[(50, 30)]), (4, 7));
        let none = Ranges::from_coarser(4, 4, 1.0, &Grid::filled(2, 2, f32::NAN), 0.0, (-100.0, 100.0), 1);
        assert_eq!((none.low[(0, 0)], none.count[(0, 0)]), (-100, 201));
    }

    #[test]
    fn steep_surfaces_are_expected_where_they_go_on_and_gentle_ones_and_walls_are_not() {
        let map = |of: &dyn Fn(f32, f32) -> f32| {
            Grid::from_vec(12, 12, (0..144).map(|i| of((i % 12) as f32, (i / 12) as f32)).collect()).unwrap()
        };
        let steep = |coarse: &Grid<f32>| Ranges::from_coarser(24, 24, 0.5, coarse, 100.125, (0.0, 400.0), 1).steep;
        // A metre per coarse pixel is a hypothesis per fine one, whose middle lies a quarter of a coarse pixel beside that one's.
        let [right, down] = [steep(&map(&|x, _| x)), steep(&map(&|_, y| y))];
        for (x, y) in (4..20).flat_map(|y| (4..20).map(move |x| (x, y))) {
            assert_eq!((right[(x, y)], down[(x, y)]), (200 + x as i32, 200 + y as i32), "at ({x}, {y})");
        }
        // The foot of a wall beside a slope is the slope's.
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
