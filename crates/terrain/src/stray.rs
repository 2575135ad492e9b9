//! Parts of a surface and of the ground that are no evidence by themselves.
//!
//! A few cells of a wrong match between voids would make an object of all ground around them. What
//! a search for objects leaves of a roof would tell the ground beside it, and a whole roof or crown
//! between voids would raise a hill.

use raster::Grid;

use crate::coarse::{add, cones, difference, smooth_slopes, without_cells};
use crate::membrane::filled;
use crate::objects::{CLEARING_MIN_M2, FREE_SHARE, STEP_M, STOREY_M};
use crate::pits::depth_m;
use crate::plate::plate;
use crate::regions::{Regions, quantile};
use crate::rejoin::{growth_m, level_m};

/// Width of the surroundings of a part that tell whether it lies between voids, cells.
const SURROUNDINGS: usize = 3;
/// Share of the known ground that is less steep than what may lie between two of its parts, and
/// what that may be steeper, height per distance.
const STEEP_SHARE: f64 = 0.9;
const STEEPER: f32 = 0.2;

/// Returns the cells of islands: small parts of a surface with more voids than heights around them.
pub(crate) fn islands(surface: &Grid<f32>, cell_m: f64) -> Grid<bool> {
    let parts = parts(surface, cell_m);
    parts.mask(|part| is_small(&parts, part, cell_m) && void_share(&parts, part, surface) > 0.5)
}

/// Returns the cells of the stray parts of a ground with NaN at everything else: small ones off the
/// ground around them, and others that stand above it. `surface` is what the ground was found in,
/// if its voids may hide how far it drops.
pub(crate) fn stray(ground: &Grid<f32>, surface: Option<&Grid<f32>>, cell_m: f64, noise_m: f64) -> Grid<bool> {
    let mut is_stray = small_strays(ground, cell_m, noise_m);
    if let Some(surface) = surface {
        let raised = raised(&without_cells(ground, &is_stray), surface, cell_m);
        add(&mut is_stray, &raised);
    }
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

/// Returns the cells of parts between voids that stand above the ground of others: a slope to them
/// would be steeper than the ground is elsewhere. Where less of the border lies at voids, the
/// search for objects has seen how far the surface drops, and a terrace stays.
fn raised(ground: &Grid<f32>, surface: &Grid<f32>, cell_m: f64) -> Grid<bool> {
    let parts = parts(ground, cell_m);
    let large = without_cells(ground, &parts.mask(|part| is_small(&parts, part, cell_m)));
    let highest = cones(&large, steepest(&large, cell_m) * cell_m as f32);
    let above = difference(ground, &highest);
    let is_above =
        |part: usize| parts.median(part, |cell| above.data()[cell]).is_some_and(|above_m| above_m > STOREY_M);
    parts.mask(|part| void_share(&parts, part, surface) > FREE_SHARE && is_above(part))
}

/// Returns the steepest slope that may lie between parts of a ground, height per distance.
fn steepest(ground: &Grid<f32>, cell_m: f64) -> f32 {
    let slopes = smooth_slopes(&filled(ground), cell_m);
    let known = slopes.data().iter().zip(ground.data()).filter(|(_, h)| !h.is_nan());
    quantile(&mut known.map(|(slope, _)| *slope).collect::<Vec<f32>>(), STEEP_SHARE).unwrap_or(0.0) + STEEPER
}

/// Returns the share of voids around a part.
pub(crate) fn void_share(parts: &Regions, part: usize, surface: &Grid<f32>) -> f64 {
    let is_void = parts.around(part, SURROUNDINGS).map(|cell| surface.data()[cell as usize].is_nan());
    let (voids, cells) = is_void.fold((0, 0), |(voids, cells), is| (voids + usize::from(is), cells + 1));
    voids as f64 / cells.max(1) as f64
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
        let found = stray(&ground, Some(&ground), 1.0, 0.05);
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
        let found = stray(&ground, Some(&ground), 1.0, 0.05);
        assert!((45..55).all(|column| found[(column, 25)] && !found[(column, 45)]));
        assert_eq!(found.data().iter().filter(|is| **is).count(), 100);
    }

    /// Strips of ground and of roofs: the ground that the most cells show is less than half of all.
    #[test]
    fn roofs_between_voids_are_stray_and_the_next_terrace_of_a_known_bank_is_not() {
        let level = |column: usize| match column {
            0..20 => 10.0,
            30..40 => 30.0,
            50..70 => 11.0,
            80..95 => 40.0,
            _ => f32::NAN,
        };
        let ground = Grid::from_vec(100, 40, (0..4000).map(|at| level(at % 100)).collect()).unwrap();
        let found = stray(&ground, Some(&ground), 1.0, 0.05);
        let columns: Vec<usize> = (0..100).filter(|column| found[(*column, 20)]).collect();
        assert_eq!(columns, (30..40).chain(80..95).collect::<Vec<usize>>());
        let known = filled(&ground);
        assert!(!stray(&ground, Some(&known), 1.0, 0.05).data().contains(&true));
    }

    #[test]
    fn ground_of_small_parts_alone_stays() {
        let mut ground = Grid::filled(20, 20, f32::NAN);
        (ground[(3, 3)], ground[(15, 12)]) = (1.0, 50.0);
        assert!(!stray(&ground, Some(&ground), 1.0, 0.05).data().contains(&true));
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
