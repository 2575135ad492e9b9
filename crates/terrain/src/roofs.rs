//! Ground that goes through roofs.
//!
//! In a dense quarter whose streets do not match, hardly anything but roofs is known. The search
//! for objects then takes houses for ground, as nothing lower lies within its windows. Such a
//! ground gives itself away: houses are of different heights, so some lie below it, and so do the
//! few streets that are known. Nothing but wrong heights lies below real ground.

use raster::Grid;

use crate::coarse::{blocks, blurred, difference, weighted_blocks};
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
/// Least share of heights more than a storey below such a ground: those of the streets, and of the
/// lower houses. Wrong heights below real ground were 2 % of a surface at most.
const BENEATH_SHARE: f32 = 0.05;
/// Greatest share of heights within a storey of such a ground: roofs of a quarter differ by more
/// than two storeys, and most heights lie at real ground that is seen.
const AT_SHARE: f32 = 0.5;
/// Side of the smallest quarter of which only roofs are known, metres: some houses with the streets
/// between them. A single tower and what it hides are smaller.
const QUARTER_M: f64 = 100.0;
/// Greatest deviation of roofs from planes, metres. Those in quarters of images had up to a third
/// of a metre, crowns half a metre and more.
const EVEN_M: f32 = 0.4;

/// Returns where the ground that was found in a surface with cells of `cell_m` metres goes through
/// roofs. It does so in parts of which a third is void, and where it lies more than a storey above
/// `lower`, a trend under the lowest heights around. Some heights of such a part lie more than a
/// storey below this ground, more of them lie that far over it, and less than half within a storey
/// of it. Some must lie at the trend, and all must be as even as roofs are: between crowns there
/// are crowns.
///
/// All three are in metres. Voids of the surface, and places without ground, are NaN.
///
/// ```
/// use raster::Grid;
/// use terrain::goes_through_roofs;
///
/// // Roofs of 9, 15 and 21 m, with a void between each two of them, and a street.
/// let roof = |i: usize| match i % 90 {
///     20..30 => 1.0,
///     column if column % 10 < 6 => 9.0 + 6.0 * (column / 10 % 3) as f32,
///     _ => f32::NAN,
/// };
/// let roofs = Grid::from_vec(90, 90, (0..8100).map(roof).collect()).unwrap();
/// let level = |height_m: f32| roofs.map(|_| height_m);
/// assert!(goes_through_roofs(&level(11.0), &roofs, &level(1.0), 1.0)[(45, 45)]);
/// assert!(!goes_through_roofs(&level(1.0), &roofs, &level(1.0), 1.0)[(45, 45)]);
/// ```
#[must_use]
pub fn goes_through_roofs(ground: &Grid<f32>, surface: &Grid<f32>, lower: &Grid<f32>, cell_m: f64) -> Grid<bool> {
    let quarter = Quarter::new(surface, ground, cell_m);
    let lower = blocks(lower, quarter.side);
    let above = blurred(&difference(&filled(&blocks(ground, quarter.side)), &lower), quarter.radius);
    let is_at_lower = |above_m: &f32| if above_m.abs() < STOREY_M { 1.0 } else { 0.0 };
    let off_lower = difference(&blocks(surface, quarter.side), &lower);
    let seen = blurred(&off_lower.map(is_at_lower), 2 * quarter.radius);
    let mut is_above = above.map(|above_m| *above_m > STOREY_M);
    let shares = is_above.data_mut().iter_mut().zip(seen.data());
    shares.for_each(|(is_above, share)| *is_above &= *share >= GROUND_SHARE);
    quarter.parts(&is_above, |part| {
        part.known < 1.0 - VOID_SHARE
            && part.beneath > BENEATH_SHARE * part.known
            && part.beneath < part.over
            && part.at < AT_SHARE * part.known
            && part.is_even
    })
}

