//! Heights known beforehand, such as a city model seen from a view: the prior of GS4Buildings,
//! carried to the height sweep.
//!
//! The prior is a hint. It widens the search, makes its heights a little cheaper, and makes jumps
//! cheap at its edges. Where the images clearly show another height, that one wins.

use raster::{Grid, Window};

use crate::cost::COST_MAX;
use crate::ranges::Ranges;

/// Reduction of the cost at the prior's height, a tenth of [`crate::cost::COST_MAX`]. Where the
/// image has texture it still decides: a building in the prior that does not exist leaves no trace
/// (`tests/dsm/prior.rs`).
const FAVOUR: f32 = 11.0;
/// Smallest deviation of the prior, in steps of the search. A step is half a pixel of parallax.
const STEPS: f64 = 2.0;
/// Reach of a patch whose costs are averaged, and the blur of an edge, pixels.
const PATCH_REACH: usize = 3;
/// Neighbours whose prior heights differ by more steps than this belong to two surfaces.
const JUMP_STEPS: f32 = 4.0;

/// Prior heights of a view on one level.
///
/// ```
/// use raster::Grid;
/// use sweep::Prior;
/// use sweep::ranges::Ranges;
///
/// let roof_m = Grid::filled(8, 8, 30.0f32);
/// let prior = Prior { height_m: &roof_m, deviation_m: 0.5 };
/// let ground = Ranges::uniform(8, 8, 1.0, (0.0, 5.0));
/// let widened = prior.widened(ground);
/// assert_eq!((widened.low[(3, 3)], widened.count[(3, 3)]), (0, 33));
/// ```
#[derive(Debug, Clone, Copy)]
pub struct Prior<'a> {
    /// Height of every pixel of the level, metres above the ellipsoid; NaN where unknown.
    pub height_m: &'a Grid<f32>,
    /// Standard deviation of the heights, metres.
    pub deviation_m: f64,
}

impl Prior<'_> {
    /// Returns half the width of the heights that are searched and favoured, metres.
    fn reach_m(&self, step_m: f64) -> f64 {
        (STEPS * step_m).max(2.0 * self.deviation_m)
    }

    /// Widens the ranges of the search to include the heights around the prior.
    #[must_use]
    pub fn widened(&self, mut ranges: Ranges) -> Ranges {
        let reach_m = self.reach_m(ranges.step_m);
        let spans = ranges.low.data_mut().iter_mut().zip(ranges.count.data_mut());
        for ((low, count), prior) in spans.zip(self.height_m.data()).filter(|(_, prior)| prior.is_finite()) {
            let lattice = |height_m: f64| (height_m / ranges.step_m).round() as i32;
            let first = lattice(f64::from(*prior) - reach_m).min(*low);
            let last = lattice(f64::from(*prior) + reach_m).max(*low + i32::from(*count) - 1);
            // A prior that is off by tens of thousands of steps is ignored.
            if let Ok(all) = u16::try_from(last - first + 1) {
                (*low, *count) = (first, all);
            }
        }
        ranges
    }

    /// Lowers the costs of the heights around the prior. Beside its surfaces their heights become
    /// as much more expensive: a patch that holds a roof's edge sees the roof outside it, too.
    pub(crate) fn favour(&self, window: Window, step_m: f64, low: &[i32], offsets: &[u32], costs: &mut [u8]) {
        let reach = (self.reach_m(step_m) / step_m) as f32;
        for (pixel, low) in low.iter().enumerate() {
            let at = place(window, pixel);
            let (prior, is_own) = match self.height_m[at] {
                own if own.is_nan() => (self.highest_beside(at), false),
                own => (own, true),
            };
            if prior.is_nan() {
                continue;
            }
            let middle = (f64::from(prior) / step_m - f64::from(*low)) as f32;
            for (k, cost) in costs[offsets[pixel] as usize..offsets[pixel + 1] as usize].iter_mut().enumerate() {
                let change = (FAVOUR * (1.0 - (k as f32 - middle).abs() / reach).max(0.0)) as u8;
                *cost = if is_own { cost.saturating_sub(change) } else { (*cost + change).min(COST_MAX) };
            }
        }
    }

    /// Returns the greatest prior height within the reach of a patch, metres; NaN if there is none.
    fn highest_beside(&self, (x, y): (usize, usize)) -> f32 {
        let span = |at: usize, end: usize| at.saturating_sub(PATCH_REACH)..(at + PATCH_REACH + 1).min(end);
        let (columns, rows) = (span(x, self.height_m.width()), span(y, self.height_m.height()));
        rows.flat_map(|v| &self.height_m.row(v)[columns.clone()]).copied().fold(f32::NAN, f32::max)
    }

    /// Marks the pixels where the prior's surfaces end as image edges.
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

/// Returns the column and row in the image of a window's pixel.
fn place(window: Window, pixel: usize) -> (usize, usize) {
    (window.x as usize + pixel % window.width, window.y as usize + pixel / window.width)
}
