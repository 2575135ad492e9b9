//! A membrane through known heights: Laplace's equation on the unknown cells, solved from coarse to
//! fine cells. Borders of the raster are free (no slope across them).

use raster::Grid;

use crate::coarse::weighted_blocks;
use crate::runs::{Run, runs};

/// Sweeps over the unknown cells of each level. The coarser level has done the rest.
const SWEEPS: usize = 24;
/// Over-relaxation of a sweep, which carries heights faster into wide gaps.
const RELAXATION: f32 = 1.6;

/// Fills the NaN cells of a surface. A surface without any height stays as it is.
pub(crate) fn filled(known: &Grid<f32>) -> Grid<f32> {
    if !known.data().iter().any(|h| h.is_nan()) || known.data().iter().all(|h| h.is_nan()) {
        return known.clone();
    }
    let coarse = filled(&halved(known));
    let unknown = runs(&known.map(|h| h.is_nan()));
    let mut out = completed(known, &coarse);
    let mut ahead = Vec::with_capacity(known.width());
    for _ in 0..SWEEPS {
        unknown.iter().for_each(|run| relax(&mut out, run, &mut ahead));
    }
    out
}

/// Moves the unknown cells of a run, from left to right, towards the mean of their neighbours. A
/// neighbour beyond the border has the height of the cell itself.
///
/// `ahead` is memory for what does not depend on the cell to the left, which vector instructions
/// sum up for the whole run.
fn relax(out: &mut Grid<f32>, Run { row, columns }: &Run, ahead: &mut Vec<f32>) {
    const PART: f32 = 0.25 * RELAXATION;
    let (first, last) = (columns.start, out.width() - 1);
    let own = out.row(*row);
    let (above, below) = (out.row(row.saturating_sub(1)), out.row((row + 1).min(out.height() - 1)));
    ahead.clear();
    let count = columns.end.min(last) - first;
    let [right, own_part, above_part, below_part] =
        [&own[first + 1..], &own[first..], &above[first..], &below[first..]].map(|line| &line[..count]);
    ahead.extend((0..count).map(|x| {
        let from = |line: &[f32]| line[x] - own_part[x];
        PART * (from(right) + from(above_part) + from(below_part))
    }));
    if columns.end > last {
        ahead.push(PART * ((above[last] - own[last]) + (below[last] - own[last])));
    }
    let mut left = own[first.saturating_sub(1)];
    for (cell, ahead) in out.row_mut(*row)[columns.clone()].iter_mut().zip(ahead) {
        *cell += *ahead + PART * (left - *cell);
        left = *cell;
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
