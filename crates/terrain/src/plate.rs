//! A thin plate under tension through known heights that are uncertain: it goes on with the slope
//! of the ground where a membrane would sag.
//!
//! The plate minimises `∫ |D²z|² + |∇(z − p)|² / T² dA + ∫ (κ/σ)² (z − s)² dA`, the last over known
//! heights s with the noise σ. κ is a usual curvature of the ground, and T the length beyond which
//! the tension draws the plate to the slope of p, the plane through all heights. It is solved from
//! coarse to fine cells by over-relaxation. Terms that would reach beyond the raster are left out,
//! so a slope goes on up to the border.

use std::ops::Range;

use multiversion::multiversion;
use raster::Grid;

use crate::coarse::{difference, weighted_blocks, widened};
use crate::membrane::{completed, filled, halved};
use crate::runs::{LANES, Run, runs};
use crate::trend::fitted;

/// Sweeps over the cells of each level. The coarser level has done the rest.
const SWEEPS: usize = 40;
/// Over-relaxation of a sweep, which carries heights faster into wide gaps.
const RELAXATION: f32 = 1.5;
/// Known cells around unknown ones that the plate may smooth, cells.
const MARGIN: usize = 4;
/// Usual curvature of the ground, 1/m, against which its noise is weighed. Half and twice of it
/// change the errors of simulated towns by a tenth.
pub(crate) const CURVATURE: f64 = 0.01;
/// Length of the tension, metres: half of the width of a large building. Wider gaps are too wide to
/// extrapolate a slope into that is not the general one.
const TENSION_M: f64 = 40.0;
/// Distance over which the bending of a cell depends on others, cells.
const REACH: usize = 2;
/// Side of the level that a membrane starts, cells.
const COARSEST: usize = 4;

/// Fills the NaN cells of a surface with square cells of `cell_m`, and smooths the known cells
/// beside them as far as their `noise_m` asks for. A surface without any height stays as it is.
pub(crate) fn plate(known: &Grid<f32>, cell_m: f64, noise_m: f64) -> Grid<f32> {
    if !known.data().iter().any(|h| h.is_nan()) || known.data().iter().all(|h| h.is_nan()) {
        return known.clone();
    }
    let counts = known.map(|h| if h.is_nan() { 0.0 } else { 1.0 });
    let weight = (cell_m * CURVATURE / noise_m).powi(2);
    // The tension is that of a membrane over this plane, or wide gaps on a slope would go flat.
    let plane = plane(known);
    let mut level = difference(known, &plane);
    level = solved(&level, &counts, cell_m, weight as f32);
    level.data_mut().iter_mut().zip(plane.data()).for_each(|(height, plane)| *height += plane);
    level
}

/// Returns the plane through known heights by least squares.
fn plane(known: &Grid<f32>) -> Grid<f32> {
    let width = known.width();
    let cells = || known.data().iter().enumerate().filter(|(_, h)| !h.is_nan());
    let base = cells().next().map_or(0.0, |(_, h)| f64::from(*h));
    let points = cells().map(|(at, h)| ([(at % width) as f64, (at / width) as f64, f64::from(*h)], 1.0));
    let [level, along, across] = fitted(points, base);
    let mut plane = known.clone();
    for (at, height) in plane.data_mut().iter_mut().enumerate() {
        *height = (base + level + along * (at % width) as f64 + across * (at / width) as f64) as f32;
    }
    plane
}

/// Returns the plate through heights with the weights (κ/σ)² per square metre, 1/m⁴. NaN cells have
/// the weight 0.
pub(crate) fn smooth_plate(heights: &Grid<f32>, weights: &Grid<f32>, cell_m: f64) -> Grid<f32> {
    if heights.width().min(heights.height()) <= COARSEST {
        return filled(heights);
    }
    let (means, mean_weights) = weighted_blocks(heights, 2, |at| weights.data()[at]);
    let coarse = smooth_plate(&means, &mean_weights, 2.0 * cell_m);
    let scale = cell_m.powi(4) as f32;
    let level = Level::new(heights, weights.map(|weight| weight * scale), cell_m);
    let start = completed(&heights.map(|_| f32::NAN), &coarse);
    level.relaxed(start, &runs(&heights.map(|_| true)))
}

