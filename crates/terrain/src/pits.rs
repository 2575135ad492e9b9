//! Pits: places below the ground, where an instrument or the matching of images has erred.
//!
//! A gap between crowns and a yard between roofs lie deep, too. They lie at the ground, and a pit
//! lies below it: many cells around agree with the level of a gap, and hardly any with that
//! of a pit. And the rim of a pit, the ground, is even, whereas crowns and roofs differ in height.

use raster::{Grid, highest, lowest};

use crate::coarse::{add, difference, without_cells};
use crate::regions::{Regions, quantile};

/// Half-widths of the windows that find what lies deep, metres: single cells, then patches.
const HALF_WIDTHS_M: [f64; 2] = [3.0, 9.0];
/// Spacing of the cells around that are asked, metres.
const SPACING_M: f64 = 3.0;
/// Distance within which they do, metres: the half-width of the planes of the trend.
const REACH_M: f64 = 50.0;
/// Share of the cells around from which a level is confirmed: the yards of the densest towns.
const CONFIRMED_SHARE: f64 = 0.04;
/// Width of the rim of a pit, metres.
const RIM_M: f64 = 3.0;
/// Spread of the heights of the rim of a pit, as a share of its depth.
const RIM_SHARE: f32 = 0.5;
/// Least depth of a pit, metres: more than kerbs and ditches.
const DEPTH_M: f64 = 1.5;
/// Least depth of a pit in deviations of the noise: its bottom and its rim have noise.
const DEPTH_DEVIATIONS: f64 = 6.0;

/// Returns the cells of pits; `trend` is that of the surface.
pub(crate) fn pits(surface: &Grid<f32>, trend: &Grid<f32>, cell_m: f64, noise_m: f64) -> Grid<bool> {
    let depth_m = depth_m(noise_m);
    let mut is_pit = surface.map(|_| false);
    for half_width_m in HALF_WIDTHS_M {
        let radius = (half_width_m / cell_m).round() as usize;
        if radius == 0 {
            continue;
        }
        let level = difference(&without_cells(surface, &is_pit), trend);
        let deep = difference(&closed(&level, radius), &level).map(|depth| *depth > depth_m);
        let regions = Regions::of(&deep);
        let most = (2.0 * half_width_m).powi(2) / (cell_m * cell_m);
        let found = regions.mask(|region| {
            regions.cells(region).len() as f64 <= most && !is_confirmed(&level, &regions, region, depth_m, cell_m)
        });
        add(&mut is_pit, &found);
    }
    is_pit
}

/// Returns the least depth of a pit in a surface with noise, metres.
pub(crate) fn depth_m(noise_m: f64) -> f32 {
    DEPTH_M.max(DEPTH_DEVIATIONS * noise_m) as f32
}

/// Closes a surface: what is narrower than the window and lies deep is filled. Windows lie around
/// cells with heights: one around a void beyond them would hold nothing but a pit at their border.
fn closed(level: &Grid<f32>, radius: usize) -> Grid<f32> {
    let mut high = highest(level, radius);
    high.void_where(|at| level.data()[at].is_nan());
    lowest(&high, radius)
}

/// Whether other cells around a region lie at its level, or its rim is uneven.
fn is_confirmed(level: &Grid<f32>, regions: &Regions, region: usize, depth_m: f32, cell_m: f64) -> bool {
    let Some(own) = regions.median(region, |cell| level.data()[cell]) else { return true };
    // Crowns and roofs around a gap differ in height; the ground around a pit does not.
    let steps = |metres: f64| ((metres / cell_m).round() as usize).max(1);
    let rim = regions.around(region, steps(RIM_M)).filter(|&cell| !regions.is_any(cell));
    let mut rim: Vec<f32> = rim.map(|cell| level.data()[cell as usize]).filter(|height| !height.is_nan()).collect();
    let Some(middle_m) = quantile(&mut rim, 0.5) else { return true };
    let spread_m = quantile(&mut rim, 0.9).unwrap_or(0.0) - quantile(&mut rim, 0.1).unwrap_or(0.0);
    if spread_m > RIM_SHARE * (middle_m - own) {
        return true;
    }
    let (mut count, mut agree) = (0_u32, 0_u32);
    for height in heights_around(level, regions, region, cell_m) {
        count += 1;
        agree += u32::from((height - own).abs() <= depth_m);
    }
    f64::from(agree) >= CONFIRMED_SHARE * f64::from(count)
}

/// Returns the known heights of some cells around a region.
pub(crate) fn heights_around(
    heights: &Grid<f32>,
    regions: &Regions,
    region: usize,
    cell_m: f64,
) -> impl Iterator<Item = f32> {
    let steps = |metres: f64| ((metres / cell_m).round() as usize).max(1);
    let cells = regions.cells(region);
    let middle = cells[cells.len() / 2] as usize;
    let (width, height) = (heights.width(), heights.height());
    let (column, row) = (middle % width, middle / width);
    let (reach, spacing) = (steps(REACH_M), steps(SPACING_M));
    let rows = (row.saturating_sub(reach)..(row + reach + 1).min(height)).step_by(spacing);
    let columns = (column.saturating_sub(reach)..(column + reach + 1).min(width)).step_by(spacing);
    let places = rows.flat_map(move |y| columns.clone().map(move |x| y * width + x));
    let others = places.filter(move |at| !regions.holds(region, *at as u32));
    others.map(|at| heights.data()[at]).filter(|height| !height.is_nan())
}
