//! Parts of a surface and of the ground that are no evidence by themselves.
//!
//! A few cells of a wrong match between voids would make an object of all ground around them. What
//! a search for objects leaves of a roof would tell the ground beside it, and a whole roof or crown
//! between voids would raise a hill.

use raster::Grid;

use crate::canopy::distances_m;
use crate::coarse::{blurred, difference, slopes, without_cells};
use crate::objects::{CLEARING_MIN_M2, STEP_M};
use crate::pits::depth_m;
use crate::plate::plate;
use crate::regions::{Regions, quantile};
use crate::rejoin::{PER_SLOPE_M, SLOPE_HALF_WIDTH_M, STEEPEST, level_m};

/// Width of the surroundings of a part that tell whether it lies between voids, cells.
const SURROUNDINGS: isize = 3;

/// Height above most of the ground from which a part is none, metres: a storey.
const STOREY_M: f32 = 3.0;
/// Growth of that height with the distance, metres per metre: a slope of 11° that begins beyond the
/// other ground.
const STOREY_PER_M: f32 = 0.2;

/// Returns the cells of islands: small parts of a surface with more voids than heights around them.
pub(crate) fn islands(surface: &Grid<f32>, cell_m: f64) -> Grid<bool> {
    let parts = Parts::of(surface, cell_m);
    parts.mask(|part| parts.is_small(part) && parts.is_between_voids(part))
}

/// Returns the cells of the stray parts of a ground with NaN at everything else: small ones off the
/// ground around them, and others that stand above most of the ground.
pub(crate) fn stray(ground: &Grid<f32>, cell_m: f64, noise_m: f64) -> Grid<bool> {
    let mut is_stray = small_strays(ground, cell_m, noise_m);
    let raised = raised(&without_cells(ground, &is_stray), cell_m, noise_m);
    is_stray.data_mut().iter_mut().zip(raised.data()).for_each(|(is_stray, raised)| *is_stray |= raised);
    is_stray
}

/// Returns the cells of parts that stand above the ground of the largest one. Where it is less than
/// half of the ground, as in a dense quarter, nothing tells which parts are ground.
fn raised(ground: &Grid<f32>, cell_m: f64, noise_m: f64) -> Grid<bool> {
    let parts = Parts::of(ground, cell_m);
    let size = |part: &usize| parts.regions.cells(*part).len();
    let nowhere = ground.map(|_| false);
    let Some(largest) = (0..parts.regions.len()).max_by_key(size) else { return nowhere };
    let known = ground.data().iter().filter(|h| !h.is_nan()).count();
    if size(&largest) == known || 2 * size(&largest) < known {
        return nowhere;
    }
    let main = without_cells(ground, &parts.mask(|part| part != largest));
    let offset = difference(ground, &plate(&main, cell_m, noise_m));
    let distance = distances_m(&main, cell_m);
    parts.mask(|part| {
        let cells = parts.regions.cells(part).iter().map(|&cell| cell as usize);
        let mut raised: Vec<f32> = cells.map(|at| offset.data()[at] - STOREY_PER_M * distance.data()[at]).collect();
        part != largest && quantile(&mut raised, 0.5).is_some_and(|raised_m| raised_m > STOREY_M)
    })
}

/// Returns the cells of small parts off the ground.
///
/// The plate through the large parts tells where the others should lie. What lies above it has to
/// join the ground as every other cell does. What lies below it may be a yard, and is stray from
/// the depth of a pit on.
fn small_strays(ground: &Grid<f32>, cell_m: f64, noise_m: f64) -> Grid<bool> {
    let parts = Parts::of(ground, cell_m);
    let large = without_cells(ground, &parts.mask(|part| parts.is_small(part)));
    if large.data().iter().all(|h| h.is_nan()) {
        return ground.map(|_| false);
    }
    let expected = plate(&large, cell_m, noise_m);
    let slope = slopes(&blurred(&expected, (SLOPE_HALF_WIDTH_M / cell_m).round() as usize), cell_m);
    let offset = difference(ground, &expected);
    parts.mask(|part| {
        let cells = parts.regions.cells(part);
        let mut offsets: Vec<f32> = cells.iter().map(|&cell| offset.data()[cell as usize]).collect();
        let offset_m = quantile(&mut offsets, 0.5).unwrap_or(0.0);
        let allowed_m = if offset_m > 0.0 { level_m(noise_m) } else { depth_m(noise_m) };
        let slope = slope.data()[cells[cells.len() / 2] as usize].min(STEEPEST);
        parts.is_small(part) && offset_m.abs() > allowed_m + PER_SLOPE_M * slope
    })
}