/// Solves one level. `weight` is that of a known cell of the finest level, 1/m².
fn solved(known: &Grid<f32>, counts: &Grid<f32>, cell_m: f64, weight: f32) -> Grid<f32> {
    if known.width().min(known.height()) <= COARSEST {
        return filled(known);
    }
    let is_unknown = known.map(|h| h.is_nan());
    if !is_unknown.data().contains(&true) {
        return known.clone();
    }
    let coarse = solved(&halved(known), &halved_sums(counts), 2.0 * cell_m, weight);
    let weight = weight * (cell_m * cell_m) as f32;
    let level = Level::new(known, counts.map(|count| weight * count), cell_m);
    level.relaxed(completed(known, &coarse), &runs(&widened(&is_unknown, MARGIN)))
}

/// Sums of 2 × 2 cells.
fn halved_sums(fine: &Grid<f32>) -> Grid<f32> {
    let mut coarse = Grid::filled(fine.width().div_ceil(2), fine.height().div_ceil(2), 0.0);
    for row in 0..fine.height() {
        for column in 0..fine.width() {
            coarse[(column / 2, row / 2)] += fine[(column, row)];
        }
    }
    coarse
}

/// The terms of one level, relative to that of the curvature.
struct Level {
    /// Weight of the known height of each cell; 0 where none is known.
    weights: Grid<f32>,
    /// Known heights; 0 where none is known.
    heights: Grid<f32>,
    /// Relaxation over the second derivative of the energy of cells inside the raster.
    gains: Grid<f32>,
    tension: f32,
    /// Memory for what each cell of a run would move by if no other moved.
    moves: Vec<f32>,
}

impl Level {
    fn new(known: &Grid<f32>, weights: Grid<f32>, cell_m: f64) -> Self {
        let tension = (cell_m / TENSION_M).powi(2) as f32;
        let heights = known.map(|h| if h.is_nan() { 0.0 } else { *h });
        let gains = weights.map(|weight| RELAXATION / (20.0 + 4.0 * tension + weight));
        Self { weights, heights, gains, tension, moves: Vec::with_capacity(known.width()) }
    }

    /// Moves the cells of the runs from where they are to the heights with the least energy.
    fn relaxed(mut self, mut heights: Grid<f32>, active: &[Run]) -> Grid<f32> {
        for _ in 0..SWEEPS {
            active.iter().for_each(|run| self.relax(&mut heights, run));
        }
        heights
    }

    /// Moves the cells of a run, from left to right, towards the heights with the least energy.
    fn relax(&mut self, out: &mut Grid<f32>, Run { row, columns }: &Run) {
        let (width, height) = (out.width(), out.height());
        let is_inner = *row >= REACH && row + REACH < height;
        let end = if is_inner { columns.end.min(width.saturating_sub(REACH)) } else { 0 };
        let start = columns.start.max(REACH).min(columns.end);
        (columns.start..start).for_each(|column| self.relax_at_border(out, (column, *row)));
        if start < end {
            self.relax_inside(out, *row, start..end);
        }
        (start.max(end)..columns.end).for_each(|column| self.relax_at_border(out, (column, *row)));
    }

    /// Moves cells whose bending lies within the raster, each by what it would move by if no other
    /// moved, and by what the moves of the two cells to its left add.
    fn relax_inside(&mut self, out: &mut Grid<f32>, row: usize, columns: Range<usize>) {
        let near_weight = 8.0 + self.tension;
        let lines: [&[f32]; 2 * REACH + 1] = std::array::from_fn(|i| out.row(row + i - REACH));
        let terms = [&self.gains, &self.weights, &self.heights].map(|of| &of.row(row)[columns.start..]);
        let gains = terms[0];
        let count = columns.len().next_multiple_of(LANES).min(out.width() - REACH - columns.start);
        self.moves.resize(count, 0.0);
        moves_inside(lines, columns.start, near_weight, terms, &mut self.moves);
        let (mut moved_2, mut moved) = (0.0, 0.0);
        for ((cell, alone), gain) in out.row_mut(row)[columns].iter_mut().zip(&self.moves).zip(gains) {
            let by = (alone - gain * moved_2) + gain * near_weight * moved;
            *cell += by;
            (moved_2, moved) = (moved, by);
        }
    }

