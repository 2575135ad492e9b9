//! Parts of a surface and of the ground that are no evidence by themselves.
//!
//! A few cells of a wrong match between voids would make an object of all ground around them. What
//! a search for objects leaves of a roof would tell the ground beside it, and a whole roof or crown
//! between voids would raise a hill.

use raster::Grid;

use crate::coarse::{add, difference, distances_m, without_cells};
use crate::objects::{CLEARING_MIN_M2, STEP_M, STOREY_M};
use crate::pits::depth_m;
use crate::plate::plate;
use crate::regions::Regions;
use crate::rejoin::{growth_m, level_m};

/// Width of the surroundings of a part that tell whether it lies between voids, cells.
const SURROUNDINGS: usize = 3;
/// Growth with the distance of the height from which a part stands above the largest one, metres
/// per metre: a slope of 11° that begins beyond the largest part.
const STOREY_PER_M: f32 = 0.2;

/// Returns the cells of islands: small parts of a surface with more voids than heights around them.
pub(crate) fn islands(surface: &Grid<f32>, cell_m: f64) -> Grid<bool> {
    let parts = parts(surface, cell_m);
    let is_between_voids = |part: usize| {
        let is_void = parts.around(part, SURROUNDINGS).map(|cell| surface.data()[cell as usize].is_nan());
        let (voids, cells) = is_void.fold((0, 0), |(voids, cells), is| (voids + usize::from(is), cells + 1));
        2 * voids > cells
    };
    parts.mask(|part| is_small(&parts, part, cell_m) && is_between_voids(part))
}

/// Returns the cells of the stray parts of a ground with NaN at everything else: small ones off the
/// ground around them, and others that stand above the largest one.
pub(crate) fn stray(ground: &Grid<f32>, cell_m: f64, noise_m: f64) -> Grid<bool> {
    let mut is_stray = small_strays(ground, cell_m, noise_m);
    let raised = raised(&without_cells(ground, &is_stray), cell_m, noise_m);
    add(&mut is_stray, &raised);
    is_stray
}

/// Returns the cells of small parts off the ground.
///
/// The plate through the large parts tells where the others should lie. What lies above it has to
/// join the ground as every other cell does. What lies below it may be a yard, and is stray from
/// the depth of a pit on.
fn small_strays(ground: &Grid<f32>, cell_m: f64, noise_m: f64) -> Grid<bool> {
    let parts = parts(ground, cell_m);
    let large = without_cells(ground, &parts.mask(|part| is_small(&parts, part, cell_m)));
    if large.data().iter().all(|h| h.is_nan()) {
        return ground.map(|_| false);
    }
    let expected = plate(&large, cell_m, noise_m);
    let growth_m = growth_m(&expected, cell_m);
    let offset = difference(ground, &expected);
    let is_off = |part: usize| {
        let offset_m = parts.median(part, |cell| offset.data()[cell]).unwrap_or(0.0);
        let allowed_m = if offset_m > 0.0 { level_m(noise_m) } else { depth_m(noise_m) };
        let cells = parts.cells(part);
        offset_m.abs() > allowed_m + growth_m.data()[cells[cells.len() / 2] as usize]
    };
    parts.mask(|part| is_small(&parts, part, cell_m) && is_off(part))
}

/// Returns the cells of parts that stand above the ground of the largest one. Where it is less than
/// half of the ground, as in a dense quarter, nothing tells which parts are ground.
fn raised(ground: &Grid<f32>, cell_m: f64, noise_m: f64) -> Grid<bool> {
    let parts = parts(ground, cell_m);
    let size = |part: &usize| parts.cells(*part).len();
    let known = ground.data().iter().filter(|h| !h.is_nan()).count();
    let largest = (0..parts.len()).max_by_key(size).filter(|part| size(part) < known && 2 * size(part) >= known);
    let Some(largest) = largest else { return ground.map(|_| false) };
    let main = without_cells(ground, &parts.mask(|part| part != largest));
    let offset = difference(ground, &plate(&main, cell_m, noise_m));
    let distance = distances_m(&main, cell_m);
    let above_m = |part: usize| parts.median(part, |cell| offset.data()[cell] - STOREY_PER_M * distance.data()[cell]);
    parts.mask(|part| part != largest && above_m(part).is_some_and(|above_m| above_m > STOREY_M))
}

/// Returns the parts of a surface without steps.
fn parts(surface: &Grid<f32>, cell_m: f64) -> Regions {
    Regions::smooth(&surface.map(|h| !h.is_nan()), surface, STEP_M.max(cell_m as f32))
}

fn is_small(parts: &Regions, part: usize, cell_m: f64) -> bool {
    (parts.cells(part).len() as f64) * cell_m.powi(2) < CLEARING_MIN_M2
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
