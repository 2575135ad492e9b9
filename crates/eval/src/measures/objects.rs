//! Buildings that a surface has lost or damaged, and trees that it has right, given the number of
//! the building in each cell.
//!
//! A building is judged by its inner cells: those that are more than two cells away (in steps along
//! rows and columns) from any cell of another number. An inner cell is right if the absolute error
//! is below 2 m or below 30 % of the building's height, whichever is more. The height is the median
//! of the building's cells above the median of the ground in its bounding box, widened by four
//! cells. A building with fewer than half of its inner cells right is lost, with fewer than 90 % it
//! is damaged; a lost building is damaged, too. Buildings below 40 m² or with fewer than 12 inner
//! cells do not count. A cell of a tree is right if its absolute error is below 2 m. A void is
//! wrong.

use std::collections::BTreeMap;

use numeric::percentile;
use raster::{Grid, Window};
use serde::Serialize;

/// Number of a cell of a tree. 0 is ground, and positive numbers are buildings.
const TREE: i32 = -1;
/// Least area of a building that counts, m².
const LEAST_AREA_M2: f64 = 40.0;
/// Least number of inner cells of a building that counts.
const LEAST_INNER_CELLS: usize = 12;
/// Steps from the border at which the inner cells of a building begin.
const BORDER_STEPS: i64 = 2;
/// Cells around the bounding box of a building in which its ground is looked for.
const AROUND_CELLS: usize = 4;
/// Least tolerance of a height, metres.
const TOLERANCE_M: f64 = 2.0;
/// Tolerance of a height as a share of the height of the building.
const TOLERANCE_SHARE: f64 = 0.3;
/// Share of right inner cells below which a building is lost.
const LOST_SHARE: f64 = 0.5;
/// Share of right inner cells below which a building is damaged.
const DAMAGED_SHARE: f64 = 0.9;

/// Buildings and trees of the reference, as far as the test has them.
#[derive(Debug, Clone, PartialEq, Serialize)]
pub struct ObjectsFound {
    /// Number of buildings that count.
    pub buildings: usize,
    /// Number of lost buildings.
    pub lost: usize,
    /// Number of damaged buildings, the lost ones included.
    pub damaged: usize,
    /// Number of cells of trees.
    pub tree_cells: usize,
    /// Share of the cells of trees that is right, 0 to 1. `None` without trees.
    pub trees_right: Option<f64>,
    /// The damaged buildings, in rising order of the share that is right.
    pub worst: Vec<DamagedBuilding>,
}

/// A building of which too little is right.
#[derive(Debug, Clone, Copy, PartialEq, Serialize)]
pub struct DamagedBuilding {
    /// Its number in the raster.
    pub number: i32,
    /// Its height above the ground around it, metres.
    pub height_m: f64,
    /// Its area, m².
    pub area_m2: f64,
    /// Share of its inner cells that is right, 0 to 1.
    pub right: f64,
}

/// What is compared: heights and numbers on the reference grid.
pub(crate) struct Objects<'a> {
    /// Reference heights, NaN where a cell does not count.
    pub(crate) reference: &'a Grid<f32>,
    /// Test − reference, NaN where the test is void.
    pub(crate) errors: &'a Grid<f64>,
    /// 0 or `None` is ground, −1 a tree, else the number of the building.
    pub(crate) numbers: &'a Grid<Option<i32>>,
    pub(crate) cell_area_m2: f64,
}