    /// Moves a cell some of whose neighbours may lie beyond the border.
    fn relax_at_border(&self, out: &mut Grid<f32>, place: (usize, usize)) {
        let size = (out.width(), out.height());
        let (bend, pull) = (border_bend(out.data(), place, size), tension(out.data(), place, size));
        let weight = self.weights[place];
        let slope = bend.0 + self.tension * pull.0 + weight * (out[place] - self.heights[place]);
        let diagonal = bend.1 + self.tension * pull.1 + weight;
        out[place] -= RELAXATION * slope / diagonal;
    }
}

/// Finds what cells from column `start` on would move by if none around them moved. The derivative
/// of the bending by the height of a cell has the weights 20 for the cell, −8 beside it, 2 across
/// corners and 1 two cells away.
#[multiversion(targets("x86_64+avx512vl", "x86_64+avx2"))]
fn moves_inside<'a>(
    [up_2, up, own, down, down_2]: [&'a [f32]; 5],
    start: usize,
    near_weight: f32,
    [gains, weights, heights]: [&[f32]; 3],
    moves: &mut [f32],
) {
    let count = moves.len();
    // A part begins `right` columns after the one two columns to the left.
    let part = |line: &'a [f32], right: usize| &line[start - REACH + right..][..count];
    let (left_2, left, here, right, right_2) = (part(own, 0), part(own, 1), part(own, 2), part(own, 3), part(own, 4));
    let (up_2, up_left, up, up_right) = (part(up_2, 2), part(up, 1), part(up, 2), part(up, 3));
    let (down_2, down_left, down, down_right) = (part(down_2, 2), part(down, 1), part(down, 2), part(down, 3));
    let (gains, weights, heights) = (&gains[..count], &weights[..count], &heights[..count]);
    for (x, alone) in moves.iter_mut().enumerate() {
        // Differences are small and hardly rounded, however high the ground lies.
        let own = here[x];
        let near = (left[x] - own) + (right[x] - own) + (up[x] - own) + (down[x] - own);
        let diagonal = (up_left[x] - own) + (up_right[x] - own) + (down_left[x] - own) + (down_right[x] - own);
        let far = (left_2[x] - own) + (right_2[x] - own) + (up_2[x] - own) + (down_2[x] - own);
        *alone = gains[x] * (near_weight * near - 2.0 * diagonal - far + weights[x] * (heights[x] - own));
    }
}

/// Derivative and second derivative of half of the energy of bending by the height of a cell, from
/// the second differences that lie within the raster.
fn border_bend(z: &[f32], (column, row): (usize, usize), (width, height): (usize, usize)) -> (f32, f32) {
    let at = |x: usize, y: usize| z[y * width + x];
    let (mut slope, mut second) = (0.0, 0.0);
    for (middle, factor) in [(column.wrapping_sub(1), 1.0), (column, -2.0), (column + 1, 1.0)] {
        if middle >= 1 && middle < width.saturating_sub(1) {
            slope += factor * (at(middle - 1, row) - 2.0 * at(middle, row) + at(middle + 1, row));
            second += factor * factor;
        }
    }
    for (middle, factor) in [(row.wrapping_sub(1), 1.0), (row, -2.0), (row + 1, 1.0)] {
        if middle >= 1 && middle < height.saturating_sub(1) {
            slope += factor * (at(column, middle - 1) - 2.0 * at(column, middle) + at(column, middle + 1));
            second += factor * factor;
        }
    }
    for (x, sign_x) in [(column.wrapping_sub(1), 1.0), (column, -1.0)] {
        for (y, sign_y) in [(row.wrapping_sub(1), 1.0), (row, -1.0)] {
            if x < width - 1 && y < height - 1 {
                let twist = at(x, y) - at(x + 1, y) - at(x, y + 1) + at(x + 1, y + 1);
                slope += 2.0 * sign_x * sign_y * twist;
                second += 2.0;
            }
        }
    }
    (slope, second)
}