/// Returns where hardly anything but roofs is known of a surface with cells of `cell_m` metres: in
/// wide parts with many voids in which more heights lie over the `ground` than at it, some lie at
/// it, and they are as even as roofs are. The voids of such a part are streets and yards.
///
/// Both are in metres. Voids of the surface, and places without ground, are NaN.
///
/// ```
/// use raster::Grid;
/// use terrain::shows_hardly_but_roofs;
///
/// // Roofs of 9 m with voids between them, and a street.
/// let roof = |i: usize| match i % 180 {
///     90..100 => 1.0,
///     column if column % 10 < 5 => 9.0,
///     _ => f32::NAN,
/// };
/// let roofs = Grid::from_vec(180, 180, (0..180 * 180).map(roof).collect()).unwrap();
/// let ground = roofs.map(|_| 1.0);
/// assert!(shows_hardly_but_roofs(&roofs, &ground, 1.0)[(45, 45)]);
/// assert!(!shows_hardly_but_roofs(&ground, &ground, 1.0)[(45, 45)]);
/// ```
#[must_use]
pub fn shows_hardly_but_roofs(surface: &Grid<f32>, ground: &Grid<f32>, cell_m: f64) -> Grid<bool> {
    let quarter = Quarter::new(surface, ground, cell_m);
    let is_sparse = blurred(&quarter.known, quarter.radius).map(|known| *known < 1.0 - VOID_SHARE);
    quarter.parts(&is_sparse, |part| {
        part.area_m2 >= QUARTER_M * QUARTER_M
            && part.over > part.at
            && part.at > GROUND_SHARE * part.known
            && part.is_even
    })
}

/// What is known of a surface, by blocks.
struct Quarter {
    /// Side of a block, metres, and in cells of the surface.
    side_m: f64,
    side: usize,
    /// Half-width of the surroundings, blocks.
    radius: usize,
    /// Cells of the surface.
    size: (usize, usize),
    /// Share of cells with a height.
    known: Grid<f32>,
    /// Share of cells with a height more than a storey below the ground.
    beneath: Grid<f32>,
    /// Share of cells with a height within a storey of the ground.
    at: Grid<f32>,
    /// Share of cells with a height more than a storey over the ground.
    over: Grid<f32>,
    /// Deviations from the planes around, metres.
    uneven: Grid<f32>,
}

/// The means of [`Quarter`] over a part of the surface, and the size of that part.
struct Part {
    area_m2: f64,
    known: f32,
    beneath: f32,
    at: f32,
    over: f32,
    is_even: bool,
}

impl Quarter {
    fn new(surface: &Grid<f32>, ground: &Grid<f32>, cell_m: f64) -> Self {
        let fine = work_side(cell_m);
        let fine_m = cell_m * fine as f64;
        let fine_in_block = ((BLOCK_M / fine_m).round() as usize).max(1);
        let side = fine * fine_in_block;
        let side_m = cell_m * side as f64;
        let off = difference(surface, ground);
        let share = |of: &Grid<f32>, is: fn(f32) -> bool| {
            weighted_blocks(of, side, |cell| if is(of.data()[cell]) { 1.0 } else { 0.0 }).1
        };
        Self {
            side_m,
            side,
            radius: (SURROUNDINGS_M / side_m).round() as usize,
            size: (surface.width(), surface.height()),
            known: share(surface, |_| true),
            beneath: share(&off, |off_m| off_m < -STOREY_M),
            at: share(&off, |off_m| off_m.abs() <= STOREY_M),
            over: share(&off, |off_m| off_m > STOREY_M),
            uneven: blocks(&unevenness(&blocks(surface, fine), fine_m), fine_in_block),
        }
    }

    /// Returns the cells of the connected parts of a mask of blocks that are `chosen`.
    fn parts(&self, mask: &Grid<bool>, chosen: impl Fn(&Part) -> bool) -> Grid<bool> {
        let parts = Regions::of(mask);
        let blocks = parts.mask(|part| {
            let cells = parts.cells(part);
            let mean =
                |of: &Grid<f32>| cells.iter().map(|&block| of.data()[block as usize]).sum::<f32>() / cells.len() as f32;
            let uneven_m = parts.median(part, |block| self.uneven.data()[block]);
            chosen(&Part {
                area_m2: cells.len() as f64 * self.side_m * self.side_m,
                known: mean(&self.known),
                beneath: mean(&self.beneath),
                at: mean(&self.at),
                over: mean(&self.over),
                is_even: uneven_m.is_some_and(|uneven_m| uneven_m < EVEN_M),
            })
        });
        let mut out = Grid::filled(self.size.0, self.size.1, false);
        for row in 0..out.height() {
            let blocks = blocks.row(row / self.side);
            out.row_mut(row).iter_mut().enumerate().for_each(|(column, out)| *out = blocks[column / self.side]);
        }
        out
    }
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

    /// A ground that goes through the roofs of [`quarter`].
    fn through_roofs(slope: &Grid<f32>) -> Grid<f32> {
        slope.map(|h| h + 9.0)
    }

