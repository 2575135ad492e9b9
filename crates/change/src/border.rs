//! The border of a surface: what lies outside of it, and the cells near it.
//!
//! At the border of a surface model a match has ground on one side only, and its images end there
//! one after another. Heights near it are the least certain ones, and often spikes.

use raster::Grid;

use crate::tolerance::extreme;

/// Returns the cells within `reach` cells, along rows and columns, of the outside: beyond the
/// raster, or void (NaN) and joined to its edge by void cells. Holes inside are no border.
pub(crate) fn near_border(heights: &Grid<f32>, reach: usize) -> Grid<bool> {
    let (width, height) = (heights.width(), heights.height());
    let mut near = Grid::filled(width, height, false);
    if reach == 0 {
        return near;
    }
    let outside = outside(heights).map(|is_outside| if *is_outside { 1.0 } else { f32::NAN });
    let beside = extreme(&outside, reach, f32::max);
    for row in 0..height {
        for column in 0..width {
            let is_at_edge = row < reach || column < reach || row + reach >= height || column + reach >= width;
            near[(column, row)] = is_at_edge || !beside[(column, row)].is_nan();
        }
    }
    near
}

/// Returns the void cells that are joined to the edge of the raster by void cells.
fn outside(heights: &Grid<f32>) -> Grid<bool> {
    let (width, height) = (heights.width(), heights.height());
    let mut outside = Grid::filled(width, height, false);
    let is_edge = |at: usize| {
        let (column, row) = (at % width, at / width);
        column == 0 || row == 0 || column + 1 == width || row + 1 == height
    };
    let mut front: Vec<usize> = (0..width * height).filter(|at| is_edge(*at) && heights.data()[*at].is_nan()).collect();
    front.iter().for_each(|at| outside.data_mut()[*at] = true);
    while let Some(at) = front.pop() {
        let (column, row) = (at % width, at / width);
        let sides = [
            (column > 0).then(|| at - 1),
            (column + 1 < width).then_some(at + 1),
            (row > 0).then(|| at - width),
            (row + 1 < height).then_some(at + width),
        ];
        for near in sides.into_iter().flatten() {
            if heights.data()[near].is_nan() && !outside.data()[near] {
                outside.data_mut()[near] = true;
                front.push(near);
            }
        }
    }
    outside
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn the_border_follows_the_surface_and_leaves_its_holes() {
        let mut heights = Grid::filled(30, 20, 1.0f32);
        (0..20).for_each(|row| heights.row_mut(row)[..6].fill(f32::NAN));
        heights[(20, 10)] = f32::NAN;
        let near = near_border(&heights, 2);
        for (column, row, expected) in [
            (7, 10, true),
            (8, 10, false),
            (19, 10, false),
            (27, 10, false),
            (28, 10, true),
            (15, 1, true),
            (15, 2, false),
        ] {
            assert_eq!(near[(column, row)], expected, "{column}, {row}");
        }
        assert!(near_border(&heights, 0).data().iter().all(|near| !near));
    }
}
