//! Height step and pyramid levels of the sweep.

use raster::Window;
use serde::{Deserialize, Serialize};

use crate::tuning::SweepTuning;
use crate::values::HeightRange;

/// The coarsest level keeps at least this many pixels on a side, or its aggregation has nothing to
/// work with.
const TOP_SIDE_MIN: usize = 48;
/// The pyramid of a view stops before a side falls below this, pixels; see
/// [`sweep::SweepView::new`].
const PYRAMID_SIDE_MIN: usize = 32;
/// Number of levels at which the pyramid of a view stops.
pub const PYRAMID_LEVELS_MAX: usize = 16;

/// Pyramid levels of a sweep; 0 is the full resolution.
#[derive(Debug, Clone, Copy, PartialEq, Eq, Serialize, Deserialize)]
#[serde(deny_unknown_fields)]
pub struct SweepLevels {
    /// Finest level, whose heights are the result.
    pub finest: usize,
    /// Coarsest level, which searches the whole height range.
    pub coarsest: usize,
}

impl SweepLevels {
    /// Returns the levels of a sweep of one level only.
    pub const fn only(level: usize) -> Self {
        Self { finest: level, coarsest: level }
    }

    /// Returns the number of levels.
    pub const fn count(self) -> usize {
        self.coarsest - self.finest + 1
    }
}

/// Returns the distance of two hypotheses at full resolution, metres. `widest` is the largest
/// parallax, pixels per metre.
pub fn height_step_m(widest: f64, tuning: &SweepTuning) -> f64 {
    tuning.step_px / widest.max(f64::MIN_POSITIVE)
}

/// Chooses the levels of a sweep of views. `sides` are the shortest sides of the views' levels, see
/// [`smallest_sides`].
pub fn choose_levels(range: HeightRange, step_m: f64, sides: &[usize], tuning: &SweepTuning) -> SweepLevels {
    let deepest = sides.iter().filter(|s| **s >= TOP_SIDE_MIN).count().saturating_sub(1);
    let too_many = |level: &usize| range.span_m() / (step_m * f64::from(1u32 << *level)) > tuning.top_hypotheses;
    let finest = tuning.finest_level.min(deepest);
    SweepLevels { finest, coarsest: (0..deepest).take_while(too_many).count().max(finest) }
}

/// Returns, for each pyramid level that the views of all windows have, the shortest side of any of
/// them, pixels.
///
/// The sizes follow from those of the windows, so that a plan can be made without the pixels.
pub fn smallest_sides<'a>(windows: impl IntoIterator<Item = &'a Window>) -> Vec<usize> {
    let Some(side) = windows.into_iter().map(|w| w.width.min(w.height)).min() else { return Vec::new() };
    let reduced = |side: &usize| Some(side.div_ceil(2)).filter(|s| *s >= PYRAMID_SIDE_MIN);
    std::iter::successors(Some(side), reduced).take(PYRAMID_LEVELS_MAX).collect()
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn sides_are_those_of_the_views() {
        let rpc = formats::rpc::read_for_image(std::path::Path::new(concat!(
            env!("CARGO_MANIFEST_DIR"),
            "/../../data-samples/town/view_1.tif"
        )));
        let camera = camera::RpcCamera::new(rpc.unwrap().rpc);
        for (width, height) in [(300, 201), (64, 65), (63, 900), (10, 12)] {
            let view = sweep::SweepView::new(camera.clone(), raster::Grid::filled(width, height, 1.0));
            let expected: Vec<usize> = view.levels.iter().map(|l| l.width().min(l.height())).collect();
            assert_eq!(smallest_sides(&[Window::whole(width, height)]), expected, "{width} × {height}");
        }
    }
}
