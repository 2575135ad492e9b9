//! The ground under forests.
//!
//! Near clearings the ground goes on as a plate. Far from any clearing, the canopy is the better
//! guide: the height of the tree tops changes much less from place to place than that of the
//! ground. The ground is there the smoothed surface of the tree tops, less the height that they
//! have beside clearings.
//!
//! Gaps between the crowns tell more, if they reach down to the ground. In surfaces made from
//! images many do not, and others are errors of the matching. So gaps are tried first beside
//! clearings, where the ground is known. If they show it, the lowest cells of the forest are
//! ground, and further cells join as in the progressive densification of Axelsson (2000).
//!
//! The constants were chosen on simulated hills (seeds 2 to 4, 300 m).

use raster::{Grid, highest, lowest};

use crate::coarse::{blurred, difference, distances_m, widened, without_cells};
use crate::plate::plate;
use crate::regions::{Regions, quantile};

/// Half-width of the surroundings whose highest cell is a tree top, metres: that of a crown.
const TOP_HALF_WIDTH_M: f64 = 4.0;
/// Half-width of the surroundings over which tree tops are smoothed, metres: several crowns.
const SMOOTH_HALF_WIDTH_M: f64 = 6.0;
/// Height above the ground from which a cell beside a clearing belongs to a crown, metres.
const CROWN_MIN_M: f32 = 2.0;
/// Distance from the ground up to which the plate tells the height of tree tops, metres.
const TRUSTED_M: f32 = 8.0;
/// Distance from the ground at which the plate and the tree tops count alike, metres. Ground with a
/// curvature of 0.05 1/m leaves its slope by 2 m on this way, as much as means of tree tops differ.
const EQUAL_M: f32 = 8.0;
/// Half-width of the surroundings of a clearing's border whose canopy is compared with it, metres.
const BESIDE_M: f64 = 3.0;
/// Least rise of the canopy along the border of a clearing, as a share of the usual rise.
const CLEARING_SHARE: f32 = 0.5;
/// Share of a clearing's border, as if it were a square, from which it lies within a forest.
const WITHIN_SHARE: f64 = 0.3;
/// Half-width of the surroundings whose lowest cell is the bottom of a gap, metres.
const GAP_HALF_WIDTH_M: f64 = 3.0;
/// Distances from a clearing at which gaps are tried, metres: the plate is certain there.
const GAP_TRIED_M: std::ops::Range<f32> = 2.0..5.0;
/// Difference from the plate up to which the gaps that are tried show the ground, metres.
const GAP_ERROR_M: f32 = 1.5;
/// Half-width of the surroundings whose lowest cell is the first ground of a forest, metres.
const SEED_HALF_WIDTH_M: f64 = 5.0;
/// Rounds of densification.
const ROUNDS: usize = 4;
/// Height above the expected ground up to which a cell is ground, metres: beside ground, its growth
/// with the distance from it, and its largest value.
const RISE_M: [f32; 3] = [0.4, 0.1, 1.5];
/// Least noise of the ground in gaps, metres: grass and bushes.
const GAP_NOISE_M: f64 = 0.03;

/// Returns the expected ground everywhere, and adds what shows in the forest to the known ground.
/// Clearings that are none are taken out of it.
pub(crate) fn under_forests(
    surface: &Grid<f32>,
    is_forest: &Grid<bool>,
    ground: &mut Grid<f32>,
    cell_m: f64,
    noise_m: f64,
) -> Grid<f32> {
    without_false_clearings(surface, is_forest, ground, cell_m);
    let plate_m = plate(ground, cell_m, noise_m);
    let forest = Forest { is_forest, above: crowns(surface, is_forest, &plate_m), cell_m };
    let distance = distances_m(ground, cell_m);
    let guided = forest.guided(plate_m, &distance);
    if !forest.has_deep_gaps(&distance) {
        return guided;
    }
    let above = crowns(surface, is_forest, &guided);
    let seeds = lowest(&above, forest.cells(SEED_HALF_WIDTH_M));
    let clear = ground.clone();
    for at in 0..surface.data().len() {
        if above.data()[at] <= seeds.data()[at] {
            ground.data_mut()[at] = surface.data()[at];
        }
    }
    let mut expected = plate(ground, cell_m, noise_m.max(GAP_NOISE_M));
    for _ in 1..ROUNDS {
        let distance = distances_m(ground, cell_m);
        ground.clone_from(&clear);
        for at in 0..surface.data().len() {
            let rise = (RISE_M[0] + RISE_M[1] * distance.data()[at]).min(RISE_M[2]);
            if is_forest.data()[at] && surface.data()[at] - expected.data()[at] <= rise {
                ground.data_mut()[at] = surface.data()[at];
            }
        }
        expected = plate(ground, cell_m, noise_m.max(GAP_NOISE_M));
    }
    expected
}

