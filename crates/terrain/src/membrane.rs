//! A membrane through known heights: Laplace's equation on the unknown cells, solved from coarse to
//! fine cells. Borders of the raster are free (no slope across them).

use multiversion::multiversion;
use raster::Grid;

use crate::coarse::weighted_blocks;
use crate::runs::{LANES, Run, runs};

/// Sweeps over the unknown cells of each level. The coarser level has done the rest.
const SWEEPS: usize = 24;
/// Over-relaxation of a sweep, which carries heights faster into wide gaps.
const RELAXATION: f32 = 1.6;
/// Share of the distance to each neighbour that a cell moves by.
const PART: f32 = 0.25 * RELAXATION;

/// Fills the NaN cells of a surface. A surface without any height stays as it is.
pub(crate) fn filled(known: &Grid<f32>) -> Grid<f32> {
    if !known.data().iter().any(|h| h.is_nan()) || known.data().iter().all(|h| h.is_nan()) {
        return known.clone();
    }
    let coarse = filled(&halved(known));
    let unknown = runs(&known.map(|h| h.is_nan()));
    let mut out = completed(known, &coarse);
    let mut moves = Vec::with_capacity(known.width());
    for _ in 0..SWEEPS {
        unknown.iter().for_each(|run| relax(&mut out, run, &mut moves));
    }
    out
}

/// Moves the unknown cells of a run, from left to right, towards the mean of their neighbours. A
/// neighbour beyond the border has the height of the cell itself.
///
/// First comes what each cell would move by if no other moved, with vector instructions for the
/// whole run. Each cell then moves by that and by [`PART`] of the move of its left neighbour. Moves
/// are small and hardly rounded, however high the ground lies. `moves` is memory for them.
fn relax(out: &mut Grid<f32>, Run { row, columns }: &Run, moves: &mut Vec<f32>) {
    let last = out.width() - 1;
    let [above, own, below] = [row.saturating_sub(1), *row, (row + 1).min(out.height() - 1)].map(|row| out.row(row));
    moves.resize(columns.len() + LANES, 0.0);
    let start = columns.start.max(1).min(columns.end);
    let end = columns.end.min(last).max(start);
    for column in (columns.start..start).chain(end..columns.end) {
        let here = own[column];
        let (left, right) = (own[column.saturating_sub(1)], own[(column + 1).min(last)]);
        let apart = (left - here) + (right - here) + (above[column] - here) + (below[column] - here);
        moves[column - columns.start] = PART * apart;
    }
    if start < end {
        let count = (end - start).next_multiple_of(LANES).min(last - start);
        moves_inside([above, own, below], start, &mut moves[start - columns.start..][..count]);
    }
    let mut moved = 0.0;
    for (cell, alone) in out.row_mut(*row)[columns.clone()].iter_mut().zip(moves) {
        moved = *alone + PART * moved;
        *cell += moved;
    }
}

/// Finds the moves of cells from column `start` on that have a neighbour on each side.
#[multiversion(targets("x86_64+avx512vl", "x86_64+avx2"))]
fn moves_inside([above, own, below]: [&[f32]; 3], start: usize, moves: &mut [f32]) {
    let count = moves.len();
    let (left, right) = (&own[start - 1..][..count], &own[start + 1..][..count]);
    let (own, above, below) = (&own[start..][..count], &above[start..][..count], &below[start..][..count]);
    for (x, alone) in moves.iter_mut().enumerate() {
        *alone = PART * ((left[x] - own[x]) + (right[x] - own[x]) + (above[x] - own[x]) + (below[x] - own[x]));
    }
}

/// Means of the known heights of 2 × 2 cells.
pub(crate) fn halved(fine: &Grid<f32>) -> Grid<f32> {
    weighted_blocks(fine, 2, |_| 1.0).0
}

/// Returns the heights with the NaN cells interpolated from the level that is half as fine.
pub(crate) fn completed(known: &Grid<f32>, coarse: &Grid<f32>) -> Grid<f32> {
    let mut out = known.clone();
    for row in 0..out.height() {
        for (column, cell) in out.row_mut(row).iter_mut().enumerate().filter(|(_, cell)| cell.is_nan()) {
            *cell = doubled_at(coarse, column, row);
        }
    }
    out
}

/// Interpolates a coarse level at a cell of the level that is twice as fine.
fn doubled_at(coarse: &Grid<f32>, column: usize, row: usize) -> f32 {
    let place = |at: usize, count: usize| {
        let near = at / 2;
        let far = if at % 2 == 1 { (near + 1).min(count - 1) } else { near.saturating_sub(1) };
        (near, far)
    };
    let ((x, x_far), (y, y_far)) = (place(column, coarse.width()), place(row, coarse.height()));
    let line = |y: usize| 0.75 * coarse[(x, y)] + 0.25 * coarse[(x_far, y)];
    0.75 * line(y) + 0.25 * line(y_far)
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn a_plane_goes_on_under_a_wide_gap() {
        let plane = |x: usize, y: usize| 0.2 * x as f32 - 0.1 * y as f32;
        let mut surface = Grid::filled(301, 200, 0.0);
        for y in 0..200 {
            for x in 0..301 {
                let is_gap = (60..210).contains(&x) && (40..160).contains(&y);
                surface[(x, y)] = if is_gap { f32::NAN } else { plane(x, y) };
            }
        }
        let found = filled(&surface);
        let worst = (0..60_200).map(|at| (found.data()[at] - plane(at % 301, at / 301)).abs()).fold(0.0, f32::max);
        assert!(worst < 0.25, "{worst}");
    }

    #[test]
    fn one_height_fills_everything_and_none_fills_nothing() {
        let mut surface = Grid::filled(7, 5, f32::NAN);
        assert!(filled(&surface).data().iter().all(|h| h.is_nan()));
        surface[(3, 1)] = 4.0;
        assert!(filled(&surface).data().iter().all(|h| (h - 4.0).abs() < 1e-4));
    }
}
