//! Heights that something else than the images tells, as a city model seen from a view (GS4Buildings' prior, carried to the
//! height sweep): where to search, what to favour, where surfaces may end.
//!
//! The prior is a hint. It widens the search, makes its height cheaper by less than what texture tells, and makes jumps cheap
//! at its edges; where the images show another height well, that one wins.

use raster::{Grid, Window};

use crate::ranges::Ranges;

/// How much cheaper the prior's height is, of [`crate::cost::COST_MAX`]: a tenth, so that where the picture tells heights apart it still
/// decides (`tests/dsm_prior.rs`: a building too many does not show).
const FAVOUR: f32 = 11.0;
/// Steps of the search that the prior is off by at least: a step is half a pixel of parallax.
const STEPS: f64 = 2.0;
/// Prior heights of neighbours further apart than this many steps belong to two surfaces.
const JUMP_STEPS: f32 = 4.0;

/// Prior heights of a view on one level.
#[derive(Debug, Clone, Copy)]
pub struct Prior<'a> {
    /// Metres above the ellipsoid for every pixel of the level, NaN where nothing is known.
    pub height_m: &'a Grid<f32>,
    /// How far they may be off, metres.
    pub deviation_m: f64,
}

impl Prior<'_> {
    /// Half the width of what is searched and favoured, metres.
    fn reach_m(&self, step_m: f64) -> f64 {
        (STEPS * step_m).max(2.0 * self.deviation_m)
    }

    /// Adds the heights around the prior to what is searched.
    #[must_use]
    pub fn widened(&self, mut ranges: Ranges) -> Ranges {
        let reach_m = self.reach_m(ranges.step_m);
        let spans = ranges.low.data_mut().iter_mut().zip(ranges.count.data_mut());
        for ((low, count), prior) in spans.zip(self.height_m.data()).filter(|(_, prior)| prior.is_finite()) {
            let lattice = |height_m: f64| (height_m / ranges.step_m).round() as i32;
            let first = lattice(f64::from(*prior) - reach_m).min(*low);
            let last = lattice(f64::from(*prior) + reach_m).max(*low + i32::from(*count) - 1);
            // A prior that is off by thousands of steps is none.
            if let Ok(all) = u16::try_from(last - first + 1) {
                (*low, *count) = (first, all);
            }
        }
        ranges
    }

    /// Makes the heights around the prior cheaper.
    pub(crate) fn favour(&self, window: Window, step_m: f64, low: &[i32], offsets: &[u32], costs: &mut [u8]) {
        let reach = (self.reach_m(step_m) / step_m) as f32;
        for (pixel, low) in low.iter().enumerate() {
            let prior = self.height_m[place(window, pixel)];
            if prior.is_nan() {
                continue;
            }
            let middle = (f64::from(prior) / step_m - f64::from(*low)) as f32;
            for (k, cost) in costs[offsets[pixel] as usize..offsets[pixel + 1] as usize].iter_mut().enumerate() {
                let share = 1.0 - (k as f32 - middle).abs() / reach;
                *cost = cost.saturating_sub((FAVOUR * share.max(0.0)) as u8);
            }
        }
    }

    /// Marks where the prior's surfaces end.
    pub(crate) fn mark_edges(&self, window: Window, step_m: f64, edges: &mut [u8]) {
        let jump_m = JUMP_STEPS * step_m as f32;
        for (pixel, edge) in edges.iter_mut().enumerate() {
            let (x, y) = place(window, pixel);
            let own = self.height_m[(x, y)];
            let ends = |other: Option<&f32>| {
                other.is_some_and(|other| own.is_nan() != other.is_nan() || (own - other).abs() > jump_m)
            };
            if ends(self.height_m.get(x + 1, y)) || ends(self.height_m.get(x, y + 1)) {
                *edge = u8::MAX;
            }
        }
    }
}

/// Where a window's pixel is in the image.
fn place(window: Window, pixel: usize) -> (usize, usize) {
    (window.x as usize + pixel % window.width, window.y as usize + pixel / window.width)
}