/// Takes smooth parts of the canopy and roofs in the forest out of the ground: the forest around
/// them does not stand above them as it does above most clearings.
fn without_false_clearings(surface: &Grid<f32>, is_forest: &Grid<bool>, ground: &mut Grid<f32>, cell_m: f64) {
    let canopy = smoothed(&without_cells(surface, &is_forest.map(|is| !is)), (BESIDE_M / cell_m).round() as usize);
    let is_beside = widened(is_forest, 1);
    let clearings = Regions::of(&ground.map(|h| !h.is_nan()));
    let rises = |cells: &[u32]| -> Vec<f32> {
        let border = cells.iter().map(|&cell| cell as usize).filter(|&at| is_beside.data()[at]);
        border.map(|at| canopy.data()[at] - surface.data()[at]).filter(|rise| !rise.is_nan()).collect()
    };
    let mut all: Vec<f32> = (0..clearings.len()).flat_map(|clearing| rises(clearings.cells(clearing))).collect();
    let Some(usual) = quantile(&mut all, 0.5) else { return };
    for clearing in 0..clearings.len() {
        let cells = clearings.cells(clearing);
        let mut rises = rises(cells);
        // Land that only touches a forest is judged by its other borders.
        let is_within = (rises.len() as f64) > WITHIN_SHARE * 4.0 * (cells.len() as f64).sqrt();
        let is_lower = quantile(&mut rises, 0.5).is_none_or(|rise| rise >= CLEARING_SHARE * usual);
        if is_within && !is_lower {
            cells.iter().for_each(|&cell| ground.data_mut()[cell as usize] = f32::NAN);
        }
    }
}

/// Returns the heights of the cells of forests above a surface, NaN elsewhere.
fn crowns(surface: &Grid<f32>, is_forest: &Grid<bool>, below: &Grid<f32>) -> Grid<f32> {
    without_cells(&difference(surface, below), &is_forest.map(|is| !is))
}

/// Forests above the plate through the clearings.
struct Forest<'a> {
    is_forest: &'a Grid<bool>,
    /// Heights above the plate, metres, NaN outside of forests.
    above: Grid<f32>,
    cell_m: f64,
}

impl Forest<'_> {
    fn cells(&self, metres: f64) -> usize {
        (metres / self.cell_m).round() as usize
    }

    /// Whether gaps beside clearings show the ground that the clearings show: eight of ten do.
    fn has_deep_gaps(&self, distance: &Grid<f32>) -> bool {
        let low = lowest(&self.above, self.cells(GAP_HALF_WIDTH_M));
        let is_tried = |at: &usize| GAP_TRIED_M.contains(&distance.data()[*at]);
        let tried = (0..low.data().len()).filter(is_tried).map(|at| low.data()[at]);
        let mut errors: Vec<f32> = tried.filter(|depth| !depth.is_nan()).collect();
        let mut is_small = |share| quantile(&mut errors, share).is_some_and(|error| error.abs() < GAP_ERROR_M);
        is_small(0.1) && is_small(0.9)
    }

    /// Moves the plate to where the tree tops say the ground is, the more the farther from ground.
    fn guided(&self, plate_m: Grid<f32>, distance: &Grid<f32>) -> Grid<f32> {
        let mut above = self.above.clone();
        for (above, &distance) in above.data_mut().iter_mut().zip(distance.data()) {
            // Far from the ground the plate may lie above the canopy.
            if *above <= CROWN_MIN_M && distance <= TRUSTED_M {
                *above = f32::NAN;
            }
        }
        let is_no_crown = above.map(|h| h.is_nan());
        let tops = without_cells(&highest(&above, self.cells(TOP_HALF_WIDTH_M)), &is_no_crown);
        let tops = smoothed(&tops, self.cells(SMOOTH_HALF_WIDTH_M));
        let beside = (0..tops.data().len()).filter(|&at| !is_no_crown.data()[at] && distance.data()[at] <= TRUSTED_M);
        let mut beside: Vec<f32> = beside.map(|at| tops.data()[at]).filter(|h| !h.is_nan()).collect();
        let Some(usual) = quantile(&mut beside, 0.5) else { return plate_m };
        let mut ground = plate_m;
        for (at, ground) in ground.data_mut().iter_mut().enumerate() {
            let correction = tops.data()[at] - usual;
            if self.is_forest.data()[at] && !correction.is_nan() {
                let ratio = (distance.data()[at] / EQUAL_M).powi(4);
                // Infinitely far from any ground the tree tops alone count.
                *ground += correction * if ratio.is_finite() { ratio / (1.0 + ratio) } else { 1.0 };
            }
        }
        ground
    }
}

/// Means of the known cells around each cell, twice, NaN where none is known.
fn smoothed(heights: &Grid<f32>, radius: usize) -> Grid<f32> {
    let twice = |grid: &Grid<f32>| blurred(&blurred(grid, radius), radius);
    let sum = twice(&heights.map(|h| if h.is_nan() { 0.0 } else { *h }));
    let count = twice(&heights.map(|h| if h.is_nan() { 0.0 } else { 1.0 }));
    sum.zip_map(&count, |sum, count| if *count > 1e-3 { sum / count } else { f32::NAN })
}