    #[test]
    fn a_ground_among_roofs_of_many_heights_is_none() {
        let (slope, surface) = quarter(|_| f32::NAN);
        let is_any = |ground: &Grid<f32>, lower: &Grid<f32>| {
            goes_through_roofs(ground, &surface, lower, 1.0).data().contains(&true)
        };
        let ground = through_roofs(&slope);
        assert!(goes_through_roofs(&ground, &surface, &slope, 1.0).data().iter().all(|is| *is));
        // A trend that no height bears out, the slope itself, and one far below it.
        let deep = slope.map(|h| h - 9.0);
        assert!(!is_any(&ground, &deep) && !is_any(&slope, &slope) && !is_any(&slope, &deep));
        // Most heights lie below: what stands out of this ground is not a quarter.
        assert!(!is_any(&slope.map(|h| h + 17.0), &slope));
    }

    #[test]
    fn few_wrong_heights_below_the_ground_make_it_no_roofs() {
        let (slope, mut surface) = quarter(|_| f32::NAN);
        for (i, height) in surface.data_mut().iter_mut().enumerate().filter(|(_, h)| !h.is_nan()) {
            *height -= if i % 50 == 0 { 20.0 } else { 0.0 };
        }
        let low = slope.map(|h| h - 8.0);
        assert!(!goes_through_roofs(&slope, &surface, &low, 1.0).data().contains(&true));
    }

    #[test]
    fn a_ground_at_which_most_heights_lie_goes_through_no_roofs() {
        let is_through = |is_ground_seen: bool| {
            let is_seen = |ground_m: f32| is_ground_seen && ((5.0 * ground_m) as usize).is_multiple_of(2);
            let (slope, mut surface) = quarter(|ground_m| if is_seen(ground_m) { ground_m } else { f32::NAN });
            // Every second house is void, and in one square in four the ground is too low.
            for (i, height) in surface.data_mut().iter_mut().enumerate() {
                let (squares, ground_m) = (i % 180 / 14 + i / 180 / 14, slope.data()[i]);
                match *height > ground_m {
                    true if squares % 2 == 1 => *height = f32::NAN,
                    false if squares % 4 == 0 => *height -= 8.0,
                    _ => {}
                }
            }
            let low = slope.map(|h| h - 8.0);
            goes_through_roofs(&slope, &surface, &low, 1.0).data().contains(&true)
        };
        assert!(is_through(false) && !is_through(true));
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
            let with_between = |between_m: f32, height: &dyn Fn(f64, f64) -> f32| {
                let places = (0..count * count).map(|i| ((i % count) as f64 * cell_m, (i / count) as f64 * cell_m));
                let is_between = |y: f64| (180.0..250.0).contains(&y);
                let cells = places.map(|(x, y)| if is_between(y) { between_m } else { height(x, y) });
                Grid::from_vec(count, count, cells.collect()).unwrap()
            };
            let (surface, ground) = (with_between(f32::NAN, &height), with_between(0.0, &|_, _| 9.0));
            let through = goes_through_roofs(&ground, &surface, &ground.map(|_| 0.0), cell_m);
            let row = |y: f64| through.row((y / cell_m) as usize);
            assert!(row(20.0).iter().all(|is| *is) && !row(280.0).contains(&true), "{cell_m}");
        }
    }

    #[test]
    fn a_surface_without_voids_shows_what_its_ground_is() {
        let (slope, surface) = quarter(|height| height);
        assert!(!goes_through_roofs(&through_roofs(&slope), &surface, &slope, 1.0).data().contains(&true));
    }

    #[test]
    fn a_quarter_of_roofs_is_wide_and_hides_its_streets() {
        let (slope, surface) = quarter(|_| f32::NAN);
        assert!(shows_hardly_but_roofs(&surface, &slope, 1.0).data().iter().all(|is| *is));
        let (_, known) = quarter(|height| height);
        assert!(!shows_hardly_but_roofs(&known, &slope, 1.0).data().contains(&true));
        // Ground around some houses, and a ground at which nothing lies.
        let mut around = slope.clone();
        (60..110).for_each(|row| around.row_mut(row)[60..110].copy_from_slice(&surface.row(row)[60..110]));
        assert!(!shows_hardly_but_roofs(&around, &slope, 1.0).data().contains(&true));
        let deep = slope.map(|h| h - 9.0);
        assert!(!shows_hardly_but_roofs(&surface, &deep, 1.0).data().contains(&true));
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
            goes_through_roofs(&through_roofs(&slope), &surface, &slope, 1.0)
        };
        assert!(with_bumps(0.2).data().iter().all(|is| *is));
        assert!(!with_bumps(1.5).data().contains(&true));
        assert!(!with_bumps(4.0).data().contains(&true));
    }
}
