//! What the planes through the ground around rule out, and what they bring back.
//!
//! In surfaces made from images a search for objects by openings errs in two ways on slopes. A flat
//! roof is flush with the ground uphill, so the surface drops along too little of its border. And
//! where the matching carries such a roof on into the slope, the surface sinks below the ground,
//! and the ground beside it stands out as an object does. Planes that turn away from what lies off
//! the wider ones tell both: they know the slope that goes on under a roof.
//!
//! A crest that bends more than planes do stands above them, too, but has no wall. The rim of a
//! plateau has one on one side, and goes on level on the other, where a roof meets the slope with a
//! bend.

use raster::Grid;

use crate::coarse::{add, difference, slopes, without_cells};
use crate::config::GroundConfig;
use crate::objects::{DROP_SHARE, FREE_SHARE};
use crate::pits::{depth_m, heights_around};
use crate::regions::{Regions, quantile};
use crate::rejoin::{growth_by_m, level_m};
use crate::stray::void_share;
use crate::trend::robust_trend;

/// Rounds. Without what one has found, the planes of the next lie closer to the ground.
const ROUNDS: usize = 4;
/// Share of the border of a part along which the surface need not drop. The planes have told that
/// it stands out; a crest has no wall anywhere.
const WALL_FREE_SHARE: f64 = 0.9;
/// Longest border of which a wall somewhere is enough, metres: that of a block of houses 60 m wide,
/// half as long again in cells. Voids and trees hide the other walls. A longer one needs walls all
/// along, or bends: the rim of a plateau with a cliff on one side is no object.
const BLOCK_BORDER_M: f64 = 360.0;
/// Distance to each side of the border over which its bend is measured, metres: a wall of a surface
/// made from images is a ramp of two to three metres.
const BEND_REACH_M: f64 = 4.0;
/// Mean change of slope across the border where there is no wall, from which a part is an object: a
/// flat roof bends away from the slope that it is flush with. The rims of La Réunion have less, and
/// roofs of `random:` 9801, 9804 and 9878 twice as much.
const BEND: f32 = 0.3;
/// Height above the planes that the border of a part counts as having at least, where a wall is
/// told from a bend, metres: smaller drops are noise.
const LEAST_WALL_M: f32 = 1.0;
/// Heights around that lie below the planes, as a share of those at them, up to which the planes
/// know the ground. In a dense quarter they go through roofs of many heights, with the lower roofs
/// and the streets below.
const BELOW_SHARE: f64 = 0.2;

/// The search for what lies off the planes through the ground around it.
pub(crate) struct OffPlanes<'a> {
    /// The heights that show the walls, metres, without wrong islands.
    surface: &'a Grid<f32>,
    cell_m: f64,
    noise_m: f64,
    /// Distance from the planes from which a cell is no ground, and those around it that are not
    /// near the planes, metres.
    far_m: f32,
}

/// Heights above the planes.
struct Offset {
    /// Metres, NaN at voids.
    above: Grid<f32>,
    /// Distance from the planes up to which a cell is ground, metres.
    near_m: Grid<f32>,
}

impl<'a> OffPlanes<'a> {
    pub(crate) fn new(surface: &'a Grid<f32>, cell_m: f64, noise_m: f64, config: &GroundConfig) -> Self {
        let far_m = config.threshold_m(0.5 * config.widest_object_m, noise_m);
        Self { surface, cell_m, noise_m, far_m }
    }

    /// Returns the cells of the surface that are sunken below the ground.
    pub(crate) fn sunken(&self) -> Grid<bool> {
        self.settled(self.surface.map(|_| false), |is_sunken| {
            let offset = self.offset(self.surface, &without_cells(self.surface, is_sunken));
            self.sunken_parts(&offset)
        })
    }

    /// Returns the cells of `clear` heights that are no ground: the `objects` that do not lie at
    /// the planes, and what lies off the planes of all others.
    pub(crate) fn no_ground(&self, clear: &Grid<f32>, objects: &Grid<bool>) -> Grid<bool> {
        self.settled(objects.clone(), |is_off| {
            let mut offset = self.offset(clear, &without_cells(clear, is_off));
            let is_at = offset.above.zip_map(&offset.near_m, |above, near_m| above.abs() <= *near_m);
            let mut found = objects.zip_map(&is_at, |is_object, is_at| *is_object && !is_at);
            offset.above = without_cells(&offset.above, objects);
            add(&mut found, &self.raised_parts(&offset));
            add(&mut found, &self.sunken_parts(&offset));
            found
        })
    }

