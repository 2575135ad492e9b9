//! Ground that goes through roofs.
//!
//! In a dense quarter whose streets do not match, hardly anything but roofs is known. The search
//! for objects then takes houses for ground, as nothing lower lies within its windows. Such a
//! ground gives itself away: houses are of different heights, so it is rough, and it lies above the
//! lowest heights of the quarter.

use raster::Grid;

use crate::coarse::{blocks, blurred, difference, weighted_blocks};
use crate::forest::roughness;
use crate::ground::{unevenness, work_side};
use crate::membrane::filled;
use crate::objects::STOREY_M;
use crate::regions::Regions;

/// Side of the blocks that are compared, metres: half of a small house.
const BLOCK_M: f64 = 5.0;
/// Half-width of the surroundings that a ground is judged in, metres: a few houses to each side.
const SURROUNDINGS_M: f64 = 30.0;
/// Least share of voids in such a quarter: the streets and yards of the densest quarters take more.
const VOID_SHARE: f32 = 0.3;
/// Least share of blocks with heights near the trend, within twice the surroundings: an eighth of
/// the streets. Without them the trend lies under a few wrong heights, or comes from far away.
const GROUND_SHARE: f32 = 0.05;
/// Greatest deviation of roofs from planes, metres. Those in quarters of images had up to a third
/// of a metre, crowns half a metre and more.
const EVEN_M: f32 = 0.4;

/// Returns where the ground that was found in a surface with cells of `cell_m` metres goes through
/// roofs: in parts with many voids that lie more than a storey above `lower`, a trend under the
/// lowest heights around, and deviate from the planes around by more than half a storey. Real
/// ground is smoother between its voids. Some heights of the surface must lie at the trend, and the
/// others must be as even as roofs are: between crowns there are crowns.
///
/// All three are in metres. Voids of the surface, and places without ground, are NaN.
///
/// ```
/// use raster::Grid;
/// use terrain::goes_through_roofs;
///
/// // Roofs of 9, 13 and 17 m, with a void between each two of them, and a street.
/// let roof = |i: usize| match i % 90 {
///     20..30 => 1.0,
///     column if column % 10 < 6 => 9.0 + 4.0 * (column / 10 % 3) as f32,
///     _ => f32::NAN,
/// };
/// let roofs = Grid::from_vec(90, 90, (0..8100).map(roof).collect()).unwrap();
/// let level = |height_m: f32| roofs.map(|_| height_m);
/// assert!(goes_through_roofs(&roofs, &roofs, &level(1.0), 1.0)[(45, 45)]);
/// assert!(!goes_through_roofs(&level(9.0), &roofs, &level(1.0), 1.0)[(45, 45)]);
/// ```
#[must_use]
pub fn goes_through_roofs(ground: &Grid<f32>, surface: &Grid<f32>, lower: &Grid<f32>, cell_m: f64) -> Grid<bool> {
    let fine = work_side(cell_m);
    let fine_m = cell_m * fine as f64;
    let fine_in_block = ((BLOCK_M / fine_m).round() as usize).max(1);
    let side = fine * fine_in_block;
    let radius = (SURROUNDINGS_M / (cell_m * side as f64)).round() as usize;
    let coarse = filled(&blocks(ground, side));
    let lower = blocks(lower, side);
    let above = blurred(&difference(&coarse, &lower), radius);
    let rough = roughness(&coarse, radius);
    let (_, known) = weighted_blocks(surface, side, |_| 1.0);
    let is_at_lower = |above_m: &f32| if above_m.abs() < STOREY_M { 1.0 } else { 0.0 };
    let seen = blurred(&difference(&blocks(surface, side), &lower).map(is_at_lower), 2 * radius);
    let mut is_above = above.map(|above_m| *above_m > STOREY_M);
    let shares = is_above.data_mut().iter_mut().zip(seen.data());
    shares.for_each(|(is_above, share)| *is_above &= *share >= GROUND_SHARE);
    let uneven = blocks(&unevenness(&blocks(surface, fine), fine_m), fine_in_block);
    let parts = Regions::of(&is_above);
    let is_through = |part| {
        let median = |of: &Grid<f32>| parts.median(part, |block| of.data()[block]);
        let cells = parts.cells(part);
        let known_share = cells.iter().map(|&block| known.data()[block as usize]).sum::<f32>() / cells.len() as f32;
        known_share < 1.0 - VOID_SHARE
            && median(&rough).is_some_and(|rough_m| rough_m > 0.5 * STOREY_M)
            && median(&uneven).is_some_and(|uneven_m| uneven_m < EVEN_M)
    };
    let through = parts.mask(is_through);
    let mut out = ground.map(|_| false);
    for row in 0..out.height() {
        let blocks = through.row(row / side);
        out.row_mut(row).iter_mut().enumerate().for_each(|(column, out)| *out = blocks[column / side]);
    }
    out
}

