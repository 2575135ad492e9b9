//! Bare ground under a surface model, used to measure the objects on it.
//!
//! From cells known to be ground, the rest is filled by the pull-push scheme of Gortler et al.
//! (1996, SIGGRAPH): each coarser level of a pyramid holds the mean of the ground cells below it,
//! and open cells take the bilinear value of the next coarser level.
//!
//! Without a classification, ground is found by a progressive morphological filter (Zhang et al.
//! 2003, IEEE TGRS 41, 872-882). The surface is opened with windows that double up to [`WINDOW_M`]
//! or a quarter of the area's shorter side. A cell is not ground if an opening lowers it by more
//! than `0.5 m + slope · growth of the window`. The slope is estimated from the scene: the upper
//! quartile of the slopes of the lowest heights of blocks half as wide as the largest window,
//! limited to 2 to 100 %. The result is an estimate; a terrain model is better.

use crate::alignment::align::MetresFromCells;
use crate::alignment::resample::bilinear;
use crate::measures::gradient::{gradients, steepness};
use numeric::percentile;
use raster::{Grid, opened};
use serde::Serialize;

/// Width of the largest window, metres. Wider structures count as ground.
pub const WINDOW_M: f64 = 80.0;
/// Amount by which an opening may lower level ground, metres.
const TOLERANCE_M: f64 = 0.5;
/// Bounds of the scene's slope, metres per metre.
const SLOPES: std::ops::RangeInclusive<f64> = 0.02..=1.0;

/// Source of the terrain.
#[derive(Debug, Clone, Copy, PartialEq, Serialize)]
#[serde(rename_all = "kebab-case", tag = "source")]
#[non_exhaustive]
pub enum TerrainSource {
    /// Terrain model that was given.
    Given,
    /// Heights of the reference at cells of the ground class, interpolated elsewhere.
    GroundClass {
        /// Number of ground cells.
        cells: usize,
    },
    /// Morphological estimate from the reference.
    Estimated {
        /// Width of the largest window, metres.
        window_m: f64,
        /// Slope of the ground that the filter allows, metres per metre.
        slope: f64,
    },
}

/// Returns the terrain through the heights of ground cells, filled between and beyond them. It is
/// void everywhere if there are none.
pub fn terrain_from_ground(heights: &Grid<f32>, is_ground: impl Fn(usize) -> bool) -> Grid<f32> {
    let cells = heights.data().iter().enumerate();
    let ground = cells.map(|(i, &h)| if is_ground(i) { h } else { f32::NAN }).collect();
    Grid::from_vec(heights.width(), heights.height(), ground).map_or_else(|| Grid::filled(0, 0, 0.0), filled)
}

/// Estimates the terrain from a surface alone.
pub fn estimated_terrain(heights: &Grid<f32>, metres_from_cells: MetresFromCells) -> (Grid<f32>, TerrainSource) {
    let (along_columns, along_rows) = metres_from_cells.cell_size_m();
    let cell_m = along_columns.max(along_rows);
    let side_m = (heights.width() as f64 * along_columns).min(heights.height() as f64 * along_rows);
    let widest = ((0.5 * WINDOW_M.min(side_m / 4.0) / cell_m) as usize).max(1);
    let slope = scene_slope(heights, metres_from_cells, widest);
    let mut open = heights.clone();
    let mut ground: Vec<bool> = heights.data().iter().map(|h| h.is_finite()).collect();
    let (mut radius, mut before) = (1, 0);
    while before < widest {
        let next = opened(&open, radius);
        let allowed = TOLERANCE_M + slope * 2.0 * (radius - before) as f64 * cell_m;
        for (ground, (from, to)) in ground.iter_mut().zip(open.data().iter().zip(next.data())) {
            *ground &= f64::from(from - to) <= allowed;
        }
        (open, before) = (next, radius);
        radius = (2 * radius).min(widest);
    }
    let source = TerrainSource::Estimated { window_m: (2 * widest + 1) as f64 * cell_m, slope };
    (terrain_from_ground(heights, |i| ground.get(i).copied().unwrap_or(false)), source)
}

