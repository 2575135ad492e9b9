//! What one view sees of a city model, held against the heights that a coarse level found.
//!
//! The pointing of the images and the place of the model are each off by metres. The prior is
//! therefore moved to where most of its pixels agree with the heights found. What then differs
//! tells which buildings are wrong (`prior_verdict`).

use std::collections::{BTreeMap, BTreeSet};

use priors::NO_OBJECT;
use raster::Grid;
use rayon::prelude::*;
use sweep::HeightMap;

use crate::prior::verdict::densest;

/// Standard deviation of the heights of city models, metres: roofs of LoD2 models lie within half a
/// metre of laser heights.
pub(crate) const DEVIATION_M: f64 = 0.5;

/// Largest shift of the model against the images, metres: the pointing of good satellites without
/// ground control.
const SEARCH_M: f64 = 10.0;
/// Largest shift of the model against the images, pixels of the level.
const REACH_MAX: i64 = 12;
/// Number of pixels that are compared for each shift, at most.
const SAMPLES_MAX: usize = 4000;
/// Heights of a level are off by up to this many of its steps.
const AGREEING_STEPS: f64 = 2.0;
/// A model with a smaller share of agreeing pixels has nothing to do with the scene. Most of its
/// buildings may be wrong, and the place of the others is still found.
const AGREEING_MIN: f64 = 0.2;
/// A shift must raise the share of agreeing pixels by this much. Walls that hide what is behind
/// them draw the model a pixel to their side.
const MOVE_GAIN: f64 = 0.05;

/// What one view sees of the model, at its full resolution.
#[derive(Debug, Clone)]
pub struct ViewPrior {
    /// Heights of the model, metres above the ellipsoid; NaN where there is no building.
    pub height_m: Grid<f32>,
    /// Number of the building, [`NO_OBJECT`] where there is none.
    pub object: Grid<u32>,
    /// Side of a pixel on the ground, metres.
    pub gsd_m: f64,
}

/// A shift of the model in a view.
#[derive(Debug, Clone, Copy, PartialEq)]
struct Shift {
    /// Columns, pixels at full resolution.
    x: i64,
    /// Rows, pixels at full resolution.
    y: i64,
    /// Height that is added to the model, metres.
    height_m: f32,
    /// Share of all samples that agree.
    agreeing: f64,
}

/// A pixel of the model that is compared with the heights found.
#[derive(Debug, Clone, Copy, PartialEq)]
struct Sample {
    x: i64,
    y: i64,
    /// Height of the model, metres above the ellipsoid.
    height_m: f32,
}

impl ViewPrior {
    /// Returns the heights of a level: those of the pixel in the middle of each coarse pixel, so
    /// that edges stay sharp. The pixels lie `offset_px` further (columns, rows; pixels of the
    /// level).
    pub(crate) fn at_level(&self, level: usize, (width, height): (usize, usize), offset_px: [f64; 2]) -> Grid<f32> {
        let side = 1usize << level;
        let [right, down] = offset_px.map(|px| (px * side as f64).round() as usize + side / 2);
        let place = |i: usize, offset: usize, n: usize| (i * side + offset).min(n - 1);
        let of = |x, y| self.height_m[(place(x, right, self.height_m.width()), place(y, down, self.height_m.height()))];
        let mut out = Grid::filled(width, height, f32::NAN);
        out.data_mut().iter_mut().enumerate().for_each(|(i, h)| *h = of(i % width, i / width));
        out
    }

    /// Moves the prior to the heights that a level found. Returns `None` when hardly anything
    /// agrees anywhere.
    pub(crate) fn placed(&self, map: &HeightMap, level: usize, step_m: f64) -> Option<Self> {
        let tolerance_m = tolerance_m(step_m);
        let side = 1i64 << level;
        let reach = ((SEARCH_M / (self.gsd_m * side as f64)).ceil() as i64).min(REACH_MAX);
        let samples = self.samples(side as usize);
        let shifts: Vec<(i64, i64)> = (-reach..=reach).flat_map(|y| (-reach..=reach).map(move |x| (x, y))).collect();
        let scored: Vec<Shift> =
            shifts.par_iter().filter_map(|&by| score(map, &samples, side, by, tolerance_m)).collect();
        // The nearest of equals, so that the order of the shifts does not matter.
        let far = |s: &Shift| s.x * s.x + s.y * s.y;
        let order = |a: &&Shift, b: &&Shift| a.agreeing.total_cmp(&b.agreeing).then(far(b).cmp(&far(a)));
        let best = scored.iter().max_by(order).filter(|best| best.agreeing >= AGREEING_MIN)?;
        let unmoved = scored.iter().find(|s| far(s) == 0 && s.agreeing + MOVE_GAIN >= best.agreeing);
        Some(self.moved(*unmoved.unwrap_or(best)))
    }

