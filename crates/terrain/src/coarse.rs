//! Cells of about a metre on which objects are searched, and simple filters on them.

use raster::Grid;
use rayon::prelude::*;

/// Half-width over which a ground is smoothed, twice, before its slope is taken, metres.
const SLOPE_HALF_WIDTH_M: f64 = 5.0;

/// Returns the lower median of the known heights of blocks of `side × side` cells.
pub(crate) fn blocks(fine: &Grid<f32>, side: usize) -> Grid<f32> {
    if side == 1 {
        return fine.map(|&h| if h.is_finite() { h } else { f32::NAN });
    }
    let (width, height) = (fine.width().div_ceil(side), fine.height().div_ceil(side));
    let mut coarse = Grid::filled(width, height, f32::NAN);
    let mut values = Vec::with_capacity(side * side);
    for row in 0..height {
        for column in 0..width {
            values.clear();
            for y in row * side..((row + 1) * side).min(fine.height()) {
                let cells = &fine.row(y)[column * side..((column + 1) * side).min(fine.width())];
                values.extend(cells.iter().filter(|h| h.is_finite()));
            }
            values.sort_unstable_by(f32::total_cmp);
            if let Some(last) = values.len().checked_sub(1) {
                coarse[(column, row)] = values[last / 2];
            }
        }
    }
    coarse
}

/// Interpolates a raster of blocks of `side × side` cells at all cells of the raster of this width
/// and height that it was made of.
pub(crate) fn spread(coarse: &Grid<f32>, side: usize, (width, height): (usize, usize)) -> Grid<f32> {
    let columns: Vec<Place> = (0..width).map(|column| Place::of(column, side, coarse.width())).collect();
    let mut out = Grid::filled(width, height, f32::NAN);
    out.data_mut().par_chunks_mut(width.max(1)).enumerate().for_each(|(row, line)| {
        let row = Place::of(row, side, coarse.height());
        line.iter_mut().zip(&columns).for_each(|(height, column)| *height = between(coarse, *column, row));
    });
    out
}

/// Place of a cell between the centres of two blocks, along columns or rows.
#[derive(Clone, Copy)]
struct Place {
    low: usize,
    next: usize,
    /// Distance from the centre of the block `low`, in blocks. Half a block beyond the outer
    /// centres the slope goes on.
    part: f32,
}

impl Place {
    fn of(at: usize, side: usize, count: usize) -> Self {
        let position = (at as f32 + 0.5) / side as f32 - 0.5;
        let low = (position.max(0.0) as usize).min(count.saturating_sub(2));
        Self { low, next: (low + 1).min(count - 1), part: position - low as f32 }
    }
}

/// Interpolates between the centres of four blocks.
fn between(coarse: &Grid<f32>, column: Place, row: Place) -> f32 {
    let along = |line: &[f32]| line[column.low] + column.part * (line[column.next] - line[column.low]);
    let (low, next) = (along(coarse.row(row.low)), along(coarse.row(row.next)));
    low + row.part * (next - low)
}

/// Returns the weighted means of the known heights of `side` × `side` cells, and the means of the
/// weights, in which unknown cells count as 0.
pub(crate) fn weighted_blocks(
    heights: &Grid<f32>,
    side: usize,
    weight: impl Fn(usize) -> f32,
) -> (Grid<f32>, Grid<f32>) {
    let (width, height) = (heights.width(), heights.height());
    let (columns, rows) = (width.div_ceil(side), height.div_ceil(side));
    let (mut means, mut weights) = (Grid::filled(columns, rows, f32::NAN), Grid::filled(columns, rows, 0.0));
    for row in 0..rows {
        for column in 0..columns {
            let (mut sum, mut total) = (0.0_f64, 0.0_f64);
            for y in row * side..(row * side + side).min(height) {
                for at in y * width + column * side..y * width + (column * side + side).min(width) {
                    let own = heights.data()[at];
                    if !own.is_nan() {
                        let weight = f64::from(weight(at));
                        sum += weight * f64::from(own);
                        total += weight;
                    }
                }
            }
            if total > 0.0 {
                means[(column, row)] = (sum / total) as f32;
                weights[(column, row)] = (total / (side * side) as f64) as f32;
            }
        }
    }
    (means, weights)
}

/// Returns the means over windows of `2·radius + 1` cells, cut at the borders.
pub(crate) fn blurred(grid: &Grid<f32>, radius: usize) -> Grid<f32> {
    let (width, height) = (grid.width(), grid.height());
    let mut along_rows = grid.clone();
    for row in 0..height {
        running_mean(grid.row(row), radius, |column, mean| along_rows[(column, row)] = mean);
    }
    let mut out = along_rows.clone();
    let mut line = vec![0.0; height];
    for column in 0..width {
        (0..height).for_each(|row| line[row] = along_rows[(column, row)]);
        running_mean(&line, radius, |row, mean| out[(column, row)] = mean);
    }
    out
}

