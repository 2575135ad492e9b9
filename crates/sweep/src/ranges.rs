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
}

/// How far around a coarse pixel heights count, coarse pixels: a patch that holds an edge sees the upper surface's height up to
/// two pixels beside it, and the lower one begins only there. Twice as far gains little more.
pub const EDGE_REACH: usize = 2;
/// Squares of unknown heights wider than about four times this take the whole map's heights.
const REACH_MAX: usize = 16;
/// Steps that a finer level searches beyond what the coarser one found: one coarse step is two fine ones, and the
/// coarser height is itself off by up to a step.
const MARGIN_STEPS: f64 = 3.0;

impl Ranges {
    /// The same range of heights for every pixel.
    pub fn uniform(width: usize, height: usize, step_m: f64, (lo_m, hi_m): (f64, f64)) -> Self {
        let (low, count) = span(lo_m, hi_m, step_m);
        Self { step_m, low: Grid::filled(width, height, low), count: Grid::filled(width, height, count) }
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
        out
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
}