    /// Repeats a search without what it has found, as long as that changes. Where nothing would be
    /// left, the search ends.
    fn settled(&self, start: Grid<bool>, search: impl Fn(&Grid<bool>) -> Grid<bool>) -> Grid<bool> {
        let mut last = start;
        for _ in 0..ROUNDS {
            if without_cells(self.surface, &last).data().iter().all(|h| h.is_nan()) {
                break;
            }
            let found = search(&last);
            if found.data() == last.data() {
                break;
            }
            last = found;
        }
        last
    }

    fn offset(&self, heights: &Grid<f32>, ground: &Grid<f32>) -> Offset {
        let expected = robust_trend(ground, self.cell_m);
        let near_m = slopes(&expected, self.cell_m).map(|slope| level_m(self.noise_m) + growth_by_m(*slope));
        Offset { above: difference(heights, &expected), near_m }
    }

    /// Returns the cells of parts far above the planes whose border has walls, or voids that may
    /// hide them.
    fn raised_parts(&self, offset: &Offset) -> Grid<bool> {
        let parts = self.parts(offset);
        parts.mask(|part| {
            if !self.is_far(&parts, part, offset) {
                return false;
            }
            if self.is_border_void(&parts, part) {
                return true;
            }
            let mut excess_m = self.excess_m(&parts, part, offset, self.surface);
            let is_short = excess_m.len() as f64 * self.cell_m <= BLOCK_BORDER_M;
            has_walls(&mut excess_m, WALL_FREE_SHARE)
                && (is_short || has_walls(&mut excess_m, FREE_SHARE) || self.bends(&parts, part, offset))
        })
    }

    /// Returns the cells of parts far below the planes where those lie at the ground.
    fn sunken_parts(&self, Offset { above, near_m }: &Offset) -> Grid<bool> {
        let below = Offset { above: above.map(|above| -above), near_m: near_m.clone() };
        let turned = self.surface.map(|h| -h);
        let parts = self.parts(&below);
        parts.mask(|part| {
            self.is_far(&parts, part, &below)
                && self.is_ground_above(&parts, part, &below)
                && (self.is_border_void(&parts, part)
                    || has_walls(&mut self.excess_m(&parts, part, &below, &turned), WALL_FREE_SHARE))
        })
    }

    /// The parts above the planes that are not near them.
    fn parts(&self, offset: &Offset) -> Regions {
        Regions::of(&offset.above.zip_map(&offset.near_m, |above, near_m| above > near_m))
    }

    fn is_far(&self, parts: &Regions, part: usize, offset: &Offset) -> bool {
        parts.cells(part).iter().any(|&cell| offset.above.data()[cell as usize] > self.far_m)
    }

    fn is_border_void(&self, parts: &Regions, part: usize) -> bool {
        void_share(parts, part, self.surface) > FREE_SHARE
    }

    /// How much more a surface drops along the border of a part than a wall has to, metres, at each
    /// side of a cell with known heights beyond: a wall drops by about as much as the part stands
    /// above the planes there.
    fn excess_m(&self, parts: &Regions, part: usize, offset: &Offset, surface: &Grid<f32>) -> Vec<f32> {
        let drops = parts.drops_m(part, surface, self.cell_m).into_iter();
        drops.map(|(cell, drop_m)| drop_m - DROP_SHARE * offset.above.data()[cell as usize]).collect()
    }

    /// Whether the surface bends upwards at the border of a part where it has no wall, in the mean.
    /// True where walls are all around.
    fn bends(&self, parts: &Regions, part: usize, offset: &Offset) -> bool {
        let reach = ((BEND_REACH_M / self.cell_m).round() as usize).max(1);
        let (mut bend_m, mut count) = (0.0, 0.0);
        for (cell, [inside_m, border_m, outside_m]) in parts.across(part, self.surface, reach) {
            if border_m - outside_m < DROP_SHARE * offset.above.data()[cell as usize].max(LEAST_WALL_M) {
                bend_m += inside_m - 2.0 * border_m + outside_m;
                count += 1.0;
            }
        }
        bend_m >= BEND * count * (reach as f64 * self.cell_m) as f32
    }

    /// Whether the planes around a part below them lie at the ground: many heights lie there, and
    /// hardly any below.
    fn is_ground_above(&self, parts: &Regions, part: usize, below: &Offset) -> bool {
        let depth_m = depth_m(self.noise_m);
        let (mut at_planes, mut deeper) = (0_u32, 0_u32);
        for below_m in heights_around(&below.above, parts, part, self.cell_m) {
            at_planes += u32::from(below_m.abs() <= depth_m);
            deeper += u32::from(below_m > depth_m);
        }
        f64::from(deeper) < BELOW_SHARE * f64::from(at_planes)
    }
}