    /// Returns the known pixels in the middles of coarse pixels, at most [`SAMPLES_MAX`].
    fn samples(&self, side: usize) -> Vec<Sample> {
        let (w, h) = (self.height_m.width(), self.height_m.height());
        let middles = |n: usize| (side / 2..n).step_by(side);
        let known: Vec<Sample> = middles(h)
            .flat_map(|y| middles(w).map(move |x| (x, y)))
            .map(|(x, y)| Sample { x: x as i64, y: y as i64, height_m: self.height_m[(x, y)] })
            .filter(|s| s.height_m.is_finite())
            .collect();
        let every = known.len().div_ceil(SAMPLES_MAX).max(1);
        known.into_iter().step_by(every).collect()
    }

    /// Returns the prior after a shift.
    fn moved(&self, by: Shift) -> Self {
        let (w, h) = (self.height_m.width(), self.height_m.height());
        let (height_m, object) = (Grid::filled(w, h, f32::NAN), Grid::filled(w, h, NO_OBJECT));
        let mut out = Self { height_m, object, gsd_m: self.gsd_m };
        for y in 0..h {
            for x in 0..w {
                let (u, v) = (x as i64 - by.x, y as i64 - by.y);
                if (0..w as i64).contains(&u) && (0..h as i64).contains(&v) {
                    let from = (u as usize, v as usize);
                    out.height_m[(x, y)] = self.height_m[from] + by.height_m;
                    out.object[(x, y)] = self.object[from];
                }
            }
        }
        out
    }

    /// Returns the differences of the heights that a level found to those of the model, metres, by
    /// the number of the building.
    pub(crate) fn differences(&self, map: &HeightMap, level: usize) -> BTreeMap<u32, Vec<f32>> {
        let side = 1usize << level;
        let mut out: BTreeMap<u32, Vec<f32>> = BTreeMap::new();
        for y in (side / 2..self.height_m.height()).step_by(side) {
            for x in (side / 2..self.height_m.width()).step_by(side) {
                let object = self.object[(x, y)];
                let found = found_at(map, (x / side) as i64, (y / side) as i64);
                if let (true, Some(found)) = (object != NO_OBJECT, found) {
                    out.entry(object).or_default().push(found - self.height_m[(x, y)]);
                }
            }
        }
        out
    }

    /// Returns the prior without some of its buildings.
    pub(crate) fn without(mut self, gone: &BTreeSet<u32>) -> Self {
        for (object, height_m) in self.object.data_mut().iter_mut().zip(self.height_m.data_mut()) {
            if gone.contains(object) {
                (*object, *height_m) = (NO_OBJECT, f32::NAN);
            }
        }
        self
    }
}

/// Returns the largest difference of a model's height and a right one found with this distance of
/// hypotheses, metres.
pub(crate) fn tolerance_m(step_m: f64) -> f32 {
    (AGREEING_STEPS * step_m).max(DEVIATION_M) as f32
}

/// Returns the height that a level found at its pixel, metres above the ellipsoid.
fn found_at(map: &HeightMap, x: i64, y: i64) -> Option<f32> {
    let inside = x >= 0 && y >= 0;
    let found = inside.then(|| map.height_m.get(x as usize, y as usize)).flatten()?;
    (!found.is_nan()).then(|| (map.origin_m + f64::from(*found)) as f32)
}

/// Rates a shift by `(dx, dy)` coarse pixels: the share of samples that agree with the heights
/// found once the most frequent difference is added to all. Returns `None` when no sample has a
/// height to compare with, or all differences are too large.
fn score(map: &HeightMap, samples: &[Sample], side: i64, (dx, dy): (i64, i64), tolerance_m: f32) -> Option<Shift> {
    let difference =
        |s: &Sample| Some(found_at(map, s.x.div_euclid(side) + dx, s.y.div_euclid(side) + dy)? - s.height_m);
    let mut off: Vec<f32> = samples.iter().filter_map(difference).collect();
    off.sort_by(f32::total_cmp);
    let agreeing = &off[densest(&off, 2.0 * tolerance_m, |middle_m| f64::from(middle_m.abs()) <= SEARCH_M)?];
    // Half the tolerance is about a step of the level. Buildings that fit a height near by would
    // draw the median of all that agree to their side.
    let closest = &agreeing[densest(agreeing, 0.5 * tolerance_m, |_| true)?];
    let share = agreeing.len() as f64 / samples.len() as f64;
    Some(Shift { x: dx * side, y: dy * side, height_m: closest[closest.len() / 2], agreeing: share })
}