/// Derivative and second derivative of half of the energy of the tension.
fn tension(z: &[f32], (column, row): (usize, usize), (width, height): (usize, usize)) -> (f32, f32) {
    let at = row * width + column;
    let (mut sum, mut count) = (0.0, 0.0);
    let mut add = |is_inside: bool, near: usize| {
        if is_inside {
            sum += z[at] - z[near];
            count += 1.0;
        }
    };
    add(column > 0, at.wrapping_sub(1));
    add(column + 1 < width, at + 1);
    add(row > 0, at.wrapping_sub(width));
    add(row + 1 < height, at + width);
    (sum, count)
}

#[cfg(test)]
mod tests {
    use super::*;

    fn surface(width: usize, height: usize, z: impl Fn(f32, f32) -> f32) -> Grid<f32> {
        let cells = (0..width * height).map(|at| z((at % width) as f32, (at / width) as f32));
        Grid::from_vec(width, height, cells.collect()).unwrap()
    }

    fn worst(found: &Grid<f32>, truth: &Grid<f32>) -> f32 {
        found.data().iter().zip(truth.data()).map(|(a, b)| (a - b).abs()).fold(0.0, f32::max)
    }

    fn with_gap(truth: &Grid<f32>, is_gap: impl Fn(usize, usize) -> bool) -> Grid<f32> {
        let mut known = truth.clone();
        for y in 0..truth.height() {
            for x in 0..truth.width() {
                if is_gap(x, y) {
                    known[(x, y)] = f32::NAN;
                }
            }
        }
        known
    }

    #[test]
    fn a_hilltop_goes_on_under_a_building_and_a_plane_up_to_the_border() {
        let hill = surface(120, 90, |x, y| -0.004 * ((x - 60.0).powi(2) + (y - 45.0).powi(2)));
        let known = with_gap(&hill, |x, y| (48..72).contains(&x) && (35..55).contains(&y));
        let (by_plate, by_membrane) = (worst(&plate(&known, 1.0, 0.01), &hill), worst(&filled(&known), &hill));
        assert!(by_plate < 0.3 * by_membrane, "{by_plate}, {by_membrane}");
        let plane = surface(120, 90, |x, y| 0.3 * x - 0.2 * y);
        let known = with_gap(&plane, |x, y| x > 100 && y < 30);
        let (by_plate, by_membrane) = (worst(&plate(&known, 1.0, 0.01), &plane), worst(&filled(&known), &plane));
        assert!(by_plate < 0.5 * by_membrane, "{by_plate}, {by_membrane}");
    }

    #[test]
    fn a_slope_goes_on_over_a_void_that_is_wider_than_the_tension() {
        let slope = surface(240, 160, |x, y| 0.2 * x + 0.1 * y + 0.5 * (y / 8.0).sin());
        let known = with_gap(&slope, |x, _| x > 60);
        let error = worst(&plate(&known, 1.0, 0.1), &slope);
        assert!(error < 4.0, "{error}");
    }

    #[test]
    fn heights_far_above_zero_are_as_exact() {
        let hill = |base: f32| surface(130, 90, |x, y| base - 0.004 * ((x - 60.0).powi(2) + (y - 45.0).powi(2)));
        let with_gaps = |base: f32| with_gap(&hill(base), |x, y| x % 30 < 20 && y % 40 < 30);
        let (low, high) = (plate(&with_gaps(0.0), 1.0, 0.1), plate(&with_gaps(4096.0), 1.0, 0.1));
        let apart = worst(&high.map(|h| h - 4096.0), &low);
        assert!(apart < 0.01, "{apart}");
    }

    #[test]
    fn one_height_fills_everything_and_none_fills_nothing() {
        let mut known = Grid::filled(17, 15, f32::NAN);
        assert!(plate(&known, 1.0, 0.1).data().iter().all(|h| h.is_nan()));
        known[(3, 1)] = 4.0;
        assert!(plate(&known, 1.0, 0.1).data().iter().all(|h| (h - 4.0).abs() < 1e-2));
    }
}
