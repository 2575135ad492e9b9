//! Connected regions of a mask, and growing within another.

use raster::Grid;

/// Removes the regions of fewer than `cells_min` cells from a mask. Cells that touch at sides or
/// corners are connected.
pub(crate) fn without_small(mask: &mut Grid<bool>, cells_min: usize) {
    let mut is_seen = vec![false; mask.data().len()];
    for seed in 0..is_seen.len() {
        if is_seen[seed] || !mask.data()[seed] {
            continue;
        }
        is_seen[seed] = true;
        let (mut cells, mut next) = (vec![seed], 0);
        while let Some(&at) = cells.get(next) {
            next += 1;
            for near in around(mask.width(), mask.height(), at) {
                if mask.data()[near] && !is_seen[near] {
                    is_seen[near] = true;
                    cells.push(near);
                }
            }
        }
        if cells.len() < cells_min {
            cells.iter().for_each(|at| mask.data_mut()[*at] = false);
        }
    }
}

/// Grows a mask by `steps` cells, as far as `within` allows.
pub(crate) fn grow(mask: &mut Grid<bool>, within: &Grid<bool>, steps: usize) {
    let mut front: Vec<usize> = (0..mask.data().len()).filter(|at| mask.data()[*at]).collect();
    for _ in 0..steps {
        let mut next = Vec::new();
        for at in front {
            for near in around(mask.width(), mask.height(), at) {
                if within.data()[near] && !mask.data()[near] {
                    mask.data_mut()[near] = true;
                    next.push(near);
                }
            }
        }
        front = next;
    }
}

/// Returns the cells around a cell, up to eight.
fn around(width: usize, height: usize, at: usize) -> impl Iterator<Item = usize> {
    let (column, row) = (at % width, at / width);
    let rows = row.saturating_sub(1)..(row + 2).min(height);
    rows.flat_map(move |y| (column.saturating_sub(1)..(column + 2).min(width)).map(move |x| y * width + x))
        .filter(move |near| *near != at)
}