impl Objects<'_> {
    /// Judges every building and all trees.
    pub(crate) fn found(&self) -> ObjectsFound {
        let judged: Vec<DamagedBuilding> =
            self.boxes().into_iter().filter_map(|(number, inside)| self.judged(number, inside)).collect();
        let below = |share: f64| judged.iter().filter(|building| building.right < share).count();
        let (lost, damaged) = (below(LOST_SHARE), below(DAMAGED_SHARE));
        let mut worst: Vec<DamagedBuilding> =
            judged.iter().filter(|building| building.right < DAMAGED_SHARE).copied().collect();
        worst.sort_by(|a, b| a.right.total_cmp(&b.right));
        let (tree_cells, trees_right) = self.trees();
        ObjectsFound { buildings: judged.len(), lost, damaged, tree_cells, trees_right, worst }
    }

    fn trees(&self) -> (usize, Option<f64>) {
        let (mut cells, mut right) = (0usize, 0usize);
        for (i, number) in self.numbers.data().iter().enumerate() {
            let counts = self.reference.data().get(i).is_some_and(|h| h.is_finite());
            if *number == Some(TREE) && counts {
                cells += 1;
                right += usize::from(self.errors.data()[i].abs() < TOLERANCE_M);
            }
        }
        (cells, (cells > 0).then(|| right as f64 / cells as f64))
    }

    fn number(&self, column: usize, row: usize) -> i32 {
        self.numbers.get(column, row).copied().flatten().unwrap_or(0)
    }

    /// Returns the bounding box of every building, in cells.
    fn boxes(&self) -> BTreeMap<i32, Window> {
        let mut corners: BTreeMap<i32, [usize; 4]> = BTreeMap::new();
        for row in 0..self.numbers.height() {
            for column in 0..self.numbers.width() {
                let number = self.number(column, row);
                if number > 0 {
                    let [left, top, right, low] = corners.entry(number).or_insert([column, row, column, row]);
                    (*left, *top) = ((*left).min(column), (*top).min(row));
                    (*right, *low) = ((*right).max(column), (*low).max(row));
                }
            }
        }
        let window = |[left, top, right, low]: [usize; 4]| Window {
            x: left as i64,
            y: top as i64,
            width: right + 1 - left,
            height: low + 1 - top,
        };
        corners.into_iter().map(|(number, corners)| (number, window(corners))).collect()
    }

    /// Judges one building. `None` if it is too small to count.
    fn judged(&self, number: i32, inside: Window) -> Option<DamagedBuilding> {
        let (left, top) = (inside.x as usize, inside.y as usize);
        let columns = left.saturating_sub(AROUND_CELLS)..(left + inside.width + AROUND_CELLS).min(self.numbers.width());
        let rows = top.saturating_sub(AROUND_CELLS)..(top + inside.height + AROUND_CELLS).min(self.numbers.height());
        let (mut own, mut ground) = (Vec::new(), Vec::new());
        let (mut cells, mut inner_errors) = (0usize, Vec::new());
        for row in rows {
            for column in columns.clone() {
                let (found, height) = (self.number(column, row), f64::from(self.reference[(column, row)]));
                cells += usize::from(found == number);
                if !height.is_finite() {
                    continue;
                }
                match found {
                    0 => ground.push(height),
                    _ if found == number => {
                        own.push(height);
                        if self.is_inner(number, column, row) {
                            inner_errors.push(self.errors[(column, row)].abs());
                        }
                    }
                    _ => {}
                }
            }
        }
        let area_m2 = cells as f64 * self.cell_area_m2;
        if area_m2 < LEAST_AREA_M2 || inner_errors.len() < LEAST_INNER_CELLS {
            return None;
        }
        // Without ground in sight the height is not known, and the least tolerance holds.
        let top_m = percentile(&mut own, 50.0)?;
        let height_m = percentile(&mut ground, 50.0).map_or(0.0, |ground| top_m - ground);
        let tolerance = TOLERANCE_M.max(TOLERANCE_SHARE * height_m);
        let right = inner_errors.iter().filter(|error| **error < tolerance).count();
        Some(DamagedBuilding { number, height_m, area_m2, right: right as f64 / inner_errors.len() as f64 })
    }

    /// Returns whether all cells within [`BORDER_STEPS`] steps have the number. Cells outside of
    /// the grid do not.
    fn is_inner(&self, number: i32, column: usize, row: usize) -> bool {
        (-BORDER_STEPS..=BORDER_STEPS).all(|dy| {
            let reach = BORDER_STEPS - dy.abs();
            (-reach..=reach).all(|dx| {
                let at = (usize::try_from(column as i64 + dx), usize::try_from(row as i64 + dy));
                matches!(at, (Ok(column), Ok(row)) if self.number(column, row) == number)
            })
        })
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    const SIZE: (usize, usize) = (60, 40);

    /// Ground at 50 m with two buildings of 10 m and a shed of 6 × 6 cells; a tree.
    fn numbers() -> Grid<Option<i32>> {
        let number = |i: usize| {
            let (column, row) = (i % SIZE.0, i / SIZE.0);
            let inside = |left: usize, top: usize, side: usize| {
                (left..left + side).contains(&column) && (top..top + side).contains(&row)
            };
            match () {
                () if inside(5, 5, 16) => Some(1),
                () if inside(30, 5, 16) => Some(7),
                () if inside(5, 28, 6) => Some(9),
                () if inside(40, 28, 5) => Some(-1),
                () if row == 39 => None,
                () => Some(0),
            }
        };
        Grid::from_vec(SIZE.0, SIZE.1, (0..SIZE.0 * SIZE.1).map(number).collect()).unwrap()
    }

    fn found(error: impl Fn(usize, usize, i32) -> f64) -> ObjectsFound {
        let numbers = numbers();
        let reference = numbers.map(|n| if n.unwrap_or(0) == 0 { 50.0f32 } else { 60.0 });
        let cell = |i: usize| error(i % SIZE.0, i / SIZE.0, numbers.data()[i].unwrap_or(0));
        let errors = Grid::from_vec(SIZE.0, SIZE.1, (0..SIZE.0 * SIZE.1).map(cell).collect()).unwrap();
        Objects { reference: &reference, errors: &errors, numbers: &numbers, cell_area_m2: 0.25 }.found()
    }

    #[test]
    fn a_whole_surface_has_lost_nothing_and_small_sheds_do_not_count() {
        let found = found(|_, _, _| 0.4);
        assert_eq!((found.buildings, found.lost, found.damaged, found.tree_cells), (2, 0, 0, 25));
        assert_eq!((found.trees_right, found.worst.len()), (Some(1.0), 0));
    }

    #[test]
    fn a_flattened_building_is_lost_and_one_with_a_hole_is_damaged() {
        let found = found(|column, _, number| match number {
            1 => -10.0,
            // The left part of the other is void; of the inner columns 32 to 43, these are 3 of 12.
            7 if column < 35 => f64::NAN,
            -1 if column < 43 => -8.0,
            _ => 0.0,
        });
        assert_eq!((found.buildings, found.lost, found.damaged), (2, 1, 2));
        assert_eq!(found.worst.iter().map(|b| b.number).collect::<Vec<_>>(), [1, 7]);
        assert!((found.worst[0].height_m - 10.0).abs() < 1e-9 && found.worst[0].area_m2 == 64.0);
        assert!((found.worst[1].right - 0.75).abs() < 1e-9, "{:?}", found.worst[1]);
        assert!((found.trees_right.unwrap() - 0.4).abs() < 1e-9);
    }

    #[test]
    fn the_border_is_not_judged_and_the_tolerance_grows_with_the_height() {
        // 2.9 m are below 30 % of 10 m. The outermost two cells are wrong by far more.
        let rim = |column: usize, row: usize| !(7..19).contains(&column) || !(7..19).contains(&row);
        let lower = found(|column, row, number| if number == 1 && rim(column, row) { -30.0 } else { 2.9 });
        assert_eq!((lower.lost, lower.damaged, lower.trees_right), (0, 0, Some(0.0)));
        assert_eq!(found(|_, _, _| 3.1).lost, 2);
    }
}
