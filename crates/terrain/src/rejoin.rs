//! Ground that the search for objects took away joins again, as in the densification of Axelsson
//! (2000): cells that lie at the ground expected from those around them. The height above it that
//! is taken for ground grows with its slope, as in Pingel et al. (2013).

use raster::Grid;

use crate::coarse::{blurred, slopes};
use crate::config::NOISE_DEVIATIONS;
use crate::plate::plate;

/// Distance from the expected ground within which a cell is ground, metres, where it is flat.
const LEVEL_M: f64 = 0.5;
/// Growth of that distance with the slope, metres; both are the values of Pingel et al.
const PER_SLOPE_M: f32 = 1.25;
/// Steepest slope that counts: the ramp of a wall in a surface from images is steeper.
const STEEPEST: f32 = 1.0;
/// Half-width over which the slope is measured, metres: more than the ramp of a wall.
const SLOPE_HALF_WIDTH_M: f64 = 2.0;
/// Rounds. Each carries the ground a few cells further up a bank; more of them climb onto roofs.
const ROUNDS: usize = 4;

/// Returns the ground with the cells of the surface that lie at it.
pub(crate) fn rejoined(surface: &Grid<f32>, mut ground: Grid<f32>, cell_m: f64, noise_m: f64) -> Grid<f32> {
    let level_m = level_m(noise_m);
    for _ in 0..ROUNDS {
        let expected = plate(&ground, cell_m, noise_m);
        let growth_m = growth_m(&expected, cell_m);
        let mut has_grown = false;
        for (at, cell) in ground.data_mut().iter_mut().enumerate().filter(|(_, cell)| cell.is_nan()) {
            let reach_m = level_m + growth_m.data()[at];
            if (surface.data()[at] - expected.data()[at]).abs() <= reach_m {
                *cell = surface.data()[at];
                has_grown = true;
            }
        }
        if !has_grown {
            break;
        }
    }
    ground
}

/// Returns the distance from the expected ground within which a cell is ground where it is flat,
/// metres.
pub(crate) fn level_m(noise_m: f64) -> f32 {
    LEVEL_M.max(NOISE_DEVIATIONS * noise_m) as f32
}

/// Returns the growth of that distance by the slope of the expected ground, metres.
pub(crate) fn growth_m(expected: &Grid<f32>, cell_m: f64) -> Grid<f32> {
    let radius = (SLOPE_HALF_WIDTH_M / cell_m).round() as usize;
    slopes(&blurred(expected, radius), cell_m).map(|slope| growth_by_m(*slope))
}

/// Returns the growth of that distance by a slope, metres.
pub(crate) fn growth_by_m(slope: f32) -> f32 {
    PER_SLOPE_M * slope.min(STEEPEST)
}
