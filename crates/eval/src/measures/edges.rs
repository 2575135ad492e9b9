//! Height jumps of a surface: roof edges, walls, outlines of trees.
//!
//! A jump lies between two neighbouring cells whose heights differ by more than [`JUMP_M`] and by
//! more than [`JUMP_STEEPNESS`] times their distance. The second condition excludes mountain sides
//! on coarse grids. The edge zone holds the cells within [`ZONE_M`] or [`ZONE_CELLS`] cells of a
//! jump, whichever is more. For cells of 0.5 m these are the two cells on either side.

use crate::alignment::align::MetresFromCells;
use crate::measures::distance::distances_m;
use raster::Grid;
use serde::Serialize;

/// Lowest height difference of a jump, metres.
pub const JUMP_M: f64 = 2.0;
/// Lowest height difference of a jump divided by the distance of its cells.
pub const JUMP_STEEPNESS: f64 = 2.0;
/// Reach of the edge zone, metres.
pub const ZONE_M: f64 = 1.0;
/// Shortest reach of the edge zone, cells.
pub const ZONE_CELLS: f64 = 2.0;

/// Definition of an edge on a grid.
#[derive(Debug, Clone, Copy, PartialEq, Serialize)]
pub struct EdgeRule {
    /// Height difference between neighbours that makes a jump, along columns and along rows,
    /// metres.
    pub jump_m: (f64, f64),
    /// Distance from a jump within which a cell belongs to the edge zone, metres.
    pub zone_m: f64,
}

impl EdgeRule {
    /// Returns the rule for cells of this size.
    pub fn of(metres_from_cells: MetresFromCells) -> Self {
        let (along_columns, along_rows) = metres_from_cells.cell_size_m();
        let jump = |side: f64| JUMP_M.max(JUMP_STEEPNESS * side);
        Self {
            jump_m: (jump(along_columns), jump(along_rows)),
            zone_m: ZONE_M.max(ZONE_CELLS * along_columns.max(along_rows)),
        }
    }
}

/// Marks the cells within the edge zone of the surface. A jump lies half-way between its two cells.
pub fn edge_zone(heights: &Grid<f32>, metres_from_cells: MetresFromCells) -> Grid<bool> {
    let rule = EdgeRule::of(metres_from_cells);
    let sides = metres_from_cells.cell_size_m();
    let mut at_jump = Grid::filled(heights.width(), heights.height(), false);
    for (a, b) in jumps(heights, rule) {
        at_jump[a] = true;
        at_jump[b] = true;
    }
    let reach = rule.zone_m - 0.5 * sides.0.max(sides.1);
    // The factor includes cells at exactly the reach, whatever the rounding.
    distances_m(&at_jump, sides).map(|&d| f64::from(d) <= reach * (1.0 + 1e-6))
}

/// A cell as (column, row).
pub(crate) type Cell = (usize, usize);

/// Returns the pairs of neighbours with a jump between them, the higher cell first.
pub(crate) fn jumps(heights: &Grid<f32>, rule: EdgeRule) -> impl Iterator<Item = (Cell, Cell)> {
    let cells = (0..heights.height()).flat_map(|row| (0..heights.width()).map(move |column| (column, row)));
    cells.flat_map(move |cell @ (column, row)| {
        let right = ordered(heights, cell, (column + 1, row), rule.jump_m.0);
        right.into_iter().chain(ordered(heights, cell, (column, row + 1), rule.jump_m.1))
    })
}

/// Returns the two cells, the higher first, if they differ by more than `jump_m`.
fn ordered(heights: &Grid<f32>, a: Cell, b: Cell, jump_m: f64) -> Option<(Cell, Cell)> {
    let difference = f64::from(*heights.get(a.0, a.1)?) - f64::from(*heights.get(b.0, b.1)?);
    if difference > jump_m {
        Some((a, b))
    } else if difference < -jump_m {
        Some((b, a))
    } else {
        None
    }
}

#[cfg(test)]
mod tests {
    use super::*;
    use raster::GeoTransform;

    fn step(cell: f64) -> (Grid<f32>, MetresFromCells) {
        let heights = (0..200).map(|i| if i % 20 < 10 { 8.0 } else { 3.0 }).collect();
        let metres = MetresFromCells::new(&GeoTransform::north_up(0.0, 0.0, cell), (1.0, 1.0));
        (Grid::from_vec(20, 10, heights).unwrap(), metres)
    }

    #[test]
    fn the_zone_is_two_cells_on_either_side_of_a_jump_at_half_a_metre() {
        let (heights, metres) = step(0.5);
        let zone = edge_zone(&heights, metres);
        let columns: Vec<usize> = (0..20).filter(|&c| zone[(c, 4)]).collect();
        assert_eq!(columns, [8, 9, 10, 11]);
        let fine: Vec<usize> = (0..20).filter(|&c| edge_zone(&heights, step(0.25).1)[(c, 4)]).collect();
        assert_eq!(fine, [6, 7, 8, 9, 10, 11, 12, 13]);
    }

    #[test]
    fn a_steep_slope_on_coarse_cells_is_no_jump() {
        let (heights, metres) = step(30.0);
        assert!(edge_zone(&heights, metres).data().iter().all(|&inside| !inside));
    }

    #[test]
    fn voids_make_no_jump() {
        let (mut heights, metres) = step(0.5);
        for row in 0..10 {
            heights[(10, row)] = f32::NAN;
        }
        assert_eq!(jumps(&heights, EdgeRule::of(metres)).count(), 0);
    }
}