#[cfg(test)]
mod tests {
    use super::*;

    /// Houses of 8 × 8 m in squares of 14 m, whose roofs stand 6 to 20 m above a slope of 20 %. One
    /// in nine squares is a yard.
    fn quarter(between: impl Fn(f32) -> f32) -> (Grid<f32>, Grid<f32>) {
        let slope = Grid::from_vec(180, 180, (0..180 * 180).map(|i| 0.2 * (i % 180) as f32).collect()).unwrap();
        let mut surface = slope.clone();
        for row in 0..180 {
            for (column, height) in surface.row_mut(row).iter_mut().enumerate() {
                let (x, y) = (column / 14, row / 14);
                let roof_m = 6.0 + ((x * 5 + y * 3) % 8) as f32 * 2.0;
                *height = match (x % 3 == 1 && y % 3 == 1, column % 14 < 8 && row % 14 < 8) {
                    (true, _) => *height,
                    (_, true) => *height + roof_m,
                    _ => between(*height),
                };
            }
        }
        (slope, surface)
    }

    #[test]
    fn roofs_of_many_heights_between_voids_are_no_ground() {
        let (slope, surface) = quarter(|_| f32::NAN);
        let through = goes_through_roofs(&filled(&surface), &surface, &slope, 1.0);
        assert!(through.data().iter().all(|is| *is));
        // A trend that no height bears out, the slope itself, and a smooth ground above the yards.
        let deep = slope.map(|h| h - 9.0);
        assert!(!goes_through_roofs(&filled(&surface), &surface, &deep, 1.0).data().contains(&true));
        assert!(!goes_through_roofs(&slope, &surface, &slope, 1.0).data().contains(&true));
        assert!(!goes_through_roofs(&slope.map(|h| h + 9.0), &surface, &slope, 1.0).data().contains(&true));
    }

    /// Houses in the north, crowns in the south, and a void of 70 m between. Blocks hold whole
    /// cells of those on which roofs are told from crowns, whatever the side of a cell.
    #[test]
    fn roofs_and_crowns_are_told_apart_where_they_stand() {
        let height = |x: f64, y: f64| {
            let (column, row) = ((x / 14.0) as usize, (y / 14.0) as usize);
            let bump_m = if y > 200.0 { [0.0, 4.0, 1.5][(x + y) as usize % 3] } else { 0.0 };
            match (column % 3 == 1 && row % 3 == 1, x % 14.0 < 8.0 && y % 14.0 < 8.0) {
                (true, _) => 0.0,
                (_, true) => 6.0 + ((column * 5 + row * 3) % 8) as f32 * 2.0 + bump_m,
                _ => f32::NAN,
            }
        };
        for cell_m in [0.3, 0.4, 0.7, 1.0] {
            let count = (300.0 / cell_m) as usize;
            let with_between = |between_m: f32| {
                let places = (0..count * count).map(|i| ((i % count) as f64 * cell_m, (i / count) as f64 * cell_m));
                let is_between = |y: f64| (180.0..250.0).contains(&y);
                let cells = places.map(|(x, y)| if is_between(y) { between_m } else { height(x, y) });
                Grid::from_vec(count, count, cells.collect()).unwrap()
            };
            let (surface, ground) = (with_between(f32::NAN), filled(&with_between(0.0)));
            let through = goes_through_roofs(&ground, &surface, &ground.map(|_| 0.0), cell_m);
            let row = |y: f64| through.row((y / cell_m) as usize);
            assert!(row(20.0).iter().all(|is| *is) && !row(280.0).contains(&true), "{cell_m}");
        }
    }

    #[test]
    fn a_surface_without_voids_shows_what_its_ground_is() {
        let (slope, surface) = quarter(|height| height);
        assert!(!goes_through_roofs(&surface, &surface, &slope, 1.0).data().contains(&true));
    }

    #[test]
    fn unknown_ground_goes_through_nothing() {
        let unknown = Grid::filled(40, 30, f32::NAN);
        assert!(!goes_through_roofs(&unknown, &unknown, &unknown.map(|_| 0.0), 1.0).data().contains(&true));
    }

    #[test]
    fn crowns_are_no_roofs() {
        let (slope, roofs) = quarter(|_| f32::NAN);
        let with_bumps = |height_m: f32| {
            let mut surface = roofs.clone();
            for (i, height) in surface.data_mut().iter_mut().enumerate() {
                if *height > slope.data()[i] {
                    *height += height_m * [0.0, 1.0, 0.4][i % 180 % 3];
                }
            }
            goes_through_roofs(&filled(&surface), &surface, &slope, 1.0)
        };
        assert!(with_bumps(0.2).data().iter().all(|is| *is));
        assert!(!with_bumps(1.5).data().contains(&true));
        assert!(!with_bumps(4.0).data().contains(&true));
    }
}