fn running_mean(line: &[f32], radius: usize, mut put: impl FnMut(usize, f32)) {
    let mut sum = 0.0_f64;
    let (mut start, mut end) = (0, 0);
    for at in 0..line.len() {
        while end < (at + radius + 1).min(line.len()) {
            sum += f64::from(line[end]);
            end += 1;
        }
        while start + radius < at {
            sum -= f64::from(line[start]);
            start += 1;
        }
        put(at, (sum / (end - start) as f64) as f32);
    }
}

/// One surface above another.
pub(crate) fn difference(upper: &Grid<f32>, lower: &Grid<f32>) -> Grid<f32> {
    upper.zip_map(lower, |upper, lower| upper - lower)
}

/// Returns the slope of a surface without voids at each cell, as height per distance.
pub(crate) fn slopes(surface: &Grid<f32>, cell_m: f64) -> Grid<f32> {
    let (width, height) = (surface.width(), surface.height());
    let mut out = surface.clone();
    for row in 0..height {
        for column in 0..width {
            let (left, right) = (column.saturating_sub(1), (column + 1).min(width - 1));
            let (up, down) = (row.saturating_sub(1), (row + 1).min(height - 1));
            let along = (surface[(right, row)] - surface[(left, row)]) / (right - left).max(1) as f32;
            let across = (surface[(column, down)] - surface[(column, up)]) / (down - up).max(1) as f32;
            out[(column, row)] = along.hypot(across) / cell_m as f32;
        }
    }
    out
}

/// Returns the slope of banks and quarries, not of walls, in a ground without voids.
pub(crate) fn smooth_slopes(ground: &Grid<f32>, cell_m: f64) -> Grid<f32> {
    let radius = (SLOPE_HALF_WIDTH_M / cell_m).round() as usize;
    slopes(&blurred(&blurred(ground, radius), radius), cell_m)
}

/// Returns the heights with the cells of a mask as voids.
pub(crate) fn without_cells(heights: &Grid<f32>, mask: &Grid<bool>) -> Grid<f32> {
    heights.without(|at| mask.data()[at])
}

/// Adds the cells of one mask to another.
pub(crate) fn add(mask: &mut Grid<bool>, other: &Grid<bool>) {
    mask.data_mut().iter_mut().zip(other.data()).for_each(|(cell, other)| *cell |= other);
}

/// Widens a mask by squares of `2·radius + 1` cells.
pub(crate) fn widened(mask: &Grid<bool>, radius: usize) -> Grid<bool> {
    let shares = blurred(&mask.map(|&set| if set { 1.0 } else { 0.0 }), radius);
    // The smallest share of one cell in the largest window is far above the rounding.
    let least = 0.5 / ((2 * radius + 1) as f32).powi(2);
    shares.map(|&share| share > least)
}

/// Returns the distance of each cell to the nearest known cell, metres, by steps of 1 and √2 cells.
pub(crate) fn distances_m(known: &Grid<f32>, cell_m: f64) -> Grid<f32> {
    cones(&known.map(|h| if h.is_nan() { f32::NAN } else { 0.0 }), cell_m as f32)
}

/// Returns the lowest of the cones that open upwards from the known heights and rise by `rise_m`
/// from one cell to the next, by steps of 1 and √2 cells; +∞ without any height.
pub(crate) fn cones(known: &Grid<f32>, rise_m: f32) -> Grid<f32> {
    let (width, height) = (known.width(), known.height());
    let (straight, slanted) = (rise_m, rise_m * std::f32::consts::SQRT_2);
    let mut out = known.map(|h| if h.is_nan() { f32::INFINITY } else { *h });
    for row in 0..height {
        for column in 0..width {
            let mut least = out[(column, row)];
            if column > 0 {
                least = least.min(out[(column - 1, row)] + straight);
            }
            if row > 0 {
                least = least.min(out[(column, row - 1)] + straight);
                if column > 0 {
                    least = least.min(out[(column - 1, row - 1)] + slanted);
                }
                if column + 1 < width {
                    least = least.min(out[(column + 1, row - 1)] + slanted);
                }
            }
            out[(column, row)] = least;
        }
    }
    for row in (0..height).rev() {
        for column in (0..width).rev() {
            let mut least = out[(column, row)];
            if column + 1 < width {
                least = least.min(out[(column + 1, row)] + straight);
            }
            if row + 1 < height {
                least = least.min(out[(column, row + 1)] + straight);
                if column + 1 < width {
                    least = least.min(out[(column + 1, row + 1)] + slanted);
                }
                if column > 0 {
                    least = least.min(out[(column - 1, row + 1)] + slanted);
                }
            }
            out[(column, row)] = least;
        }
    }
    out
}
