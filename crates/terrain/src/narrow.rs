//! Narrow objects by the progressive filter of Pingel et al. (2013,
//! <https://doi.org/10.1016/j.isprsjprs.2012.12.002>): the surface is opened with windows that grow
//! by one cell, each time the surface that the last window left. What vanishes at once is an
//! object; a hill melts away by little in every step.
//!
//! Steep ground loses more in each step. So the slope that a window may cut off grows by half of
//! the slope of the ground as far as it is known.

use raster::{Grid, opened};

use crate::config::{GroundConfig, NOISE_DEVIATIONS};
use crate::heights::Heights;

/// Half-width of the widest window, metres: the value of Pingel et al., for houses and trees. What
/// is wider is judged by its border, because hills are as wide.
pub(crate) const NARROW_M: f64 = 18.0;
/// Least height that one step may take, metres: low grass and the steps of quantised heights.
const STEP_M: f64 = 0.15;
/// Share of the slope of the ground that is added to that of the windows. 0 loses the edges of
/// quarries, 1 keeps shrubs on steep slopes.
const SLOPE_SHARE: f32 = 0.5;

/// How fast each cell vanishes under the growing windows. It depends on the heights alone, so all
/// trends of a search use the same.
pub(crate) struct Vanishing {
    /// Largest slope that a window has cut off at each cell: the height that the window took, less
    /// the height that any step may take, divided by its half-width.
    slopes: Grid<f32>,
}

impl Vanishing {
    pub(crate) fn of(heights: &Heights<'_>, config: &GroundConfig) -> Self {
        let mut slopes = heights.whole.map(|_| f32::NEG_INFINITY);
        let mut last = heights.whole.clone();
        let least_m = STEP_M.max(NOISE_DEVIATIONS * heights.noise_m) as f32;
        let widest_m = NARROW_M.min(0.5 * config.widest_object_m);
        for radius in 1..=((widest_m / heights.cell_m).floor().max(1.0) as usize) {
            let low = opened(&last, radius);
            let half_width_m = (radius as f64 * heights.cell_m) as f32;
            let taken_m = last.data().iter().zip(low.data()).map(|(last, low)| last - low);
            for (slope, taken_m) in slopes.data_mut().iter_mut().zip(taken_m) {
                *slope = slope.max((taken_m - least_m) / half_width_m);
            }
            last = low;
        }
        Self { slopes }
    }

    /// Returns the cells of narrow objects; `slope` is that of the ground as far as it is known.
    pub(crate) fn objects(&self, slope: &Grid<f32>, config: &GroundConfig) -> Grid<bool> {
        let allowed = config.slope as f32;
        self.slopes.zip_map(slope, |cut_off, slope| *cut_off > allowed + SLOPE_SHARE * slope)
    }
}