/// Whether a border, but for `free_share` of it, has walls; disorders the excess of its drops.
fn has_walls(excess_m: &mut [f32], free_share: f64) -> bool {
    quantile(excess_m, free_share).is_none_or(|excess_m| excess_m >= 0.0)
}

#[cfg(test)]
mod tests {
    use super::*;

    const SIDE: usize = 200;

    /// A slope of 40 %.
    fn slope(column: usize) -> f32 {
        0.4 * column as f32
    }

    fn surface(height: impl Fn(usize, usize) -> f32) -> Grid<f32> {
        Grid::from_vec(SIDE, SIDE, (0..SIDE * SIDE).map(|at| height(at % SIDE, at / SIDE)).collect()).unwrap()
    }

    fn is_roof(column: usize, row: usize) -> bool {
        (60..110).contains(&column) && (70..120).contains(&row)
    }

    fn share(found: &Grid<bool>, within: impl Fn(usize, usize) -> bool) -> f64 {
        let cells = (0..SIDE * SIDE).filter(|at| within(at % SIDE, at / SIDE));
        let (set, all) =
            cells.fold((0_usize, 0_usize), |(set, all), at| (set + usize::from(found.data()[at]), all + 1));
        set as f64 / all as f64
    }

    #[test]
    fn a_flat_roof_that_is_flush_with_the_slope_uphill_is_no_ground_and_the_slope_is() {
        let surface = surface(|column, row| if is_roof(column, row) { slope(110) } else { slope(column) });
        // The search for objects has left the roof and taken the slope above it.
        let is_uphill = |column: usize, row: usize| (112..140).contains(&column) && (70..120).contains(&row);
        let cells = (0..SIDE * SIDE).map(|at| is_uphill(at % SIDE, at / SIDE));
        let objects = Grid::from_vec(SIDE, SIDE, cells.collect()).unwrap();
        let found = OffPlanes::new(&surface, 1.0, 0.05, &GroundConfig::default()).no_ground(&surface, &objects);
        // What is left lies at the ground, within its tolerance.
        assert!(share(&found, |column, row| is_roof(column, row) && column < 105) > 0.98);
        assert!(share(&found, |column, row| !is_roof(column, row)) < 0.01);
    }

    #[test]
    fn a_crest_without_a_wall_is_ground() {
        let crest = surface(|column, _| 60.0 - 0.5 * column.abs_diff(100) as f32);
        let found = OffPlanes::new(&crest, 1.0, 0.05, &GroundConfig::default());
        assert_eq!(share(&found.no_ground(&crest, &crest.map(|_| false)), |_, _| true), 0.0);
        assert_eq!(share(&found.sunken(), |_, _| true), 0.0);
    }

    #[test]
    fn the_edge_of_a_plateau_above_a_cliff_is_ground() {
        // The plateau rises towards its edge, 25 m above the land below, and has some noise.
        let scarp = surface(|column, row| {
            let noise = ((column * 7 + row * 13) % 11) as f32 * 0.02;
            noise
                + if column < 100 + row % 40 / 4 {
                    25.0 + 0.002 * (column * column) as f32
                } else {
                    0.1 * (200 - column) as f32
                }
        });
        let found =
            OffPlanes::new(&scarp, 1.0, 0.05, &GroundConfig::default()).no_ground(&scarp, &scarp.map(|_| false));
        assert!(share(&found, |_, _| true) < 0.01);
    }

    #[test]
    fn a_roof_that_goes_on_into_the_slope_is_sunken_and_the_streets_of_a_dense_quarter_are_not() {
        let is_in_slope = |column: usize, row: usize| (110..125).contains(&column) && (70..120).contains(&row);
        let sunk = surface(|column, row| match is_roof(column, row) || is_in_slope(column, row) {
            true => slope(110),
            false => slope(column),
        });
        let found = OffPlanes::new(&sunk, 1.0, 0.05, &GroundConfig::default()).sunken();
        assert!(share(&found, |column, row| is_in_slope(column, row) && column > 113) > 0.98);
        assert!(share(&found, |column, row| !is_in_slope(column, row)) < 0.01);
        let quarter = surface(|column, row| match (column % 14 < 10, row % 14 < 10) {
            (true, true) => 6.0 + ((column / 14 * 5 + row / 14 * 3) % 8) as f32 * 2.0,
            _ => 0.0,
        });
        let found = OffPlanes::new(&quarter, 1.0, 0.05, &GroundConfig::default()).sunken();
        assert!(share(&found, |column, row| quarter[(column, row)] == 0.0) < 0.05);
    }
}