/// The parts of a surface without steps.
struct Parts<'a> {
    surface: &'a Grid<f32>,
    regions: Regions,
    cell_m: f64,
}

impl<'a> Parts<'a> {
    fn of(surface: &'a Grid<f32>, cell_m: f64) -> Self {
        let is_known = surface.map(|h| !h.is_nan());
        Self { surface, regions: Regions::smooth(&is_known, surface, STEP_M.max(cell_m as f32)), cell_m }
    }

    /// Marks the cells of the parts that are `chosen`.
    fn mask(&self, chosen: impl Fn(usize) -> bool) -> Grid<bool> {
        let mut mask = self.surface.map(|_| false);
        for part in (0..self.regions.len()).filter(|part| chosen(*part)) {
            self.regions.cells(part).iter().for_each(|&cell| mask.data_mut()[cell as usize] = true);
        }
        mask
    }

    fn is_small(&self, part: usize) -> bool {
        (self.regions.cells(part).len() as f64) * self.cell_m.powi(2) < CLEARING_MIN_M2
    }

    fn is_between_voids(&self, part: usize) -> bool {
        let width = self.surface.width();
        let (mut voids, mut heights) = (0, 0);
        for &cell in self.regions.cells(part) {
            for (dx, dy) in [(1, 0), (-1, 0), (0, 1), (0, -1)] {
                for step in 1..=SURROUNDINGS {
                    let column = (cell as usize % width).checked_add_signed(step * dx);
                    let row = (cell as usize / width).checked_add_signed(step * dy);
                    let (Some(column), Some(row)) = (column, row) else { continue };
                    match self.surface.get(column, row) {
                        Some(height) if height.is_nan() => voids += 1,
                        Some(_) if !self.regions.holds(part, (row * width + column) as u32) => heights += 1,
                        _ => {}
                    }
                }
            }
        }
        voids > heights
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn small_parts_off_the_ground_are_stray_and_those_on_it_and_yards_are_not() {
        let mut ground = Grid::filled(80, 40, f32::NAN);
        (0..40).for_each(|row| ground.row_mut(row)[..20].fill(10.0));
        for (column, height) in [(30, 2.0), (40, 10.3), (50, 9.0), (60, 12.0)] {
            ground[(column, 20)] = height;
        }
        let found = stray(&ground, 1.0, 0.05);
        let columns: Vec<usize> = (0..80).filter(|column| found[(*column, 20)]).collect();
        assert_eq!(columns, [30, 60]);
        assert_eq!(found.data().iter().filter(|is| **is).count(), 2);
    }

    #[test]
    fn a_crown_between_voids_is_stray_and_a_bank_is_not() {
        let mut ground = Grid::filled(90, 60, 10.0);
        for row in 0..60 {
            ground.row_mut(row)[30..].fill(f32::NAN);
        }
        for row in 20..30 {
            ground.row_mut(row)[45..55].fill(24.0);
            ground.row_mut(row + 20)[45..55].fill(12.0);
        }
        let found = stray(&ground, 1.0, 0.05);
        assert!((45..55).all(|column| found[(column, 25)] && !found[(column, 45)]));
        assert_eq!(found.data().iter().filter(|is| **is).count(), 100);
    }

    #[test]
    fn ground_of_small_parts_alone_stays() {
        let mut ground = Grid::filled(20, 20, f32::NAN);
        (ground[(3, 3)], ground[(15, 12)]) = (1.0, 50.0);
        assert!(!stray(&ground, 1.0, 0.05).data().contains(&true));
    }

    #[test]
    fn islands_lie_between_voids_and_roofs_beside_them_make_no_islands_of_yards() {
        let mut surface = Grid::filled(60, 40, f32::NAN);
        for row in 10..30 {
            surface.row_mut(row)[10..30].fill(20.0);
            surface.row_mut(row)[18..22].fill(12.0);
        }
        surface[(45, 20)] = 3.0;
        let found = islands(&surface, 1.0);
        assert!(found[(45, 20)]);
        assert_eq!(found.data().iter().filter(|is| **is).count(), 1);
    }
}
