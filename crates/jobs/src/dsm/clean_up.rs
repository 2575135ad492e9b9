//! Clean-up of a fused surface: speckle is removed, voids are filled, and the confidence is
//! computed.
//!
//! Lengths are in metres, so that a result does not depend on the cell size more than it must.

use raster::{Grid, Window};
use sweep::fusion::{FillConfig, FusedSurface, fill_voids, reliability, remove_speckle};

use crate::dsm::config::Fill;

/// Isolated patches of less ground than a square of this side are speckle, metres: smaller than a
/// house.
const SPECKLE_SIDE_M: f64 = 5.0;
/// Patches of at least this many cells are never speckle, whatever the cell size.
const SPECKLE_CELLS_MIN: usize = 9;
/// Distance at which heights around a void are looked for, metres: the shadow side of a tower.
const FILL_REACH_M: f64 = 40.0;
/// Distance at which heights around a void are looked for where every void is to be closed, metres:
/// the middle of a pond or of a hall.
const FILL_REACH_ALL_M: f64 = 60.0;
/// Voids up to this wide are closed, whatever the images show there, metres: the shadow side of a
/// house.
const FILL_NARROW_M: f64 = 10.0;
/// A surface hides what is this many times its height away: views lean by up to 30°, and shadows
/// reach further.
const FILL_HIDDEN: f64 = 1.0;
/// Heights around a void that differ by more than this per metre between them are two surfaces:
/// steeper than streets.
const FILL_SLOPE: f64 = 0.05;

/// Number of cells after each step of the clean-up.
#[derive(Debug, Clone, Copy)]
pub(crate) struct Cleaned {
    /// Cells with an observed height.
    pub(crate) observed: usize,
    /// Cells removed as speckle.
    pub(crate) speckle_removed: usize,
}

/// Returns the width of the ground around a cell that decides its content, metres: speckle is
/// judged, then voids are filled from this far.
pub(crate) fn surroundings_m(fill: Fill) -> f64 {
    fill_reach_m(fill).unwrap_or(0.0) + 2.0 * SPECKLE_SIDE_M
}

/// Returns the distance at which heights around a void are looked for; `None` where voids stay.
fn fill_reach_m(fill: Fill) -> Option<f64> {
    match fill {
        Fill::None => None,
        Fill::Justified => Some(FILL_REACH_M),
        Fill::All => Some(FILL_REACH_ALL_M),
    }
}

/// Cleans a surface on cells of `gsd_m`; returns the mask of filled cells and the counts of `core`.
///
/// `step_m` is the distance of two hypotheses. `blind` marks the cells where the images have no
/// texture.
pub(crate) fn clean_up(
    fused: &mut FusedSurface,
    blind: &Grid<bool>,
    fill: Fill,
    step_m: f64,
    gsd_m: f64,
    core: Window,
) -> (Grid<bool>, Cleaned) {
    let before = known(&fused.height_m, core);
    let speckle_cells = ((SPECKLE_SIDE_M / gsd_m).powi(2) as usize).max(SPECKLE_CELLS_MIN);
    remove_speckle(&mut fused.height_m, (2.0 * step_m).max(2.0 * gsd_m) as f32, speckle_cells);
    let observed = known(&fused.height_m, core);
    let agreement = fused.confidence.data_mut().iter_mut().zip(fused.height_m.data());
    agreement.filter(|(_, h)| h.is_nan()).for_each(|(agreement, _)| *agreement = 0.0);
    let filled = match fill_config(fill, gsd_m) {
        Some(fill) => fill_voids(&mut fused.height_m, blind, &fill),
        None => fused.height_m.map(|_| false),
    };
    let reach = (0.5 * SPECKLE_SIDE_M / gsd_m).round().max(1.0) as usize;
    fused.confidence = reliability(&fused.height_m, &fused.confidence, reach, 2.0 * gsd_m);
    (filled, Cleaned { observed, speckle_removed: before - observed })
}

/// Returns the parameters of filling on cells of `gsd_m`; `None` where voids stay.
fn fill_config(fill: Fill, gsd_m: f64) -> Option<FillConfig> {
    let narrow_m = if fill == Fill::All { f64::INFINITY } else { FILL_NARROW_M };
    Some(FillConfig {
        reach_cells: (fill_reach_m(fill)? / gsd_m).ceil() as usize,
        narrow_cells: (narrow_m / gsd_m) as f32,
        island_cells: (FILL_NARROW_M / gsd_m).powi(2) as usize,
        hidden_cells_per_m: (FILL_HIDDEN / gsd_m) as f32,
        same_surface_m: (2.0 * gsd_m) as f32,
        slope_m: (FILL_SLOPE * gsd_m) as f32,
    })
}

/// Returns the number of cells of a window that have a height.
fn known(height_m: &Grid<f32>, core: Window) -> usize {
    let columns = core.x as usize..core.x as usize + core.width;
    let row = |y: usize| height_m.row(core.y as usize + y)[columns.clone()].iter().filter(|h| !h.is_nan()).count();
    (0..core.height).map(row).sum()
}
