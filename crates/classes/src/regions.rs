//! Connected regions of a mask, and growing within another.

use raster::Grid;

/// Removes the regions of fewer than `cells_min` cells from a mask.
pub(crate) fn without_small(mask: &mut Grid<bool>, cells_min: usize) {
    for region in regions_of(mask) {
        if region.len() < cells_min {
            region.into_iter().for_each(|at| mask.data_mut()[at] = false);
        }
    }
}

/// Gives the regions of `mask` to `other` whose border lies against `other` for more than half of
/// its length: what stands on a roof belongs to the building, a tree beside it does not. Regions
/// with a cell that `keeps` stay.
pub(crate) fn take_enclosed(mask: &mut Grid<bool>, other: &mut Grid<bool>, keeps: impl Fn(usize) -> bool) {
    let (width, height) = (mask.width(), mask.height());
    for region in regions_of(mask) {
        if region.iter().any(|at| keeps(*at)) {
            continue;
        }
        let (mut border, mut against) = (0, 0);
        for &at in &region {
            for near in beside(width, height, at).filter(|near| !mask.data()[*near]) {
                border += 1;
                against += usize::from(other.data()[near]);
            }
        }
        if 2 * against > border {
            for at in region {
                mask.data_mut()[at] = false;
                other.data_mut()[at] = true;
            }
        }
    }
}

/// Returns the regions of a mask as lists of cells. Cells that touch at sides or corners are
/// connected.
fn regions_of(mask: &Grid<bool>) -> Vec<Vec<usize>> {
    let mut is_seen = vec![false; mask.data().len()];
    let mut regions = Vec::new();
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
        regions.push(cells);
    }
    regions
}

/// Returns the regions of a mask, and the number of the region of each cell, from 1; 0 is none.
pub(crate) fn labelled(mask: &Grid<bool>) -> (Grid<u32>, Vec<Vec<usize>>) {
    let regions = regions_of(mask);
    let mut numbers = mask.map(|_| 0u32);
    for (number, cells) in (1u32..).zip(&regions) {
        cells.iter().for_each(|at| numbers.data_mut()[*at] = number);
    }
    (numbers, regions)
}

/// Returns the parts of a mask that are wider than `2 steps` cells: what is left when the mask
/// shrinks by `steps` cells and grows again. Beyond the edge of the raster the mask goes on.
pub(crate) fn opened(mask: &Grid<bool>, steps: usize) -> Grid<bool> {
    spread(&shrunk(mask, steps), steps)
}

/// Returns a mask without gaps narrower than `2 steps` cells.
pub(crate) fn closed(mask: &Grid<bool>, steps: usize) -> Grid<bool> {
    shrunk(&spread(mask, steps), steps)
}

/// Shrinks a mask: cells that share a side with one outside of it leave it, `steps` times.
pub(crate) fn shrunk(mask: &Grid<bool>, steps: usize) -> Grid<bool> {
    spread(&mask.map(|inside| !inside), steps).map(|outside| !outside)
}

/// Grows a mask to the cells that share a side with it, `steps` times.
pub(crate) fn spread(mask: &Grid<bool>, steps: usize) -> Grid<bool> {
    let (width, height) = (mask.width(), mask.height());
    let mut wide = mask.clone();
    let mut front: Vec<usize> = (0..mask.data().len()).filter(|at| mask.data()[*at]).collect();
    for _ in 0..steps {
        let mut next = Vec::new();
        for near in front.into_iter().flat_map(|at| beside(width, height, at)) {
            if !std::mem::replace(&mut wide.data_mut()[near], true) {
                next.push(near);
            }
        }
        front = next;
    }
    wide
}

/// Takes the regions out of a mask of whose cells a smaller share than `share_min` `counts`.
/// Regions of which fewer than half of the cells are `known` stay.
pub(crate) fn without_share(
    mask: &mut Grid<bool>,
    share_min: f64,
    known: impl Fn(usize) -> bool,
    counts: impl Fn(usize) -> bool,
) {
    for region in regions_of(mask) {
        let seen = region.iter().filter(|at| known(**at)).count();
        let counted = region.iter().filter(|at| counts(**at)).count();
        if 2 * seen >= region.len() && (counted as f64) < share_min * seen as f64 {
            region.into_iter().for_each(|at| mask.data_mut()[at] = false);
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

/// Returns the cells that share a side with a cell.
pub(crate) fn beside(width: usize, height: usize, at: usize) -> impl Iterator<Item = usize> {
    let (column, row) = (at % width, at / width);
    around(width, height, at).filter(move |near| near % width == column || near / width == row)
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn opening_takes_strips_away_and_closing_fills_gaps() {
        let mut mask = Grid::filled(20, 12, false);
        (2..10).for_each(|row| mask.row_mut(row)[3..11].fill(true));
        (4..6).for_each(|row| mask.row_mut(row)[11..18].fill(true));
        mask[(7, 7)] = false;
        assert!(closed(&mask, 1)[(7, 7)] && closed(&mask, 1)[(3, 2)] && !closed(&mask, 1)[(1, 5)]);
        let wide = opened(&closed(&mask, 1), 1);
        assert!(wide[(5, 5)] && !wide[(15, 4)] && !wide[(17, 5)]);
    }

    #[test]
    fn regions_with_few_cells_that_count_leave_the_mask() {
        let mut mask = Grid::filled(12, 3, false);
        mask.row_mut(1)[0..4].fill(true);
        mask.row_mut(1)[6..10].fill(true);
        let mut unknown = mask.clone();
        without_share(&mut mask, 0.5, |_| true, |at| at < 15);
        assert!(mask[(0, 1)] && !mask[(9, 1)]);
        without_share(&mut unknown, 0.5, |at| at < 13, |_| false);
        assert!(unknown[(0, 1)], "most of it is not known");
    }

    #[test]
    fn what_stands_on_a_roof_is_part_of_it_and_what_stands_beside_it_is_not() {
        let mut roof = Grid::filled(20, 10, false);
        (1..9).for_each(|row| roof.row_mut(row)[2..10].fill(true));
        let mut rough = Grid::filled(20, 10, false);
        (3..5).for_each(|row| {
            roof.row_mut(row)[4..6].fill(false);
            rough.row_mut(row)[4..6].fill(true);
            rough.row_mut(row)[10..12].fill(true);
        });
        let (mut kept, mut whole) = (rough.clone(), roof.clone());
        take_enclosed(&mut rough, &mut roof, |_| false);
        assert!(roof[(4, 3)] && roof[(5, 4)] && !rough[(4, 3)]);
        assert!(rough[(10, 3)] && rough[(11, 4)] && !roof[(10, 3)]);
        take_enclosed(&mut kept, &mut whole, |at| at == 3 * 20 + 4);
        assert!(kept[(4, 3)] && !whole[(4, 3)], "a green cell keeps its region");
    }
}
