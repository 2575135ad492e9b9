//! Connected regions of cells with one sign of change, and how they grow over the ramps at their
//! borders.

use raster::Grid;

/// Number of a cell in no region.
pub(crate) const NONE: u32 = 0;
/// Neighbours of the same sign that a cell needs among its eight. Lines one cell wide have two.
const NEIGHBOURS_MIN: usize = 4;

/// Returns the signs without cells that have few neighbours of their sign.
pub(crate) fn without_lines(signs: &Grid<i8>) -> Grid<i8> {
    let mut kept = signs.clone();
    for (at, kept) in kept.data_mut().iter_mut().enumerate() {
        let same = neighbours(signs, at).filter(|near| signs.data()[*near] == *kept).count();
        if *kept != 0 && same < NEIGHBOURS_MIN {
            *kept = 0;
        }
    }
    kept
}

/// Returns the regions of cells with one sign that touch at sides or corners: their cells, in the
/// order of their first cells.
pub(crate) fn connected(signs: &Grid<i8>) -> Vec<Vec<usize>> {
    let mut is_seen = vec![false; signs.data().len()];
    let mut regions = Vec::new();
    for seed in 0..is_seen.len() {
        let sign = signs.data()[seed];
        if sign == 0 || is_seen[seed] {
            continue;
        }
        is_seen[seed] = true;
        let (mut cells, mut next) = (vec![seed], 0);
        while let Some(&at) = cells.get(next) {
            next += 1;
            for near in neighbours(signs, at) {
                if signs.data()[near] == sign && !is_seen[near] {
                    is_seen[near] = true;
                    cells.push(near);
                }
            }
        }
        regions.push(cells);
    }
    regions
}

/// Grows the region `number` in `numbers` by `steps` cells into free cells that `joins` accepts,
/// and returns the cells that it gained.
pub(crate) fn grow(
    numbers: &mut Grid<u32>,
    cells: &[usize],
    number: u32,
    steps: usize,
    joins: impl Fn(usize) -> bool,
) -> Vec<usize> {
    let (mut front, mut gained) = (cells.to_vec(), Vec::new());
    for _ in 0..steps {
        let mut next = Vec::new();
        for at in front {
            for near in neighbours(numbers, at).collect::<Vec<_>>() {
                if numbers.data()[near] == NONE && joins(near) {
                    numbers.data_mut()[near] = number;
                    next.push(near);
                }
            }
        }
        gained.extend_from_slice(&next);
        front = next;
    }
    gained
}

/// Returns the cells around a cell, up to eight.
fn neighbours<T>(grid: &Grid<T>, at: usize) -> impl Iterator<Item = usize> + use<T> {
    let (width, height) = (grid.width(), grid.height());
    let (column, row) = (at % width, at / width);
    let rows = row.saturating_sub(1)..(row + 2).min(height);
    rows.flat_map(move |y| (column.saturating_sub(1)..(column + 2).min(width)).map(move |x| y * width + x))
        .filter(move |near| *near != at)
}