/// Returns the upper quartile of the slopes of the lowest heights of blocks, which are half as wide
/// as the largest window.
fn scene_slope(heights: &Grid<f32>, metres_from_cells: MetresFromCells, block: usize) -> f64 {
    let (columns, rows) = (heights.width().div_ceil(block), heights.height().div_ceil(block));
    let mut lowest = Grid::filled(columns, rows, f32::NAN);
    for row in 0..heights.height() {
        for (column, &h) in heights.row(row).iter().enumerate() {
            let low = &mut lowest[(column / block, row / block)];
            *low = low.min(h);
        }
    }
    let mut slopes: Vec<f64> = gradients(&lowest, metres_from_cells)
        .data()
        .iter()
        .map(|&g| steepness(g) / block as f64)
        .filter(|s| s.is_finite())
        .collect();
    percentile(&mut slopes, 75.0).unwrap_or(0.0).clamp(*SLOPES.start(), *SLOPES.end())
}

/// Fills every void from its surroundings. Returns the grid unchanged if all is void.
fn filled(fine: Grid<f32>) -> Grid<f32> {
    if fine.data().iter().all(|h| h.is_finite()) || fine.width().max(fine.height()) < 2 {
        return fine;
    }
    let coarse = filled(halved(&fine));
    let mut full = fine;
    for row in 0..full.height() {
        for (column, cell) in full.row_mut(row).iter_mut().enumerate().filter(|(_, h)| !h.is_finite()) {
            let half = |position: usize, count: usize| {
                ((position as f64 + 0.5) / 2.0 - 0.5).clamp(0.0, count.saturating_sub(1) as f64)
            };
            let (x, y) = (half(column, coarse.width()), half(row, coarse.height()));
            *cell = bilinear(&coarse, x, y).map_or(f32::NAN, |h| h as f32);
        }
    }
    full
}

/// Reduces the grid by two: each cell is the mean of the valid ones among four.
fn halved(fine: &Grid<f32>) -> Grid<f32> {
    let mut coarse = Grid::filled(fine.width().div_ceil(2), fine.height().div_ceil(2), f32::NAN);
    for row in 0..coarse.height() {
        for (column, cell) in coarse.row_mut(row).iter_mut().enumerate() {
            let four = [(0, 0), (1, 0), (0, 1), (1, 1)].map(|(c, r)| fine.get(2 * column + c, 2 * row + r));
            let valid = || four.iter().copied().flatten().filter(|h| h.is_finite()).map(|&h| f64::from(h));
            *cell = (valid().sum::<f64>() / valid().count() as f64) as f32;
        }
    }
    coarse
}

#[cfg(test)]
mod tests {
    use super::*;
    use raster::GeoTransform;

    fn metres() -> MetresFromCells {
        MetresFromCells::new(&GeoTransform::north_up(0.0, 0.0, 1.0), (1.0, 1.0))
    }

    /// Returns hills on a slope.
    fn ground(column: usize, row: usize, slope: f64) -> f64 {
        50.0 + slope * column as f64 + 2.0 * (row as f64 / 40.0).sin() + 3.0 * (column as f64 / 55.0).cos()
    }

    /// Returns buildings of 12 × 20 m with 7 m walls, 30 m apart, on a slope.
    fn hillside_town(slope: f64) -> Grid<f32> {
        let cell = |i: usize| {
            let (column, row) = (i % 240, i / 240);
            let built = column % 30 < 12 && row % 34 < 20;
            (ground(column, row, slope) + if built { 7.0 } else { 0.0 }) as f32
        };
        Grid::from_vec(240, 200, (0..240 * 200).map(cell).collect()).unwrap()
    }

    #[test]
    fn buildings_are_taken_from_flat_and_from_sloping_ground() {
        for slope in [0.0, 0.15] {
            let (terrain, source) = estimated_terrain(&hillside_town(slope), metres());
            let mut errors: Vec<f64> = (0..240 * 200)
                .map(|i| (f64::from(terrain.data()[i]) - ground(i % 240, i / 240, slope)).abs())
                .collect();
            let (median, le90) = (percentile(&mut errors, 50.0).unwrap(), percentile(&mut errors, 90.0).unwrap());
            assert!(median < 0.1 && le90 < 1.0, "{slope}: median {median}, LE90 {le90}, {source:?}");
        }
    }

    #[test]
    fn ground_cells_are_kept_and_the_rest_lies_between_them() {
        let town = hillside_town(0.1);
        let terrain = terrain_from_ground(&town, |i| !(i % 240 % 30 < 12 && i / 240 % 34 < 20));
        assert_eq!(terrain[(20, 5)], town[(20, 5)]);
        let error = f64::from(terrain[(36, 10)]) - ground(36, 10, 0.1);
        assert!(error.abs() < 0.5, "{error}");
        assert!(terrain_from_ground(&town, |_| false).data().iter().all(|h| h.is_nan()));
        assert!(terrain_from_ground(&town, |i| i == 777).data().iter().all(|&h| h == town.data()[777]));
    }
}