#[cfg(test)]
mod tests {
    use super::*;

    /// Two boxes of 12 and 20 m over ground at 0, numbered 1 and 2, 64 × 64 pixels.
    fn boxes() -> ViewPrior {
        let (height_m, object) = (Grid::filled(64, 64, f32::NAN), Grid::filled(64, 64, NO_OBJECT));
        let mut out = ViewPrior { height_m, object, gsd_m: 0.5 };
        for (number, (x0, y0, height)) in [(8, 10, 12.0f32), (34, 30, 20.0)].into_iter().enumerate() {
            for (x, y) in (0..18).flat_map(|y| (0..18).map(move |x| (x0 + x, y0 + y))) {
                out.height_m[(x, y)] = height;
                out.object[(x, y)] = number as u32 + 1;
            }
        }
        out
    }

    /// The heights that a level of 2 × 2 pixels finds when the scene lies elsewhere by pixels and
    /// metres.
    fn found(by: (i64, i64), up_m: f32, is_there: impl Fn(u32) -> bool) -> HeightMap {
        let moved = boxes().moved(Shift { x: by.0, y: by.1, height_m: 0.0, agreeing: 1.0 });
        let mut map = HeightMap::empty(32, 32, 100.0);
        for (x, y) in (0..32).flat_map(|y| (0..32).map(move |x| (x, y))) {
            let fine = (2 * x + 1, 2 * y + 1);
            let roof = Some(moved.height_m[fine]).filter(|h| h.is_finite() && is_there(moved.object[fine]));
            map.height_m[(x, y)] = roof.unwrap_or(0.0) + up_m - 100.0;
        }
        map
    }

    #[test]
    fn a_model_is_placed_by_most_of_its_buildings_and_not_drawn_by_others() {
        let map = HeightMap { height_m: Grid::filled(10, 10, 0.0), ..HeightMap::empty(10, 10, 100.0) };
        let samples: Vec<Sample> = (0..100u8)
            .map(|i| {
                let is_right = i < 60;
                let off_m = if is_right { f32::from(i) / 75.0 - 0.4 } else { 2.0 + f32::from(i - 60) / 50.0 };
                Sample { x: i64::from(i % 10), y: i64::from(i / 10), height_m: 100.0 - off_m }
            })
            .collect();
        let placed = score(&map, &samples, 1, (0, 0), 1.75).unwrap();
        assert!(placed.height_m.abs() < 0.05 && placed.agreeing == 1.0, "{placed:?}");
    }

    #[test]
    fn a_model_that_lies_elsewhere_is_moved_there() {
        let map = found((4, -6), 3.5, |_| true);
        let placed = boxes().placed(&map, 1, 0.5).unwrap();
        let expected = boxes().moved(Shift { x: 4, y: -6, height_m: 3.5, agreeing: 1.0 });
        let same = |(a, b): (&f32, &f32)| a == b || a.is_nan() && b.is_nan();
        assert!(placed.height_m.data().iter().zip(expected.height_m.data()).all(same));
        assert_eq!(placed.object, expected.object);
        assert!(placed.differences(&map, 1).values().all(|all| *all == [0.0; 81]));
    }

    #[test]
    fn the_place_of_a_model_is_found_by_the_building_that_is_right() {
        let map = found((0, 0), 0.0, |number| number == 1);
        let placed = boxes().placed(&map, 1, 0.5).unwrap();
        let differences = placed.differences(&map, 1);
        assert_eq!((&differences[&1][..], &differences[&2][..]), (&[0.0; 81][..], &[-20.0; 81][..]));
        let without = placed.without(&BTreeSet::from([2]));
        let kept = |number| without.object.data().iter().filter(|o| **o == number).count();
        assert_eq!((kept(1), kept(2)), (18 * 18, 0));
    }

    #[test]
    fn coarse_heights_are_those_of_the_middle() {
        let height_m = Grid::from_vec(5, 4, (0..20).map(|i| i as f32).collect()).unwrap();
        let prior = ViewPrior { object: height_m.map(|_| 1), height_m, gsd_m: 0.5 };
        assert_eq!(prior.at_level(1, (2, 2), [0.0; 2]).data(), [6.0, 8.0, 16.0, 18.0]);
        assert_eq!(prior.at_level(0, (5, 4), [0.0; 2]), prior.height_m);
        assert_eq!(prior.at_level(2, (1, 1), [0.0; 2]).data(), [12.0]);
        assert_eq!(prior.at_level(1, (2, 2), [0.5, 0.0]).data(), [7.0, 9.0, 17.0, 19.0]);
    }
}
